"""Posterior densities against closed forms, and sampled against profile likelihoods."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from toy import KEYS, TRUTH, X, formula, readings, scene

import jbeamshell as jb
from jbeamshell import identify
from jbeamshell.identify.parameters import Parameter
from jbeamshell.measured.example import example_loops

MU, ETA, KAPPA = KEYS
NOISE = 2e-3
FIXED = {MU: TRUTH[MU], ETA: TRUTH[ETA]}
LINEAR = Parameter(KAPPA, low=0.0, high=5.0, scale="linear")
SLOPE = 0.2 * X  # of the formula along kappa_s


@pytest.fixture(scope="module")
def known():
    """Posterior of three parameters under measured noise."""
    free = [Parameter(MU, low=0.01, high=1.0), Parameter(ETA, low=0.01, high=2.0), KAPPA]
    return identify.fit(readings(NOISE, known=True), scene(), free).posterior()


def along(density, values):
    """Density over one parameter, normalised, at its values (points,)."""
    found = np.exp(jax.jit(jax.vmap(density.loglikelihood))(values[:, None]))
    return found / np.trapezoid(found, values)


def test_the_likelihood_is_that_of_the_noise(known):
    data = readings(NOISE, known=True)
    for values in ([0.1, 0.2, 0.44], [0.103, 0.19, 0.5]):
        left = (np.asarray(formula(X, *values)) - data.y) / NOISE
        best = (np.asarray(formula(X, *known.constrain(known.start))) - data.y) / NOISE
        expected = -0.5 * (left @ left - best @ best)
        assert float(known.loglikelihood(values)) == pytest.approx(expected, rel=1e-6)


def test_points_and_values_are_one_to_one(known):
    for theta in (known.start, known.start + 0.3):
        values = known.constrain(theta)
        np.testing.assert_allclose(values, known.uncertainty.space.values(theta), rtol=1e-12)
        np.testing.assert_allclose(known.unconstrain(values), theta, rtol=1e-9, atol=1e-12)


def test_gradients_are_derivatives_under_all_transformations(known):
    at = jnp.asarray(known.start + 0.01)
    value, gradient = jax.jit(jax.value_and_grad(known.logdensity))(at)
    density = jax.jit(known.logdensity)
    assert float(value) == pytest.approx(float(density(at)), rel=1e-12)
    for axis in range(3):
        step = 1e-5 * np.eye(3)[axis]
        rise = (density(at + step) - density(at - step)) / 2e-5
        assert float(gradient[axis]) == pytest.approx(float(rise), rel=1e-5, abs=1e-5)
    several = jnp.stack([at, at + 0.02])
    each = [float(density(one)) for one in several]
    np.testing.assert_allclose(jax.jit(jax.vmap(known.logdensity))(several), each, rtol=1e-12)


def test_one_linear_parameter_is_normal_and_without_known_noise_student():
    rest = readings(NOISE).y - np.asarray(formula(X, *FIXED.values(), 0.0))
    best, spread = SLOPE @ rest / (SLOPE @ SLOPE), 1.0 / np.sqrt(SLOPE @ SLOPE)
    values = best + NOISE * spread * np.linspace(-8.0, 8.0, 161)
    density = identify.fit(readings(NOISE, known=True), scene(**FIXED), LINEAR).posterior()
    expected = stats.norm.pdf(values, best, NOISE * spread)
    np.testing.assert_allclose(along(density, values), expected, rtol=1e-3, atol=1e-6)
    density = identify.fit(readings(NOISE), scene(**FIXED), LINEAR).posterior()
    freedom = X.size - 1
    left = rest - best * SLOPE
    size = np.sqrt(left @ left / freedom) * spread
    expected = stats.t.pdf(values, freedom, best, size)
    np.testing.assert_allclose(along(density, values), expected, rtol=5e-3, atol=1e-3)


def test_flat_and_normal_priors_weigh_as_they_say():
    data = readings(NOISE, known=True)
    flat = identify.fit(data, scene(**FIXED), Parameter(KAPPA)).posterior()
    one, other = flat.start, flat.start + 0.5  # log kappa_s: flat in the point itself
    rise = float(flat.logdensity(other) - flat.logdensity(one))
    likely = flat.loglikelihood(flat.constrain(other)) - flat.loglikelihood(flat.constrain(one))
    assert rise == pytest.approx(float(likely), rel=1e-9)
    prior = Parameter(KAPPA, prior=(0.45, 0.02))
    given = identify.fit(data, scene(**FIXED), prior).posterior()
    (x, y) = (float(given.constrain(theta)[0]) for theta in (one, other))
    weight = float(given.logdensity(other) - given.logdensity(one))
    weight -= float(given.loglikelihood([y]) - given.loglikelihood([x]))
    belief = stats.norm(0.45, 0.02)
    expected = belief.logpdf(y) - belief.logpdf(x) + np.log(y / x)
    assert weight == pytest.approx(expected, rel=1e-6)


def test_a_value_at_its_bound_has_no_posterior():
    free = [Parameter(MU, low=0.12, high=0.5), ETA]
    data = readings(NOISE, known=True)
    fit = identify.fit(data, scene(**{KAPPA: 0.44}), free, starts=1)
    with pytest.raises(jb.InputError, match=r"posterior: contact.friction ended at its bound"):
        fit.posterior()


@pytest.mark.slow
def test_sampled_intervals_are_those_of_profiles():
    """Random walk of blackjax on loops of finite elements with 1 % noise."""
    import blackjax

    random, loops = np.random.default_rng(5), []
    for loop in example_loops(0.1126, (0.5851, 1.6)):
        u = loop.displacement
        noise = 0.01 * np.ptp(u) * random.standard_normal(u.size)
        loops.append(loop.but(displacement=u + noise))
    coarse = {"model.nodes": 21, "model.kinematics": "linear", "contact.normal": "held"}
    fit = identify.fit(loops, jb.Scene().replace(coarse), [MU, ETA], points=48)
    problem = fit.posterior()
    stride = blackjax.mcmc.random_walk.normal(1.7 * np.linalg.cholesky(problem.covariance))
    sampler = blackjax.additive_step_random_walk(problem.logdensity, stride)
    step, state, points = jax.jit(sampler.step), sampler.init(jnp.asarray(problem.start)), []
    for key in jax.random.split(jax.random.key(1), 4000):
        state, _ = step(key, state)
        points.append(np.asarray(problem.constrain(state.position)))
    sampled = np.quantile(np.array(points)[200:], (0.025, 0.975), axis=0).T
    for name, ends in zip(problem.names, sampled, strict=True):
        profiled = np.array(fit.profile(name).interval)
        np.testing.assert_allclose(ends, profiled, atol=0.1 * np.ptp(profiled))

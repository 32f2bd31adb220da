import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell import identify
from jbeamshell.example import example_loops
from jbeamshell.loops import make_loop

FREE = ("contact.friction", "strip.height_ratio")
MODEL = {
    "model.nodes": 41,
    "model.kinematics": "linear",
    "load.steps_per_half_cycle": 24,
    "load.amplitude": 1.0,
}
TRUTH = np.array([0.1, 0.1126])


@pytest.fixture(scope="module")
def planted():
    """The model's own steady loop, and where a fit of it starts."""
    scene = jb.Scene().replace(MODEL)
    force, displacement = map(np.asarray, jb.solve(scene).loop)
    start = scene.replace({"contact.friction": 0.14, "strip.height_ratio": 0.08})
    return force, displacement, start


def test_planted_parameters_come_back(planted):
    force, displacement, start = planted
    lines = []
    fit = identify.fit(make_loop(force, displacement), start, FREE, progress=lines.append)
    np.testing.assert_allclose(list(fit.values.values()), TRUTH, rtol=1e-6)
    assert fit.misfit < 1e-8
    assert fit.status == "converged"
    assert len(lines) < fit.model_runs + 1
    assert "contact.friction" in lines[0]
    assert float(fit.scene.contact.friction) == fit.values["contact.friction"]


def test_noise_is_covered_by_the_standard_errors(planted):
    """Twenty repeats with 1 % noise: within 3 standard errors, neither too small nor too large."""
    force, displacement, start = planted
    random = np.random.default_rng(7)
    scores = []
    for _ in range(20):
        noise = 0.01 * np.ptp(displacement) * random.standard_normal(displacement.size)
        fit = identify.fit(make_loop(force, displacement + noise), start, FREE)
        errors = np.array(list(fit.errors.values()))
        scores.append((np.array(list(fit.values.values())) - TRUTH) / errors)
    scores = np.array(scores)
    assert np.max(np.abs(scores)) < 3.0
    assert np.all(np.abs(scores.mean(axis=0)) < 3.0 / np.sqrt(20))
    assert 0.65 < scores.std() < 1.35


def test_displacement_drives_as_well(planted):
    force, displacement, start = planted
    driven = start.replace({"load.control": "displacement", "load.amplitude": 1e-5})
    fit = identify.fit(make_loop(force, displacement), driven, FREE)
    np.testing.assert_allclose(list(fit.values.values()), TRUTH, rtol=1e-4)


def test_several_loops_of_different_length_and_a_first_loading(planted):
    force, displacement, start = planted
    pull = jb.solve(jb.Scene().replace(MODEL), np.linspace(0.1, 1.2, 12))
    first = make_loop(pull.force, pull.displacement, "pull")
    loop = make_loop(force, displacement, "loop")
    assert loop.closed
    assert not first.closed
    fit = identify.fit([loop, first], start, FREE)
    np.testing.assert_allclose(list(fit.values.values()), TRUTH, rtol=1e-5)
    assert set(fit.figures()["misfits"]) == {"loop", "pull"}


@pytest.mark.parametrize("key", ["strip.poisson_ratio", "contact.friction"])
def test_search_space_is_unbounded_and_comes_back(key):
    for value in (0.01, 0.3, 0.45):
        assert float(identify._bound(key, identify._unbound(key, value))) == pytest.approx(value)
    assert float(identify._bound("strip.poisson_ratio", jnp.asarray(-20.0))) > -1.0
    assert float(identify._bound("strip.poisson_ratio", jnp.asarray(20.0))) < 0.5


def test_finite_element_loops_are_recovered_with_small_bias():
    """True values mu = 0.1, eta = 0.1126; what remains is the model's error, not noise."""
    scene = jb.Scene().replace(
        MODEL | {"model.nodes": 81, "contact.friction": 0.15, "strip.height_ratio": 0.2}
    )
    fit = identify.fit(example_loops(), scene, FREE)
    assert fit.values["contact.friction"] == pytest.approx(0.1, rel=0.01)
    assert fit.values["strip.height_ratio"] == pytest.approx(0.1126, rel=0.03)
    assert fit.misfit < 0.01


@pytest.mark.parametrize(
    ("free", "message"),
    [
        ((), "name at least one"),
        (("contact.fricton",), "did you mean 'contact.friction'"),
        (("model.nodes",), "not a parameter"),
        (("load.amplitude",), "not a parameter"),
        (("contact.smoothing",), "'sharp'"),
        (("contact.friction", "contact.friction"), "twice"),
    ],
)
def test_keys_that_cannot_be_fitted(free, message, planted):
    force, displacement, start = planted
    with pytest.raises(jb.InputError, match=message):
        identify.fit(make_loop(force, displacement), start, free)


def test_a_parameter_without_influence_is_named_before_the_fit(planted):
    force, displacement, start = planted
    scene = start.replace({"model.fields": ["v", "beta"]})
    with pytest.raises(jb.InputError, match=r"'strip.kappa_s'.*do not depend"):
        identify.fit(make_loop(force, displacement), scene, ("strip.kappa_s",))


def test_an_unfinished_fit_is_loud(planted):
    force, displacement, start = planted
    with pytest.raises(jb.UnconvergedError, match="not settled after 2 iterations"):
        identify.fit(make_loop(force, displacement), start, FREE, max_iterations=2)

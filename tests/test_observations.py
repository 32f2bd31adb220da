"""Squeeze curves: what is refused, and kappa_s from them."""

import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell import identify, scenes
from jbeamshell.elasticity import squeeze_decay_length, squeeze_step
from jbeamshell.example import data_folder
from jbeamshell.observations import HOPELESS, Experiment, Observation, SqueezeCurve, observe

X = np.linspace(45.0, 55.0, 11)
STRESS = np.linspace(-100.0, 0.0, 11)
FAST = {"model.kinematics": "linear"}  # the strains are 5e-4


@pytest.fixture(scope="module")
def measured():
    """Mean sigma_y by finite elements about the edge of the pressure."""
    path = data_folder() / "squeeze" / "b2.csv"
    table = np.genfromtxt(path, delimiter=",", names=True)
    return SqueezeCurve(table["x_mm"], table["sy_avg"]).between(45.0, 55.0)


@pytest.fixture(scope="module")
def fitted(measured):
    return identify.fit_kappa_s(measured, scenes.squeezed().replace(FAST | {"strip.kappa_s": 1.0}))


def test_kappa_s_of_the_finite_elements(measured, fitted):
    assert measured.x.size == 310
    assert fitted.values["strip.kappa_s"] == pytest.approx(0.441, abs=0.005)
    assert 0.6 < fitted.misfit * np.ptp(measured.stress) < 0.8  # MPa
    assert fitted.status == "converged"
    assert fitted.model[0].label == "squeeze"
    assert float(fitted.scene.strip.kappa_s) == fitted.values["strip.kappa_s"]


def test_printed_constants_hide_a_factor_of_24(measured, fitted):
    printed = FAST | {"model.constants": "printed", "strip.kappa_s": 0.05}
    fit = identify.fit_kappa_s(measured, scenes.squeezed().replace(printed))
    assert fit.values["strip.kappa_s"] == pytest.approx(0.0184, abs=0.0005)
    assert fit.misfit == pytest.approx(fitted.misfit, rel=1e-6)
    consistent = fitted.values["strip.kappa_s"]
    assert 24.0 * fit.values["strip.kappa_s"] == pytest.approx(consistent, rel=1e-4)


def test_a_planted_kappa_s_comes_back(fitted):
    fit = identify.fit_kappa_s(
        fitted.model[0], scenes.squeezed().replace(FAST | {"strip.kappa_s": 0.2})
    )
    assert fit.values["strip.kappa_s"] == pytest.approx(fitted.values["strip.kappa_s"], rel=1e-6)
    assert fit.misfit < 1e-7


def test_the_closed_form_gives_its_kappa_s_back(measured):
    """An answer that owes nothing to the model's grid or solver."""
    decay = squeeze_decay_length(1.0, 0.44, 0.3)
    closed = SqueezeCurve(measured.x, -100.0 * squeeze_step(measured.x - 50.0, decay))
    fit = identify.fit_kappa_s(closed, scenes.squeezed().replace(FAST))
    assert fit.values["strip.kappa_s"] == pytest.approx(0.44, rel=0.005)
    assert fit.misfit < 1e-3


def test_noise_is_covered_by_the_standard_error(fitted):
    clean, truth = fitted.model[0], fitted.values["strip.kappa_s"]
    even = np.gradient(clean.x) / np.mean(np.gradient(clean.x))
    scores = []
    for seed in range(8):
        noise = np.random.default_rng(seed).standard_normal(clean.x.size) / np.sqrt(even)
        curve = SqueezeCurve(clean.x, clean.stress + noise)  # 1 MPa per mean length
        fit = identify.fit_kappa_s(curve, scenes.squeezed().replace(FAST | {"strip.kappa_s": 0.8}))
        scores.append((fit.values["strip.kappa_s"] - truth) / fit.errors["strip.kappa_s"])
    assert np.max(np.abs(scores)) < 3.0
    assert np.abs(np.mean(scores)) < 3.0 / np.sqrt(8)


def test_the_misfit_has_a_gradient_of_taylor_slope_two(measured):
    scene, free = scenes.squeezed().replace(FAST | {"strip.kappa_s": 1.0}), ("strip.kappa_s",)
    experiment = Experiment([observe(measured, scene)])

    def misfit(p):
        residual, jacobian, _, sound = identify._linearised(
            jnp.asarray([p]), scene, free, experiment, jb.Newton()
        )
        assert bool(sound)
        return float(residual @ residual), float(2.0 * residual @ jacobian[:, 0])

    value, gradient = misfit(0.3)
    sizes = np.array([4e-3, 2e-3, 1e-3, 5e-4])
    rest = [abs(misfit(0.3 + h)[0] - value - h * gradient) for h in sizes]
    slope = np.polyfit(np.log(sizes), np.log(rest), 1)[0]
    assert slope == pytest.approx(2.0, abs=0.02)


def test_a_point_counts_with_the_length_it_stands_for():
    x = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 4.5, 5.0, 5.5, 6.0])
    square = np.asarray(observe(SqueezeCurve(x, x - 10.0), scenes.squeezed()).weight) ** 2
    assert np.mean(square) == pytest.approx(1.0 / 6.0**2)
    np.testing.assert_allclose(square[[0, 2, 5, 8]] / square[0], [1.0, 1.0, 0.5, 0.5])


# --- what is refused ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("x", "stress", "message"),
    [
        (X[:5], STRESS[:5], r"squeeze: x has shape \(5,\): give 8 points or more"),
        (X, STRESS[:-1], "11 and 10 points"),
        (X[:, None], STRESS, "x has shape"),
        (np.where(X == 50.0, np.nan, X), STRESS, "x is nan at point 6"),
        (X, np.where(X == 50.0, np.inf, STRESS), "stress is inf at point 6"),
        (X[::-1], STRESS, "x goes from 55 to 54 at point 2: it must increase"),
        (np.minimum(X, 54.0), STRESS, "x goes from 54 to 54 at point 11"),
        (X, np.full(11, -100.0), r"stress is constant \(-100\)"),
        (X, -STRESS, "compression is negative"),
    ],
)
def test_curves_that_are_refused(x, stress, message):
    with pytest.raises(jb.InputError, match=message):
        SqueezeCurve(x, stress)


def test_curves_that_a_scene_cannot_answer():
    scene = scenes.squeezed()
    with pytest.raises(jb.InputError, match=r"far end: x = 105 lies off the strip.*0 to 100"):
        identify.fit_kappa_s(SqueezeCurve(X + 60.0, STRESS, "far end"), scene)
    with pytest.raises(jb.InputError, match=r"know no squeeze stress: add psi"):
        observe(SqueezeCurve(X, STRESS), scene.replace({"model.fields": ["v", "w", "beta"]}))
    observe(SqueezeCurve(X + 45.00001, STRESS), scene)  # rounded by the table it came from


def test_what_is_no_measurement():
    with pytest.raises(jb.InputError, match="a ndarray is no measurement: give a Loop, a Squeeze"):
        identify.fit(X, jb.Scene(), ("contact.friction",))
    with pytest.raises(jb.InputError, match="no measurement given"):
        identify.fit([], jb.Scene(), ("contact.friction",))


# --- several ----------------------------------------------------------------------------------


class Doubled(Observation):
    """A model that answers with twice the measurement."""

    @staticmethod
    def column(scene):
        return "stress"

    def predict(self, scene, solver):
        return 2.0 * self.measured, jnp.all(self.measured < 90.0)


class Tripled(Doubled):
    def predict(self, scene, solver):
        return 3.0 * self.measured, jnp.asarray(True)


def make(kind, *measured):
    return kind(jnp.asarray(measured), jnp.full(len(measured), 0.5))


def test_observations_run_kind_by_kind_and_come_back_in_order():
    several = [make(Doubled, 1.0), make(Tripled, 2.0, 3.0, 4.0), make(Doubled, 5.0, 6.0)]
    rows, predictions, sound = Experiment(several).residual(jb.Scene(), jb.Newton())
    np.testing.assert_array_equal(rows, [[0.5, 0.0, 0.0], [2.0, 3.0, 4.0], [2.5, 3.0, 0.0]])
    np.testing.assert_array_equal(predictions[1], [6.0, 9.0, 12.0])
    np.testing.assert_array_equal(predictions[2, :2], [10.0, 12.0])
    assert bool(sound)


def test_a_trial_without_equilibrium_is_hopeless_where_it_is_compared():
    rows, _, sound = Experiment([make(Doubled, 91.0), make(Doubled, 1.0, 2.0)]).residual(
        jb.Scene(), jb.Newton()
    )
    np.testing.assert_array_equal(rows, [[HOPELESS, 0.0], [0.5, 1.0]])
    assert not bool(sound)

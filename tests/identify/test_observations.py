"""Curves and how the model answers them: what is refused, and kappa_s from squeeze curves."""

import jax.numpy as jnp
import numpy as np
import pytest
import toy
from toy import STRIP

import jbeamshell as jb
from jbeamshell import identify
from jbeamshell.identify.models import as_model
from jbeamshell.identify.observations import UNSOLVED_RESIDUAL, observe
from jbeamshell.measured.curves import (
    Backbone,
    DissipationCurve,
    SqueezeCurve,
    StiffnessCurve,
)
from jbeamshell.measured.example import data_folder
from jbeamshell.measured.loops import Loop, make_loop
from jbeamshell.reference import squeeze_decay_length, squeeze_step
from jbeamshell.scene import library

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
    return identify.fit(measured, library.squeezed().replace(FAST | {"strip.kappa_s": 1.0}))


def test_kappa_s_of_the_finite_elements(measured, fitted):
    assert measured.x.size == 310
    assert fitted.values["strip.kappa_s"] == pytest.approx(0.441, abs=0.005)
    assert 0.6 < fitted.misfit * np.ptp(measured.stress) < 0.8  # MPa
    assert fitted.converged
    assert fitted.model[0].label == "squeeze"
    assert float(fitted.scene.strip.kappa_s) == fitted.values["strip.kappa_s"]


@pytest.mark.slow
def test_printed_constants_hide_a_factor_of_24(measured, fitted):
    printed = FAST | {"model.constants": "printed", "strip.kappa_s": 0.05}
    fit = identify.fit(measured, library.squeezed().replace(printed))
    assert fit.values["strip.kappa_s"] == pytest.approx(0.0184, abs=0.0005)
    assert fit.misfit == pytest.approx(fitted.misfit, rel=1e-6)
    consistent = fitted.values["strip.kappa_s"]
    assert 24.0 * fit.values["strip.kappa_s"] == pytest.approx(consistent, rel=1e-4)


def test_a_planted_kappa_s_comes_back(fitted):
    fit = identify.fit(fitted.model[0], library.squeezed().replace(FAST | {"strip.kappa_s": 0.2}))
    assert fit.values["strip.kappa_s"] == pytest.approx(fitted.values["strip.kappa_s"], rel=1e-6)
    assert fit.misfit < 1e-7


def test_the_closed_form_gives_its_kappa_s_back(measured):
    """An answer that owes nothing to the model's grid or solver."""
    decay = squeeze_decay_length(1.0, 0.44, 0.3)
    closed = SqueezeCurve(measured.x, -100.0 * squeeze_step(measured.x - 50.0, decay))
    fit = identify.fit(closed, library.squeezed().replace(FAST))
    assert fit.values["strip.kappa_s"] == pytest.approx(0.44, rel=0.005)
    assert fit.misfit < 1e-3


def test_noise_is_covered_by_the_standard_error(fitted):
    clean, truth = fitted.model[0], fitted.values["strip.kappa_s"]
    even = np.gradient(clean.x) / np.mean(np.gradient(clean.x))
    scores = []
    for seed in range(8):
        noise = np.random.default_rng(seed).standard_normal(clean.x.size) / np.sqrt(even)
        curve = SqueezeCurve(clean.x, clean.stress + noise)  # 1 MPa per mean length
        fit = identify.fit(curve, library.squeezed().replace(FAST | {"strip.kappa_s": 0.8}))
        scores.append((fit.values["strip.kappa_s"] - truth) / fit.errors["strip.kappa_s"])
    assert np.max(np.abs(scores)) < 3.0
    assert np.abs(np.mean(scores)) < 3.0 / np.sqrt(8)


def test_a_point_counts_with_the_length_it_stands_for():
    x = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 4.5, 5.0, 5.5, 6.0])
    square = np.asarray(observe(SqueezeCurve(x, x - 10.0), library.squeezed()).weight) ** 2
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
    scene = library.squeezed()
    with pytest.raises(jb.InputError, match=r"far end: x = 105 lies off the strip.*0 to 100"):
        identify.fit(SqueezeCurve(X + 60.0, STRESS, label="far end"), scene)
    with pytest.raises(jb.InputError, match=r"section = shell has no squeeze stress: take squee"):
        observe(SqueezeCurve(X, STRESS), scene.replace({"model.section": "shell"}))
    observe(SqueezeCurve(X + 45.00001, STRESS), scene)  # rounded by the table it came from


def test_what_is_no_measurement():
    with pytest.raises(jb.InputError, match="a ndarray is no measurement: give a Loop, a Squeeze"):
        identify.fit(X, STRIP, ("contact.friction",))
    with pytest.raises(jb.InputError, match="no measurement given"):
        identify.fit([], STRIP, ("contact.friction",))


@pytest.mark.parametrize(
    ("kind", "columns", "message"),
    [
        (Backbone, ([0.0, 1.0], [0.0, 1.0]), r"force has shape \(2,\): give 3 points or more"),
        (Backbone, ([1.0, 2.0, 3.0], [1.0, 1.0, 1.0]), r"displacement is constant \(1\): no load"),
        (DissipationCurve, ([], []), r"amplitude has shape \(0,\): give 1 point or more"),
        (DissipationCurve, ([1.0, 2.0], [1.0, 0.0]), "dissipation is 0 at point 2: it must be"),
        (StiffnessCurve, ([1.0, -2.0], [1.0, 1.0]), "amplitude is -2 at point 2: it must be"),
        (StiffnessCurve, ([1.0], [np.nan]), "stiffness is nan at point 1"),
        (StiffnessCurve, ([1.0, 2.0], [1.0]), "amplitude and stiffness have 2 and 1 points"),
    ],
)
def test_further_curves_that_are_refused(kind, columns, message):
    with pytest.raises(jb.InputError, match=message):
        kind(*columns)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"noise": 0.0}, "squeeze: noise is 0 at point 1: give a positive"),
        ({"noise": [1.0, 2.0]}, r"noise has shape \(2,\): give one number, or one for each"),
        ({"noise": np.where(X == 50.0, np.inf, 1.0)}, "noise is inf at point 6"),
        ({"weight": 0.0}, "weight = 0.0: must be a positive number"),
        ({"weight": np.nan}, "weight = nan"),
    ],
)
def test_noise_and_weights_that_are_refused(options, message):
    with pytest.raises(jb.InputError, match=message):
        SqueezeCurve(X, STRESS, **options)


def test_noise_goes_with_the_part_of_a_curve():
    noise = np.linspace(1.0, 2.0, 11)
    part = SqueezeCurve(X, STRESS, noise=noise, weight=2.0).between(46.5, 54.5)
    np.testing.assert_array_equal(part.noise, noise[2:10])
    assert part.weight == 2.0
    np.testing.assert_allclose(observe(part, library.squeezed()).weight, 1.0 / noise[2:10])


def test_noise_of_a_mean_loop_is_that_of_the_mean():
    column = np.linspace(0.0, 1.0, 9)
    assert Loop(column, column, label="one").deviations is None
    np.testing.assert_allclose(Loop(column, column, label="9", noise=0.3, cycles=9).deviations, 0.1)
    scatter = np.full(9, 0.6)
    np.testing.assert_allclose(
        Loop(column, column, label="4", noise=0.3, cycles=4, scatter=scatter).deviations, 0.3
    )


def test_noise_belongs_to_the_column_that_answered():
    column = np.linspace(0.0, 1.0, 9)
    loop = Loop(column, column, label="mean", noise=0.3, driver="displacement")
    with pytest.raises(jb.InputError, match=r"set load\.control to 'displacement'"):
        observe(loop, STRIP)


@pytest.mark.slow
def test_a_free_zero_is_put_where_it_fits():
    scene = STRIP.replace(
        FAST | {"model.nodes": 21, "load.steps_per_half_cycle": 8, "load.amplitude": 1.0}
    )
    loop = make_loop(*map(np.asarray, jb.solve(scene).loop))
    shifted = loop.but(displacement=loop.displacement + 1e-5)
    misfits = []
    for free_zero in (False, True):
        one = observe(shifted.but(free_zero=free_zero), scene)
        rows, answer, _ = one.residual(as_model(scene), jb.Newton())
        misfits.append(float(jnp.max(jnp.abs(rows))))
        compared = np.asarray(one.weight) > 0.0
        off = np.mean(np.asarray(answer)[compared] - shifted.displacement)
        assert off == pytest.approx(0.0 if free_zero else -1e-5, abs=1e-10)
    assert misfits[0] > 0.1
    assert misfits[1] < 1e-6


def test_a_backbone_only_goes_on():
    up = Backbone([0.1, 0.3, 0.2], [1.0, 2.0, 3.0])
    with pytest.raises(
        jb.InputError, match=r"force = 0.2 turns back at point 3, but .*; give a Loop"
    ):
        observe(up, STRIP)
    down = observe(Backbone([-0.1, -0.2, -0.3], [-1.0, -2.0, -3.0]), STRIP)
    assert np.all(np.diff(down.path) <= 0.0)
    with pytest.raises(jb.InputError, match="must stay below gross slip"):
        observe(DissipationCurve([0.5, 5.0], [1.0, 1.0]), STRIP)


def test_a_trial_without_equilibrium_is_hopeless_where_it_is_compared():
    far = as_model(toy.scene(**{"contact.friction": 60.0}))
    formula = observe(toy.readings(), far)
    rows, _, sound = formula.residual(
        as_model(toy.scene(**{"contact.friction": 60.0})), jb.Newton()
    )
    np.testing.assert_array_equal(rows, UNSOLVED_RESIDUAL)
    assert not bool(sound)
    noisy = observe(toy.readings(1e-3, known=True), toy.scene())
    rows, _, _ = noisy.residual(far, jb.Newton())
    np.testing.assert_allclose(rows, UNSOLVED_RESIDUAL * np.ptp(noisy.measured) / 1e-3)

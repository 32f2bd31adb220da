"""Residuals of a wrong model: independent points, intervals that include it, plain words."""

import numpy as np
import pytest
from toy import KEYS, TRUTH, Readings, formula, scene

from jbeamshell import identify
from jbeamshell.identify.starts import estimate
from jbeamshell.identify.uncertainty import independent_points, model_misfit
from jbeamshell.measured.loops import make_loop
from tests import rig

MU, ETA, KAPPA = KEYS
FINE = np.linspace(0.05, 1.0, 200)
TWO = scene(**{KAPPA: TRUTH[KAPPA]})


def slow_noise(points, memory, random):
    """Autoregressive noise of unit size, (points,), with autocorrelation memory^lag."""
    made = random.standard_normal(points)
    for i in range(1, points):
        made[i] = memory * made[i - 1] + np.sqrt(1.0 - memory**2) * made[i]
    return made


@pytest.mark.parametrize("points", [6, 20, 100])
def test_white_noise_is_hardly_ever_taken_for_anything_else(points):
    random = np.random.default_rng(points)
    alarms = [independent_points([random.standard_normal(points)]) < points for _ in range(500)]
    assert np.mean(alarms) < 0.12


@pytest.mark.parametrize("memory", [0.5, 0.8, 0.9])
def test_correlated_noise_is_worth_what_its_mean_varies_or_less(memory):
    random = np.random.default_rng(1)
    found = [independent_points([slow_noise(100, memory, random)]) for _ in range(40)]
    expected = 100.0 * (1.0 - memory) / (1.0 + memory)
    # Far lags, where a loop's other branch would show, are counted by their size.
    assert 0.25 * expected < np.median(found) < 1.05 * expected


def test_a_branch_that_repeats_another_says_nothing_new():
    random = np.random.default_rng(2)
    branch = slow_noise(100, 0.9, random)
    for sign in (1.0, -1.0):
        both = np.append(branch, sign * branch)
        assert independent_points([both]) < 1.2 * independent_points([branch])
    other = slow_noise(100, 0.9, random)
    assert independent_points([branch, other]) == pytest.approx(
        independent_points([branch]) + independent_points([other]), rel=0.6
    )


def test_nothing_left_is_no_division_by_zero():
    assert independent_points([np.zeros(5), np.zeros(3)]) == 8.0
    assert independent_points([np.array([0.3])]) == 1.0
    assert model_misfit(np.array([0.3])) == pytest.approx(0.3)


def test_what_is_no_white_noise_is_told_apart():
    random, x = np.random.default_rng(3), np.linspace(0.0, 1.0, 400)
    wave = 0.03 * np.sqrt(2.0) * np.sin(8.0 * np.pi * x)
    assert model_misfit(wave + 0.05 * random.standard_normal(x.size)) == pytest.approx(0.03, 0.25)
    assert model_misfit(0.05 * random.standard_normal(x.size)) < 0.02
    assert model_misfit(wave) == pytest.approx(0.03, rel=0.01)


def slow_readings(seed, known=False):
    """Readings with slow noise, whose size is known or not."""
    y = np.asarray(formula(FINE, *TRUTH.values()))
    noisy = y + 2e-3 * slow_noise(FINE.size, 0.9, np.random.default_rng(seed))
    return Readings(FINE, noisy, noise=2e-3 if known else None)


@pytest.mark.parametrize("known", [False, True])
def test_intervals_cover_the_truth_under_slow_noise(known):
    fits = [identify.fit(slow_readings(seed, known), TWO, [MU, ETA]) for seed in range(25)]
    inside = [[low < TRUTH[key] < high for key, (low, high) in f.intervals.items()] for f in fits]
    assert np.mean(inside) > 0.85  # of 50; taken for white noise, fewer than 70 % are
    white = [abs(f.values[MU] - TRUTH[MU]) * f.uncertainty.sigma / f.errors[MU] for f in fits]
    size = [f.uncertainty.scatter for f in fits]
    assert np.mean(np.array(white) > 1.96 * np.array(size)) > 0.3


def test_profiles_include_what_the_model_leaves():
    bent = np.asarray(formula(FINE, *TRUTH.values())) + 1e-3 * np.sin(30.0 * FINE)
    fit = identify.fit(Readings(FINE, bent, noise=1e-4), TWO, [MU, ETA])
    assert fit.uncertainty.scatter > 5.0
    assert fit.uncertainty.sigma > 2.0 * fit.uncertainty.scatter
    text = " ".join(fit.doubts)
    assert "times the measured noise unexplained" in text
    assert "the errors count 200 points as " in text
    low, high = fit.profile(MU).interval
    np.testing.assert_allclose((low, high), fit.intervals[MU], rtol=0.02)
    assert low < TRUTH[MU] < high


def test_a_model_of_other_data_says_so():
    y = np.asarray(formula(FINE, *TRUTH.values()))
    wrong = y + 0.12 * np.ptp(y) * np.sin(12.0 * FINE)
    fit = identify.fit(Readings(FINE, wrong), TWO, [MU, ETA])
    assert not fit.describes
    assert fit.doubts[0].startswith("this model does not describe these data: it leaves ")
    assert fit.figures()["describes"] is False
    # Noise alone is no fault of the model, however large.
    loud = y + 0.13 * np.ptp(y) * np.random.default_rng(4).standard_normal(FINE.size)
    fit = identify.fit(Readings(FINE, loud), TWO, [MU, ETA])
    assert fit.misfit > 0.09
    assert fit.describes


def another_law(seed):
    """A noisy loop beyond gross slip of a random joint of another law, with a plateau of 1."""
    random = np.random.default_rng(seed)
    u = rig.path(cycles=1, points=160)
    if seed % 3 == 0:  # many sliders
        spread = np.linspace(0.0, 1.0, 24) ** random.uniform(0.7, 2.5)
        reach = random.uniform(0.05, 0.2) + random.uniform(0.3, 0.7) * spread
        stiffness = random.dirichlet(np.full(24, 2.0))
        force = rig.stops(u, reach, stiffness) / (reach @ stiffness)
    elif seed % 3 == 1:
        force = rig.bouc_wen(u, random.uniform(1.0, 3.0), random.uniform(0.1, 0.4), 0.0)
    else:
        reach = random.uniform(0.1, 0.5)
        force = rig.jenkins(u, reach) / reach
    noise = 2.0 * random.choice([0.002, 0.005, 0.01, 0.02])
    force = force[-161:] + noise * random.standard_normal(161)
    return make_loop(force, u[-161:]).but(driver="displacement")


@pytest.mark.slow
def test_friction_of_another_law_lies_inside_its_interval():
    """Fifty random Iwan, Bouc-Wen and Jenkins joints with .2 to 2 % noise, fitted by the strip."""
    known = {
        "contact.pressure": 2.0,
        "strip.length": 1.0,
        "strip.far_end": "free",
        "strip.height_ratio": 0.1,
        "strip.axial_stiffness": 20.0,
        "model.nodes": 21,
        "model.kinematics": "linear",
        "contact.normal": "held",
    }
    free = [MU, "contact.stick_stiffness", "strip.axial_stiffness"]
    inside = []
    for seed in range(100, 150):
        loop = another_law(seed)
        start = {} if estimate([loop]).soft else {"contact.stick_stiffness": 1000.0}
        fit = identify.fit(loop, known | start, free, points=64, throw=False)
        low, high = fit.intervals[MU]
        inside.append(low < 0.5 < high)
    assert 0.9 <= np.mean(inside) <= 0.99

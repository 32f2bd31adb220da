"""Errors, intervals, words and bands, against closed forms and repeated noise."""

import numpy as np
import pytest
from toy import KEYS, TRUTH, Readings, X, formula, readings, scene

import jbeamshell as jb
from jbeamshell import identify
from jbeamshell.identify.parameters import Parameter

MU, ETA, KAPPA = KEYS
NOISE = 2e-3
LINEAR = Parameter(KAPPA, scale="linear")
FIXED = {MU: TRUTH[MU], ETA: TRUTH[ETA]}
TWO = scene(**{KAPPA: TRUTH[KAPPA]})  # where only mu and eta are to be found
SLOPE = 0.2 * X  # of the formula along kappa_s


@pytest.fixture(scope="module")
def repeats():
    """Fits of the same readings with fresh noise, 80 times."""
    return [identify.fit(readings(NOISE, seed, known=True), TWO, KEYS[:2]) for seed in range(80)]


@pytest.fixture(scope="module")
def quiet():
    """A fit whose noise is so small that everything is linear."""
    return identify.fit(readings(1e-6, known=True), scene(), KEYS)


def values_of(fit):
    return np.array(list(fit.values.values()))


def test_the_covariance_is_that_of_repeats(repeats):
    values = np.array([values_of(fit) for fit in repeats])
    errors = np.array(list(repeats[0].errors.values()))
    np.testing.assert_allclose(values.std(axis=0, ddof=1) / errors, 1.0, atol=0.25)
    correlation = np.corrcoef(values.T)[0, 1]
    assert correlation == pytest.approx(repeats[0].correlation[0, 1], abs=0.15)
    assert abs(correlation) > 0.3  # else the last line says nothing


def test_intervals_cover_what_they_say(repeats):
    truth = np.array([TRUTH[key] for key in KEYS[:2]])
    for level, low, high in ((0.95, 0.89, 0.99), (0.68, 0.58, 0.78)):
        ends = np.array([list(fit.intervals_at(level).values()) for fit in repeats])
        covered = np.mean((ends[..., 0] < truth) & (truth < ends[..., 1]))
        assert low < covered < high


def test_noise_that_is_not_measured_is_estimated():
    rough = [identify.fit(readings(NOISE, seed), TWO, KEYS[:2]) for seed in range(30)]
    of_the_range = NOISE / np.ptp(readings().y)
    estimates = np.array([fit.uncertainty.noise for fit in rough])
    assert np.sqrt(np.mean(estimates**2)) == pytest.approx(of_the_range, rel=0.15)
    assert rough[0].figures()["noise"]["measured"] is False
    # Student's intervals of few points are wider than normal ones.
    assert rough[0].uncertainty.quantile(0.95) > 2.05


def test_one_linear_parameter_in_closed_form():
    data = readings(NOISE, known=True)
    fit = identify.fit(data, scene(**FIXED), LINEAR)
    rest = data.y - np.asarray(formula(X, *FIXED.values(), 0.0))
    expected, error = SLOPE @ rest / (SLOPE @ SLOPE), NOISE / np.sqrt(SLOPE @ SLOPE)
    assert fit.values[KAPPA] == pytest.approx(expected, rel=1e-6)
    assert fit.errors[KAPPA] == pytest.approx(error, rel=1e-6)
    low, high = fit.bands(0.95)[0]
    np.testing.assert_allclose((high.y - low.y) / 2.0, 1.959964 * SLOPE * error, rtol=1e-5)
    low, high = fit.bands(0.95, noise=True)[0]
    both = 1.959964 * np.hypot(SLOPE * error, NOISE)
    np.testing.assert_allclose((high.y - low.y) / 2.0, both, rtol=1e-5)


@pytest.mark.parametrize("deviation", [1e-5, 0.01, 10.0])
def test_a_prior_in_closed_form(deviation):
    data, mean = readings(NOISE, known=True), 0.445  # a prior against the data is a misfit
    fit = identify.fit(data, scene(**FIXED), Parameter(KAPPA, prior=(mean, deviation)))
    rest = data.y - np.asarray(formula(X, *FIXED.values(), 0.0))
    known, believed = SLOPE @ SLOPE / NOISE**2, 1.0 / deviation**2
    expected = (SLOPE @ rest / NOISE**2 + mean * believed) / (known + believed)
    assert fit.values[KAPPA] == pytest.approx(expected, rel=1e-5)
    assert fit.errors[KAPPA] == pytest.approx((known + believed) ** -0.5, rel=1e-4)


def test_weights_count_and_their_errors_are_honest():
    """Two rows of readings, one worth three times as much to the user, not to the noise."""
    pair = [readings(NOISE, seed, known=True, label=f"run {seed}") for seed in (1, 2)]
    fit = identify.fit(pair, scene(**FIXED), LINEAR, weights=(3.0, 1.0))
    rests = [data.y - np.asarray(formula(X, *FIXED.values(), 0.0)) for data in pair]
    single = [SLOPE @ rest / (SLOPE @ SLOPE) for rest in rests]
    assert fit.values[KAPPA] == pytest.approx((9.0 * single[0] + single[1]) / 10.0, rel=1e-6)
    error = NOISE / np.sqrt(SLOPE @ SLOPE) * np.hypot(0.9, 0.1)
    assert fit.errors[KAPPA] == pytest.approx(error, rel=1e-6)
    own = [
        readings(NOISE, s, known=True, label=f"run {s}", weight=w) for s, w in ((1, 3.0), (2, 1))
    ]
    again = identify.fit(own, scene(**FIXED), LINEAR)
    assert again.values[KAPPA] == pytest.approx(fit.values[KAPPA], rel=1e-9)


def test_directions_are_those_of_the_information(quiet):
    eigenvalues, vectors = map(np.array, zip(*quiet.uncertainty.directions(), strict=True))
    assert np.all(np.diff(eigenvalues) >= 0.0)
    information = vectors.T @ np.diag(eigenvalues) @ vectors
    residual = quiet.problem(quiet.uncertainty.point)
    expected = residual.jacobian.T @ residual.jacobian
    np.testing.assert_allclose(information, expected, rtol=1e-6, atol=1e-8 * expected.max())


def test_profiles_of_little_noise_are_parabolas(quiet):
    for key in KEYS:
        profile = quiet.profile(key)
        np.testing.assert_allclose(
            np.array(profile.interval) - quiet.values[key],
            np.array(quiet.intervals[key]) - quiet.values[key],
            rtol=0.03,
        )
        quadratic = ((profile.values - quiet.values[key]) / quiet.errors[key]) ** 2
        np.testing.assert_allclose(profile.rises, quadratic, rtol=0.01, atol=0.01)
        assert np.all(np.diff(profile.values) > 0.0)


def test_a_profile_ends_where_the_others_can_no_longer_follow():
    """Parameters under much noise, whose distribution is skewed like the model."""
    fit = identify.fit(readings(0.01, 3, known=True), TWO, KEYS[:2])
    profile = fit.profile(ETA)
    least = fit.problem(fit.uncertainty.point).cost
    for end in profile.interval:
        other = scene(**{KAPPA: 0.44, ETA: end})
        best = identify.fit(readings(0.01, 3, known=True), other, MU)
        cost = best.problem(best.uncertainty.point).cost
        assert cost - least == pytest.approx(1.959964**2, rel=0.06)


def test_profiles_of_what_was_not_fitted(quiet):
    with pytest.raises(jb.InputError, match=r"'strip.length': was not fitted; names are contact"):
        quiet.profile("strip.length")
    with pytest.raises(jb.InputError, match="level = 95: give a number between"):
        quiet.profile(MU, level=95)


def test_what_the_data_leave_open_is_said_in_words():
    clear = identify.fit(readings(NOISE, known=True), scene(), KEYS)
    assert not clear.doubts
    # Short of the knee only mu / eta + 0.2 kappa_s shows.
    short = Readings(X, formula(X, 0.5, 5.0, 0.44), noise=1e-3)
    begin = scene(**{MU: 0.5, ETA: 5.0})
    near = identify.fit(short, begin, KEYS)
    text = " ".join(near.doubts)
    assert "strip.kappa_s is not identifiable from these data: " in text
    assert "% noise leaves it anywhere between" in text
    assert "trade off" in text
    # Exact data hide it until one asks what noise would do.
    exact = identify.fit(Readings(X, short.y), begin, KEYS, max_iterations=100)
    assert not exact.doubts
    (sentence, *_) = exact.uncertainty.at_noise(0.01).limitations()
    assert "is not identifiable from these data: 1 % noise leaves it anywhere" in sentence
    with pytest.raises(jb.InputError, match="noise = 0: give a positive part"):
        exact.uncertainty.at_noise(0)


def test_a_model_that_is_wrong_is_named():
    data = readings(known=True, noise=1e-5)
    bent = type(data)(X, np.asarray(data.y) + 0.01 * np.sin(9.0 * X), noise=1e-5)
    fit = identify.fit(bent, scene(), KEYS)
    assert any("times the measured noise unexplained" in warning for warning in fit.doubts)


def test_a_value_at_its_bound_has_no_error():
    fit = identify.fit(
        readings(NOISE, known=True),
        TWO,
        [Parameter(MU, low=0.12, high=0.5), ETA],
        starts=1,
    )
    assert fit.values[MU] == pytest.approx(0.12, rel=1e-3)
    assert np.isnan(fit.errors[MU])
    assert np.isfinite(fit.errors[ETA])
    assert fit.figures()["values"][MU]["error"] is None
    assert any("ends at its bound 0.12" in warning for warning in fit.doubts)
    with pytest.raises(jb.InputError, match="ended at its bound"):
        fit.profile(MU)

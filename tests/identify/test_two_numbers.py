"""Fits of two numbers of a strip: the truth in their intervals, and starts that are refused."""

import itertools

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell import identify
from jbeamshell.common.errors import InputError
from jbeamshell.measured.loops import make_loop

MU, ETA, STIFF, P = (
    "contact.friction",
    "strip.height_ratio",
    "strip.axial_stiffness",
    "contact.pressure",
)
PAIRS = list(itertools.combinations((MU, ETA, STIFF, P), 2))
NOISES = (0.0, 0.001, 0.003, 0.01, 0.02)
PARTS = (0.45, 0.85)  # of gross slip


def gross_slip(scene):
    return float(scene.contact.friction * scene.contact.pressure * scene.strip.length)


def measured(truth, noise=0.0, random=None):
    """Loops of a strip with noise of the displacement over its range."""
    found = []
    for part in PARTS:
        history = jb.solve(truth.replace({"load.amplitude": part * gross_slip(truth)}), throw=False)
        force, u = map(np.asarray, history.loop)
        if noise:
            u = u + noise * np.ptp(u) * random.standard_normal(u.size)
        found.append(make_loop(force, u, f"F = {part:g}"))
    return found


def planted(seed):
    """Loops of a random strip, a start within a factor of two, and the true values of a pair."""
    random, pair = np.random.default_rng(seed), PAIRS[seed % len(PAIRS)]
    height = float(np.exp(random.uniform(np.log(0.03), np.log(0.3))))
    truth = jb.Scene().replace({MU: random.uniform(0.1, 0.4), ETA: height})
    data = measured(truth, NOISES[seed // len(PAIRS) % len(NOISES)], random)
    values = {key: float(truth.get(key)) for key in pair}
    start = truth
    while start is truth or gross_slip(start) < 1.01 * PARTS[-1] * gross_slip(truth):
        start = truth.replace(
            {key: value * 2.0 ** random.uniform(-1.0, 1.0) for key, value in values.items()}
        )
    return data, start, values


def inside(seed):
    """True values of a pair that lie in their intervals."""
    data, start, values = planted(seed)
    fit = identify.fit(data, start, list(values), points=48, throw=False)
    return [low <= values[key] <= high for key, (low, high) in fit.intervals.items()]


@pytest.fixture(scope="module")
def thin():
    """A thin strip and its loops, which know little more than friction times stiffness."""
    truth = jb.Scene().replace({MU: 0.2, ETA: 0.02})
    return truth, measured(truth)


def test_two_numbers_of_a_thin_strip_are_a_product(thin):
    truth, data = thin
    fit = identify.fit(data, truth.replace({MU: 0.3}), [MU, STIFF], points=48)
    for key in (MU, STIFF):
        low, high = fit.intervals[key]
        assert low < float(truth.get(key)) < high
        assert high < 1.8 * low  # 1.68 on the fit's nodes, 1.44 on 129
    product = fit.values[MU] * fit.values[STIFF]
    assert product == pytest.approx(float(truth.get(MU) * truth.get(STIFF)), rel=1e-2)
    said = " ".join(fit.doubts)
    assert f"only the product of {MU} and {STIFF} is known well" in said


def test_truth_lies_in_the_intervals_of_a_few_planted_pairs():
    assert np.mean([inside(seed) for seed in (1, 19)]) >= 0.75


@pytest.mark.slow(minutes=15)
def test_truth_lies_in_the_intervals_of_planted_pairs():
    assert 0.9 <= np.mean([inside(seed) for seed in range(200)]) <= 0.99


@pytest.mark.parametrize(("key", "start"), [(MU, 0.05), (P, 2.0)])
def test_a_start_beyond_gross_slip_is_refused_with_one_that_works(thin, key, start):
    truth, data = thin
    told = rf"^free '{key}': starts at {start:g}, where the strip slides at .* start from "
    with pytest.raises(InputError, match=told) as caught:
        identify.fit(data, truth, [identify.Parameter(key, start=start), ETA], points=48)
    better = float(str(caught.value).split("start from ")[1])
    with pytest.raises(InputError, match=told[1:]):
        identify.fit_each([data], truth.replace({key: start}), [key])
    assert gross_slip(truth.replace({key: better})) > np.max(data[-1].force)

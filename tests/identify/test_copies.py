"""Copies of a measurement count once, and loops that only look alike stay."""

import numpy as np
import pytest
from identify.test_law_fits import NOISE, PLANTED, loops
from toy import KEYS, readings, scene

from jbeamshell import identify, laws
from jbeamshell.identify.data_checks import counted_once
from jbeamshell.identify.specimens import Specimen


@pytest.fixture(scope="module")
def noisy():
    """Two noisy loops of a law."""
    return loops(PLANTED["iwan4"], np.random.default_rng(3), sizes=(0.012, 0.03))


def kept(*data, weights=()):
    """Measurements that count, and what is said."""
    (case,), said = counted_once([Specimen(weights=weights).case(scene(), data)])
    return list(case.measurements), said


def test_the_same_data_twice_have_the_errors_of_once():
    data = readings(2e-3, 1)
    once, twice = (identify.fit(given, scene(), KEYS) for given in ([data], [data, data]))
    assert twice.errors == once.errors
    assert "toy is toy once more: it counts once" in twice.doubts
    assert "once more" not in " ".join(once.doubts)
    both = identify.fit([data, readings(2e-3, 2)], scene(), KEYS)
    assert "once more" not in " ".join(both.doubts)


def test_copies_with_fewer_points_or_in_other_units_count_once(noisy):
    one, other = noisy
    few = one.but(force=one.force[::3], displacement=one.displacement[::3], label="few")
    for data in ((few, one, other), (one, other, few)):
        whole, (told,) = kept(*data)
        assert [loop.label for loop in whole] == [one.label, other.label]
        assert told == f"few is {one.label} with fewer points: it counts once"
    kilo = one.but(force=1e-3 * one.force, label="kilo")
    whole, (told,) = kept(one, other, kilo)
    assert len(whole) == 2
    assert "with force times 0.001 and displacement times 1" in told
    larger = one.but(force=1.1 * one.force, displacement=1.1 * one.displacement, label="more")
    assert len(kept(one, larger)[0]) == 1


def test_weights_stay_with_their_measurements(noisy):
    one, other = noisy
    weighted = Specimen(weights=(3.0, 3.0, 2.0)).case(scene(), [one, one, other])
    (case,), _ = counted_once([weighted])
    assert case.weights.tolist() == [3.0, 2.0]


def test_a_cycle_that_is_repeated_point_by_point_counts_once(noisy):
    one = noisy[0]
    columns = (np.append(np.tile(c[:-1], 5), c[0]) for c in (one.force, one.displacement))
    long = one.but(**dict(zip(("force", "displacement"), columns, strict=True)))
    (single,), (told,) = kept(long)
    assert single.force.size == one.force.size
    assert "repeats one cycle 5 times, point by point: it counts once" in told
    noise = NOISE * np.random.default_rng(4).standard_normal(long.force.size)
    assert kept(long.but(force=long.force + noise))[1] == []


def test_loops_that_a_law_makes_alike_are_no_copies(noisy):
    """Below gross slip, the displacement of Goodman's bar goes with the force squared."""
    bar = laws.Bar(1.0, 0.2)
    pair = loops(bar, sizes=(0.012, 0.03))
    ratio = pair[1].force / pair[0].force
    assert np.ptp(ratio[1:-1]) < 1e-6 * ratio[0]
    assert kept(*pair) == (pair, [])
    assert kept(*noisy) == (noisy, [])


def test_copies_of_another_specimen_stay_and_are_told(noisy):
    one = noisy[0]
    pair = [Specimen(label=label).case(scene(), [one]) for label in ("a", "b")]
    cases, (told,) = counted_once(pair)
    assert [len(case.measurements) for case in cases] == [1, 1]
    assert "of b and" in told
    assert "errors of numbers that both share are too small" in told

"""Loops in memory: checked, closed or not, thinned; and the loops that ship."""

import numpy as np
import pytest

from jbeamshell.common.errors import InputError
from jbeamshell.measured.example import EXAMPLE_AMPLITUDES, HEIGHT_RATIOS, example_loops
from jbeamshell.measured.loops import Loop, driver_of, make_loop

PHASE = np.linspace(0.0, 2.0 * np.pi, 13)
FORCE, DISPLACEMENT = 3.0 * np.cos(PHASE), 0.25 * np.cos(PHASE - 0.3)


@pytest.mark.parametrize("ratio", HEIGHT_RATIOS)
def test_the_finite_element_loops_that_ship(ratio):
    loops = example_loops(ratio)
    assert [loop.label for loop in loops] == [f"A = {a:g}" for a in EXAMPLE_AMPLITUDES]
    for loop, amplitude in zip(loops, EXAMPLE_AMPLITUDES, strict=True):
        assert loop.closed
        np.testing.assert_allclose(np.max(np.abs(loop.force)), amplitude, rtol=1e-6)
    assert len(example_loops(ratio, None)) > len(loops)


def test_example_loops_that_do_not_exist():
    with pytest.raises(InputError, match=r"height_ratio = 0\.2: choose one of \(0\.0305"):
        example_loops(0.2)
    with pytest.raises(InputError, match=r"amplitudes: there is no A = 0\.33; there are A = 0\.1,"):
        example_loops(amplitudes=(1.0, 0.33))


def test_a_standard_error_is_that_of_a_mean():
    loop = Loop(FORCE, DISPLACEMENT, cycles=4, scatter=np.linspace(0.0, 0.6, 13))
    expected = np.sqrt(np.mean(np.linspace(0.0, 0.6, 13) ** 2)) / 2.0
    np.testing.assert_allclose(loop.standard_error, expected, rtol=1e-14)


def test_forces_per_width_become_totals_with_their_noise():
    loop = Loop(
        FORCE, DISPLACEMENT, noise=0.1, cycles=4, driver="displacement", units={"force": "N/m"}
    )
    wide = loop.of_width(2.0)
    np.testing.assert_allclose(wide.force, 2.0 * FORCE)
    np.testing.assert_allclose(wide.deviations, 0.1)
    assert wide.noise == 0.2
    assert wide.unit("force") == "N"
    assert loop.but(driver="force").of_width(2.0).noise == 0.1
    np.testing.assert_array_equal(wide.of_width(2.0).force, wide.force)  # a total by now


def test_closed_loops_and_pulls():
    assert Loop(FORCE, DISPLACEMENT).closed
    assert not Loop(FORCE[:-1], DISPLACEMENT[:-1]).closed
    drift = np.linspace(0.0, 1.0, FORCE.size)
    width = np.ptp(DISPLACEMENT)
    assert Loop(FORCE, DISPLACEMENT + 0.04 * width * drift).closed
    assert not Loop(FORCE, DISPLACEMENT + 0.07 * width * drift).closed


@pytest.mark.parametrize("driver", ["force", "displacement"])
def test_thinned_loops_keep_their_turns_and_ends(driver):
    # Turns between the points that an even spacing would take.
    phase = np.linspace(0.4, 0.4 + 2.0 * np.pi, 1001)
    loop = Loop(3.0 * np.cos(phase), 0.25 * np.cos(phase - 0.3), label="rig", scatter=phase)
    thin = loop.thinned(40, driver)
    assert 40 <= thin.force.size <= 44
    for whole, kept in zip(loop.columns, thin.columns, strict=True):
        assert (kept[0], kept[-1]) == (whole[0], whole[-1])
    whole, kept = getattr(loop, driver), getattr(thin, driver)
    assert (kept.max(), kept.min()) == (whole.max(), whole.min())
    # Pairs stay pairs, in their order, evenly along the driving column.
    where = [int(np.flatnonzero(loop.force == f)[0]) for f in thin.force]
    assert np.all(np.diff(where) > 0)
    np.testing.assert_array_equal(thin.displacement, loop.displacement[where])
    np.testing.assert_array_equal(thin.scatter, phase[where])
    travel = np.sum(np.abs(np.diff(whole)))
    assert np.max(np.abs(np.diff(kept))) < 1.2 * travel / 39
    assert thin.label == "rig"


def test_short_loops_are_not_thinned():
    loop = Loop(FORCE, DISPLACEMENT, label="rig")
    assert loop.thinned(FORCE.size, "force") is loop


def test_the_driver_is_the_smoother_column():
    random = np.random.default_rng(1)
    phase = np.linspace(0.0, 2.0 * np.pi, 200)
    force, displacement = 3.0 * np.cos(phase), 0.25 * np.cos(phase - 0.3)
    noise = 0.01 * random.standard_normal(phase.size)
    assert driver_of([Loop(force, displacement)]) == "force"
    assert driver_of([Loop(force, displacement + 0.5 * noise)]) == "force"
    assert driver_of([Loop(force + 6.0 * noise, displacement)]) == "displacement"
    assert driver_of(example_loops()) == "force"


def test_a_centred_loop_has_lost_its_zeros_and_nothing_else():
    phase = np.linspace(0.0, 2.0 * np.pi, 400)
    displacement, force = np.cos(phase), 3.0 * np.cos(phase + 0.4)
    loop = make_loop(force + 0.7, displacement - 0.2).but(driver="displacement")
    centred = loop.centred()
    np.testing.assert_allclose(centred.displacement, displacement, atol=1e-4)
    np.testing.assert_allclose(centred.force, force, atol=1e-3)
    assert "zeros of the sensors: displacement -0.2 and force 0.7" in centred.notes[-1]
    opened = make_loop(force[:200], displacement[:200]).centred()  # it starts unloaded
    assert (opened.force[0], opened.displacement[0], opened.free_zero) == (0.0, 0.0, True)


def test_an_elastic_path_of_uneven_points_does_no_work():
    way = np.linspace(0.0, 1.0, 12)
    u = np.concatenate([way**2, way[::-1] ** 3])
    assert make_loop(3.0 * u, u).work == pytest.approx(0.0, abs=1e-14)

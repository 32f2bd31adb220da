"""Cycles planted in noise are found, and their mean is the loop that was planted.

The loops are those of springs and sliders: plays under a force, stops under a displacement.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jbeamshell.common.errors import InputError
from jbeamshell.measured.drift import _through
from jbeamshell.measured.loop_files import read_loops
from jbeamshell.measured.loops import Loop, make_loop
from jbeamshell.measured.reversals import find_driver, find_turns, has_plateau
from jbeamshell.measured.splitting import split_cycles
from jbeamshell.measured.steady import steady_loops
from tests import rig

DRIVERS = ("force", "displacement")
NOISES = (0.001, 0.01, 0.05)


def driven(amplitudes, points, tail=0.0, level=0.0):
    """A first loading and cycles, (n,), one for each amplitude; a part of one more branch."""
    parts = []
    for goal in [s * a for a in amplitudes for s in (1, -1)] + [amplitudes[-1]]:
        count = max(round(points * abs(goal - level) / (4.0 * abs(goal))), 1)
        ahead = 0.5 - 0.5 * np.cos(np.pi * np.arange(count) / count)
        parts.append(level + (goal - level) * ahead)
        level = goal
    return np.append(
        np.concatenate(parts), level * (1.0 - 4.0 * np.arange(tail * points / 4.0) / points)
    )


def answered(drive, driver):
    """Response of springs and sliders, (n,)."""
    reach = np.linspace(0.05, 0.9, 12)
    plays, position = np.empty((drive.size, 12)), np.zeros(12)
    for i, level in enumerate(drive):
        plays[i] = position = np.clip(position, level - reach, level + reach)
    slid = plays.mean(axis=1)
    return 0.4 * drive + 1.2 * slid if driver == "force" else 1.05 * drive - slid


def recorded(drive, driver, noise=0.0, seed=0, drive_noise=0.0, drifts=(0.0, 0.0)):
    """Recording with noise and drifts of the answer and of the drive over their ranges."""
    random, time = np.random.default_rng(seed), np.linspace(0.0, 1.0, drive.size)
    answer = answered(drive, driver)
    made = []
    for column, own, drift in ((answer, noise, drifts[0]), (drive, drive_noise, drifts[1])):
        white = own * random.standard_normal(drive.size)
        made.append(column + np.ptp(column) * (white + drift * time))
    force, displacement = made if driver == "displacement" else made[::-1]
    return make_loop(force, displacement, "rig")


def with_slips(drive, points, depth, places):
    """The drive with moves back, each an eighth of a branch long; places count in cycles."""
    drive, width = drive.copy(), max(points // 16, 2)
    for place in places:
        i = int(place * points)
        back = np.sign(drive[i] - drive[i + width])
        shape = np.sin(np.pi * np.arange(width + 1) / width)
        drive[i : i + width + 1] += back * depth * shape
    return drive


def area(loop):
    return abs(np.sum(0.5 * (loop.force[1:] + loop.force[:-1]) * np.diff(loop.displacement)))


def planted_area(driver, amplitude=1.0):
    drive = driven([amplitude] * 2, 2000)
    return area(Loop(answered(drive, driver)[-2001:], drive[-2001:]))


def range_of(driver, amplitude=1.0):
    return np.ptp(answered(driven([amplitude] * 2, 400), driver))


# --- planted cycles -----------------------------------------------------------------------------


@pytest.mark.parametrize("driver", DRIVERS)
@pytest.mark.parametrize("points", [40, 200])
@pytest.mark.parametrize("noise", [0.0, *NOISES[1:]])
@pytest.mark.parametrize("depth", [0.0, 0.15])
def test_planted_cycles_are_found_whatever_their_noise_and_back_slips(driver, points, noise, depth):
    drive = driven([1.0] * 4, points, tail=0.6)
    drive = with_slips(drive, points, depth, (0.6, 1.6, 2.55, 3.5))
    recording = recorded(drive, driver, noise, seed=points, drive_noise=0.3 * noise)
    found = split_cycles(recording)
    assert len(found.cycles) == 4
    assert found.groups == 1
    starts = points * (0.25 + np.arange(5))
    near = max(2.0, (0.02 + 2.0 * noise) * points) + (depth > 0.0) * points / 16.0
    cycles = found.cycles
    np.testing.assert_allclose([c.start for c in cycles], starts[:4], atol=near)
    np.testing.assert_allclose([c.turn for c in cycles], starts[:4] + points / 2.0, atol=near)
    assert [c.end for c in cycles[:-1]] == [c.start for c in cycles[1:]]
    np.testing.assert_allclose(found.tail, [starts[4], recording.force.size - 1], atol=near)
    assert found.approach == (0, cycles[0].start)
    (loop,) = steady_loops(recording)
    assert loop.closed
    np.testing.assert_allclose(area(loop), planted_area(driver), rtol=0.01 + 2.0 * noise)


@pytest.mark.parametrize("points", [40, 200])
def test_the_column_that_repeats_its_levels_drives(points):
    # Steep moves back are small in the displacement that makes them, and large in the force.
    drive = with_slips(driven([1.0] * 4, points, tail=0.6), points, 0.2, (0.6, 1.55, 2.6, 3.5))
    found = split_cycles(recorded(drive, "displacement"))
    assert found.driver == "displacement"
    assert len(found.cycles) == 4


@pytest.mark.parametrize("noisy", rig.NOISES)
@pytest.mark.parametrize("seed", range(4))
def test_noise_on_a_plateau_does_not_hide_that_the_displacement_drives(noisy, seed):
    random = np.random.default_rng(seed)
    u = 0.28 * rig.path(3, int(random.choice([80, 200])), shape=random.choice(["sine", "ramp"]))
    force = rig.stops(u, [random.uniform(0.005, 0.1)], [100.0])
    noise = random.choice([0.001, 0.01, 0.02])
    recording = rig.recorded(force, u, noise, noisy, seed, random.choice([None, "displacement"]))
    for loop in steady_loops(recording):
        assert loop.driver == "displacement"
        assert np.min(loop.displacement) > 1.1 * np.min(recording.displacement)
        assert np.max(loop.displacement) < 1.1 * np.max(recording.displacement)


@pytest.mark.parametrize("noisy", rig.NOISES)
@pytest.mark.parametrize("seed", range(4))
def test_no_force_that_drives_shows_a_plateau(noisy, seed):
    random = np.random.default_rng(seed)
    force = rig.path(3, int(random.choice([40, 200])))
    slid = rig.iwan_by_force(force, random.uniform(1.0, 4.0)) - random.choice([0.0, 0.5]) * force
    noise = random.choice([0.001, 0.01, 0.05])
    recording = rig.recorded(force, slid, noise, noisy, seed, random.choice([None, "force"]))
    assert not has_plateau(recording.force, recording.displacement)


@pytest.mark.parametrize("noise", [0.0, 0.0005])
@pytest.mark.parametrize(("depth", "turns"), [(0.03, 4), (0.13, 6)])
def test_moves_back_by_less_than_a_tenth_are_no_turns(depth, turns, noise):
    # Back and forth in the middle of the third branch, over the range of the drive.
    slip = -2.0 * depth * (1.0 - np.abs(np.linspace(-1.0, 1.0, 41)))
    drive = np.insert(driven([1.0] * 2, 200), np.full(41, 201), slip)
    drive += 2.0 * noise * np.random.default_rng(3).standard_normal(drive.size)
    assert len(find_turns(drive, smallest=0.01)) == turns


@pytest.mark.parametrize("driver", DRIVERS)
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_amplitudes_are_told_apart_and_averaged_each(driver, noise):
    amplitudes = (1.0, 0.3, 0.55)
    drive = driven([a for a in amplitudes for _ in range(4)] + [1.0] * 2, 200, tail=0.5)
    # Without noise, nothing tells what drove.
    loops = steady_loops(recorded(drive, driver, noise, 3), None if noise else driver)
    assert len(loops) == 3
    for loop, amplitude, cycles in zip(loops, (0.3, 0.55, 1.0), (3, 3, 5), strict=True):
        assert cycles <= loop.cycles <= cycles + 1
        np.testing.assert_allclose(np.ptp(getattr(loop, driver)), 2.0 * amplitude, rtol=0.01)
        # The noise is that of the whole range.
        close = 0.01 + 5.0 * noise * range_of(driver) / range_of(driver, amplitude)
        np.testing.assert_allclose(area(loop), planted_area(driver, amplitude), rtol=close)
        assert f"rig: {driver} -{amplitude:g}" in loop.label or noise


@pytest.mark.parametrize("driver", DRIVERS)
@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("start", [0.1, 0.8])
def test_one_cycle_that_starts_between_its_turns_is_rolled(driver, noise, start):
    whole = recorded(driven([1.0] * 3, 200), driver, noise, 8)
    own = slice(int((start + 1.25) * 200), int((start + 2.25) * 200) + 1)
    loop = make_loop(whole.force[own], whole.displacement[own], "rig")
    found = split_cycles(loop, driver)
    assert len(found.cycles) == 1
    assert sorted(found.recording.force[1:]) == sorted(loop.force[1:])
    (mean,) = steady_loops(loop, driver)
    assert mean.noise is mean.scatter is mean.standard_error is None
    assert mean.notes[0].startswith(f"one {driver}-driven cycle only, whose ")
    np.testing.assert_allclose(area(mean), planted_area(driver), rtol=0.01 + 3.0 * noise)


@pytest.mark.parametrize("driver", DRIVERS)
def test_a_first_cycle_that_differs_is_left_out(driver):
    # From zero up and back: the first branch is a first loading.
    drive = 1.0 - np.cos(2.0 * np.pi * np.arange(801) / 200.0)
    (loop,) = steady_loops(recorded(drive, driver, 0.002), driver)
    assert loop.cycles == 3
    assert loop.notes[0].startswith(f"mean of 3 of 4 {driver}-driven cycles; left out, as their ")
    assert loop.notes[0].endswith(": 1")


# --- noise --------------------------------------------------------------------------------------


@pytest.mark.parametrize("driver", DRIVERS)
@pytest.mark.parametrize("points", [40, 1000])
@pytest.mark.parametrize("noise", NOISES)
def test_the_noise_is_told(driver, points, noise):
    # From just after a turn to just before one.
    whole = recorded(driven([1.0] * 7, points), driver, noise, seed=5)
    own = slice(points // 4 + 1, None)
    (loop,) = steady_loops(make_loop(whole.force[own], whole.displacement[own]), driver)
    assert loop.cycles >= 6
    np.testing.assert_allclose(loop.noise / range_of(driver), noise, rtol=0.15)
    # The points of the mean are as good as means of the samples that each stands for.
    each = loop.cycles * points / (loop.force.size - 1)
    np.testing.assert_allclose(loop.standard_error, loop.noise / np.sqrt(each), rtol=0.2)


@pytest.mark.parametrize(("points", "cycles"), [(40, 6), (96, 3)])
def test_mean_loops_scatter_by_their_standard_error(points, cycles):
    drive, noise = driven([1.0] * cycles, points), 0.01
    clean = recorded(drive, "force")
    random, white = np.random.default_rng(2), noise * np.ptp(clean.displacement)
    means, errors, noises, areas = [], [], [], []
    for _ in range(50):
        noisy = clean.displacement + white * random.standard_normal(drive.size)
        (loop,) = steady_loops(clean.but(displacement=noisy), "force", points=100)
        if loop.cycles == cycles:
            means.append(loop.displacement)
            errors.append(loop.standard_error)
            noises.append(loop.noise)
            areas.append(area(loop))
    assert len(means) > 40
    spread = np.sqrt(np.mean(np.var(means, axis=0, ddof=1)))
    np.testing.assert_allclose(np.sqrt(np.mean(np.square(errors))), spread, rtol=0.06)
    np.testing.assert_allclose(np.mean(noises), white, rtol=0.06)
    # Neither the loop nor its area is off by more than its repeats tell.
    (true,) = steady_loops(clean, "force", points=100)
    off = np.abs(np.mean(means, axis=0) - true.displacement)
    assert np.max(off) < 5.0 * spread / np.sqrt(len(means))
    np.testing.assert_allclose(np.mean(areas), planted_area("force"), rtol=0.006)


# --- drift --------------------------------------------------------------------------------------


@pytest.mark.parametrize("driver", DRIVERS)
@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("drift", ["linear", "cycle"])
@pytest.mark.parametrize("drifts", [(0.5, 0.0), (-0.3, 0.08)])
def test_a_drift_is_removed_and_told(driver, noise, drift, drifts):
    recording = recorded(driven([1.0] * 8, 200, tail=0.4), driver, noise, 4, drifts=drifts)
    (loop,) = steady_loops(recording, driver, drift)
    assert loop.cycles >= 7
    answer = "displacement" if driver == "force" else "force"
    assert loop.notes[0].startswith(f"removed from the recording: a {drift} drift of {driver} ")
    assert f" and {answer} " in loop.notes[0]
    assert not any("drifts by" in note for note in loop.notes)
    np.testing.assert_allclose(area(loop), planted_area(driver), rtol=0.01 + 2.0 * noise)
    if noise:
        np.testing.assert_allclose(loop.noise / range_of(driver), noise, rtol=0.15)


def test_a_drift_that_turns_is_removed_cycle_by_cycle():
    recording = recorded(driven([1.0] * 10, 200), "force", 0.002)
    time = np.linspace(0.0, 1.0, recording.force.size)
    wander = 0.3 * np.sin(2.0 * np.pi * time)
    recording = recording.but(displacement=recording.displacement + wander, time=time)
    (loop,) = steady_loops(recording, "force", "cycle")
    assert loop.cycles >= 8
    np.testing.assert_allclose(area(loop), planted_area("force"), rtol=0.02)


def test_a_drift_that_is_kept_is_told():
    recording = recorded(driven([1.0] * 8, 200), "force", 0.01, drifts=(0.1, 0.0))
    (loop,) = steady_loops(recording, "force")
    assert any("remove it by --drift" in note for note in loop.notes)


# --- bad recordings -----------------------------------------------------------------------------

PULL = driven([1.0] * 2, 200)


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize(
    ("drive", "told"),
    [
        (
            PULL[:50],
            "rig: force runs from .* never turns back by more than .*: no cycle to average",
        ),
        (PULL[:110], "rig: force runs from .* and turns once, at .*: no three turns make a cycle"),
        (PULL[50:150], "rig: force runs from 1.* to -0.99.* never turns back by more than"),
        (PULL[:190], "rig: force runs from .* and turns 2 times, at .*, -.*: no three turns make"),
        (
            driven([1.0, 0.8, 0.6, 0.4], 200)[:-60],
            "and turns .* times, at .*, ...: no three turns make",
        ),
    ],
)
def test_recordings_without_a_whole_cycle_say_so(drive, told, noise):
    if noise and "1.* to" in told:
        told = "rig: force runs from .* never turns back by more than"
    with pytest.raises(InputError, match=told):
        steady_loops(recorded(drive, "force", noise, 6, 0.3 * noise), "force")


OPTIONS = [
    ({"driver": "load"}, "driver = 'load': give 'force' or 'displacement'"),
    ({"drift": "linaer"}, r"drift = 'linaer': choose among \('keep', 'linear', 'cycle'\)"),
    ({"smallest": 0.0}, "smallest = 0.0: give a share of the range between 0 and 1"),
    ({"steady": -1.0}, "steady = -1.0: give a part of the range, such as 0.01"),
    ({"points": 16}, "points = 16: give more than 16"),
]


def test_bad_options_and_loops_built_by_hand_are_refused():
    for options, told in OPTIONS:
        with pytest.raises(InputError, match=told):
            steady_loops(recorded(PULL, "force"), **options)
    flat = Loop(np.zeros(20), np.linspace(0.0, 1.0, 20), label="rig")
    with pytest.raises(InputError, match=r"rig: force is constant \(0\): no loop to fit"):
        steady_loops(flat)


def test_what_was_dropped_stays_counted(tmp_path):
    recording = recorded(driven([1.0] * 4, 100), "force", 0.001)
    rows = np.column_stack([recording.force, recording.displacement])
    rows[::50, 1] = np.nan
    path = tmp_path / "rig.csv"
    np.savetxt(path, rows, delimiter=";", header="force [kN];displacement [mm]")
    (loop,) = steady_loops(*read_loops(path))
    assert loop.dropped == len(rows[::50])
    assert loop.notes == (
        f"{loop.dropped} of {len(rows)} rows lack a number: left out",
        "mean of 4 of 4 force-driven cycles",
    )
    np.testing.assert_allclose(area(loop), planted_area("force"), rtol=0.02)
    shorter = steady_loops(*read_loops(path), points=50)[0]
    assert shorter.force.size <= 50
    np.testing.assert_allclose(area(shorter), planted_area("force"), rtol=0.02)


COLUMN = st.one_of(
    st.lists(st.floats(-1e99, 1e99), min_size=8, max_size=60),
    st.lists(st.integers(-3, 3).map(float), min_size=8, max_size=120),
    st.lists(st.integers(-1, 1), min_size=8, max_size=200).map(np.cumsum),
    st.tuples(st.integers(8, 300), st.floats(0.0, 1.0), st.floats(-1e9, 1e9)).map(
        lambda p: p[2] + np.sin(p[1] * np.arange(p[0]))
    ),
)


@given(
    force=COLUMN,
    displacement=COLUMN,
    driver=st.sampled_from([None, *DRIVERS]),
    drift=st.sampled_from(["keep", "linear", "cycle"]),
    smallest=st.sampled_from([1e-6, 0.05, 0.5]),
)
def test_anything_gives_closed_finite_loops_or_one_clear_line(
    force, displacement, driver, drift, smallest
):
    size = min(len(force), len(displacement))
    try:
        recording = make_loop(force[:size], displacement[:size], "rig")
        loops, refused = steady_loops(recording, driver, drift, smallest=smallest), "rig: "
    except InputError as error:
        loops, refused = [], str(error)
    assert refused.startswith("rig: ")
    assert len(refused.splitlines()) == 1
    for loop in loops:
        assert np.all(np.isfinite([loop.force, loop.displacement]))
        assert (loop.force[0], loop.displacement[0]) == (loop.force[-1], loop.displacement[-1])
        assert 1 <= loop.cycles <= size // 2
        assert loop.scatter is None or loop.scatter.shape == loop.force.shape


@pytest.mark.parametrize("driver", DRIVERS)
@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("repeats", [1, 3])
def test_rising_amplitudes_close_on_the_way_to_the_next(driver, noise, repeats):
    amplitudes = (0.25, 0.5, 0.75, 1.0)
    drive = driven([a for a in amplitudes for _ in range(repeats)], 200)
    found = split_cycles(recorded(drive, driver, noise, 5, 0.1 * noise), driver)
    assert found.groups == 4
    for amplitude, loop in zip(amplitudes, steady_loops(found.recording, driver), strict=False):
        assert np.ptp(getattr(loop, driver)) == pytest.approx(2.0 * amplitude, rel=0.02)
        close = 0.03 + 5.0 * noise * range_of(driver) / range_of(driver, amplitude)
        np.testing.assert_allclose(area(loop), planted_area(driver, amplitude), rtol=close)
        assert loop.cycles == repeats


def test_rising_amplitudes_that_end_at_rest_lose_the_last_and_falling_ones_all():
    rising, falling = driven([0.25, 0.5, 1.0], 200), driven([1.0, 0.75, 0.5], 200)
    assert split_cycles(recorded(rising[:-70], "displacement"), "displacement").groups == 2
    with pytest.raises(InputError, match="no three turns make a cycle"):
        split_cycles(recorded(falling[:-70], "displacement"), "displacement")


@pytest.mark.parametrize("driver", DRIVERS)
@pytest.mark.parametrize("centre", [0.5, 2.0])
def test_offset_and_one_sided_cycles_are_found(driver, centre):
    drive = centre + driven([1.0] * 3, 200)
    drive = np.append(np.linspace(0.0, drive[0], 40), drive[1:])
    answer = answered(drive, driver)
    columns = (answer, drive) if driver == "displacement" else (drive, answer)
    (loop,) = steady_loops(make_loop(*columns), driver)
    assert np.ptp(getattr(loop, driver)) == pytest.approx(2.0, rel=0.01)
    np.testing.assert_allclose(area(loop), planted_area(driver), rtol=0.02)


def test_drift_goes_on_beyond_the_cycles_as_it_was_at_each_end():
    middles, offsets = np.array([1.0, 2.0, 4.0]), np.array([0.0, 1.0, 0.0])
    found = _through(np.array([0.0, 1.5, 3.0, 5.0]), middles, offsets)
    np.testing.assert_allclose(found, [-1.0, 0.5, 0.5, -0.5])


@pytest.mark.parametrize("name", ["jenkins", "bouc-wen", "iwan by force"])
def test_the_column_that_moves_as_a_machine_drives(name):
    random = np.random.default_rng(7)
    for seed in range(20):
        noise = random.choice([0.0, 0.002, 0.01])
        columns = rig.sound(name, random)
        noisy = random.choice(list(rig.NOISES))
        made = rig.recorded(*columns, noise, noisy, seed, rig.SOUND[name])
        assert find_driver(made.force, made.displacement) == rig.SOUND[name], seed

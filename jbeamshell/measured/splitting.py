"""Cycles in a recording: where they start, turn and end, and which are of one amplitude."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jbeamshell.common.errors import InputError
from jbeamshell.measured.loops import CLOSED, Loop
from jbeamshell.measured.recordings import Recording, recording_from_arrays
from jbeamshell.measured.reversals import (
    SMALLEST,
    Floats,
    SmoothPath,
    extremes,
    find_driver,
    noise_of,
    smoothed_path,
)

ALIKE = 0.05  # of a cycle's range: levels that differ by less belong together
MORE = 1.1  # times the points in cycles that make the other column the driver
COMPLETE = 0.02  # of the branch beside it: an end that misses a turn by less is one


class Cycle(NamedTuple):
    """One cycle, from a turn to the next but one, which is at the same level.

    Attributes
    ----------
    start, turn, end : points of the recording
    levels : of the driving column at the start, the turn and the end; where the recording begins or
        ends shortly before a turn, that of the turn opposite
    group : number of its amplitude group, by increasing amplitude
    """

    start: int
    turn: int
    end: int
    levels: tuple[float, float, float]
    group: int = 0

    @property
    def low(self) -> float:
        """Lower level of the driving column."""
        return min(0.5 * (self.levels[0] + self.levels[2]), self.levels[1])

    @property
    def high(self) -> float:
        """Upper level of the driving column."""
        return max(0.5 * (self.levels[0] + self.levels[2]), self.levels[1])


class Cycles(NamedTuple):
    """A recording taken apart.

    Attributes
    ----------
    recording : as given; a single cycle that starts between its turns is rolled to start at one
    driver : "force" or "displacement"
    path : (points,) the driving column without its noise
    noise : standard deviation of the noise left in the path
    band : smallest move that counts as one
    turns : points of the recording where the path turns
    cycles : in the order of time; parts between cycles of two groups belong to none
    approach, tail : (first, last) point before the first cycle, such as a first loading, and after
        the last, such as an incomplete cycle
    """

    recording: Recording
    driver: str
    path: Floats
    noise: float
    band: float
    turns: tuple[int, ...]
    cycles: tuple[Cycle, ...]
    approach: tuple[int, int]
    tail: tuple[int, int]

    @property
    def answer(self) -> str:
        """Name of the column that does not drive."""
        return "displacement" if self.driver == "force" else "force"

    @property
    def response(self) -> Floats:
        """The column that answers, (points,)."""
        return getattr(self.recording, self.answer)

    def group(self, number: int) -> list[Cycle]:
        """The cycles of one amplitude."""
        return [cycle for cycle in self.cycles if cycle.group == number]

    @property
    def groups(self) -> int:
        """How many amplitudes there are."""
        return 1 + max(cycle.group for cycle in self.cycles)


def split_cycles(
    recording: Recording | Loop, driver: str | None = None, *, smallest: float = SMALLEST
) -> Cycles:
    """Find the cycles of a recording.

    The driving column turns where it moves back by more than a dead band: the larger of
    ``smallest`` of its range and what its noise does.  A move back by less than a tenth of the
    moves before and after is a back-slip and no turn.  Three turns make a cycle if the third is at
    the level of the first, to 5 % of its range; cycles whose levels agree to 5 % are of one
    amplitude.

    Parameters
    ----------
    recording : of one test
    driver : "force" or "displacement"; None takes the column that `find_driver` does, or the other
        if that repeats its levels over a good part more of the recording
    smallest : range of the smallest cycle to be found, over the whole range

    Raises
    ------
    InputError
        if there is no reversal, or no whole cycle
    """
    if not isinstance(recording, Recording | Loop):
        kind = type(recording).__name__
        raise InputError(f"recording: a {kind} is none: give a Recording or a Loop")
    if not (driver is None or (isinstance(driver, str) and driver in ("force", "displacement"))):
        raise InputError(f"driver = {driver!r}: give 'force' or 'displacement'")
    if not 0.0 < smallest < 1.0:
        raise InputError(f"smallest = {smallest}: give a share of the range between 0 and 1")
    if isinstance(recording, Loop):
        loop = recording
        recording = recording_from_arrays(loop.force, loop.displacement, loop.label)
        recording = recording._replace(
            dropped=loop.dropped + recording.dropped, notes=(*loop.notes, *recording.notes)
        )
    driver = driver or _driver(recording, smallest)
    path = smoothed_path(getattr(recording, driver), smallest)
    turns, inner = _turns(path.smooth, path.band)
    cycles = _cycles(path.smooth, turns, path.noise)
    if not cycles and (start := _once_round(recording, inner)) is not None:
        rolled = _rolled(recording, start)
        smooth = np.append(path.smooth[start:], path.smooth[1 : start + 1])
        path = path._replace(smooth=smooth)
        turns, inner = _turns(smooth, path.band)
        cycles, recording = _cycles(smooth, turns, path.noise), rolled
    if not cycles:
        raise InputError(_no_cycle(recording.label, driver, path, inner))
    last = path.smooth.size - 1
    return Cycles(
        recording,
        driver,
        *path,
        tuple(turns),
        tuple(_grouped(cycles, path.noise)),
        (0, cycles[0].start),
        (cycles[-1].end, last),
    )


def _driver(recording: Recording, smallest: float) -> str:
    first = find_driver(recording.force, recording.displacement)
    second = "displacement" if first == "force" else "force"
    within = {}
    for name in (first, second):
        path = smoothed_path(getattr(recording, name), smallest)
        turns, _ = _turns(path.smooth, path.band)
        within[name] = sum(c.end - c.start for c in _cycles(path.smooth, turns, path.noise))
    return second if within[second] > MORE * within[first] else first


def _turns(path: Floats, band: float) -> tuple[list[int], list[int]]:
    """All turns, ends that complete a branch included, and those inside the path."""
    found = extremes(path, band)
    inner = found[1:-1]
    if len(found) < 3:
        return inner, inner
    moves = np.abs(np.diff(path[found]))
    first = 0 if moves[0] >= (1.0 - COMPLETE) * moves[1] else 1
    last = len(found) if moves[-1] >= (1.0 - COMPLETE) * moves[-2] else -1
    return found[first:last], inner


def _cycles(path: Floats, turns: list[int], noise: float) -> list[Cycle]:
    cycles, i = [], 0
    while i + 2 < len(turns):
        a, b, c = turns[i : i + 3]
        start, middle, end = float(path[a]), float(path[b]), float(path[c])
        if abs(end - start) <= ALIKE * abs(middle - start) + 3.0 * noise:
            outer = start if abs(start - middle) > abs(end - middle) else end
            start = outer if a == 0 else start
            end = outer if c == path.size - 1 else end
            cycles.append(Cycle(a, b, c, (start, middle, end)))
            i += 2
        else:
            i += 1
    return cycles


def _grouped(cycles: list[Cycle], noise: float) -> list[Cycle]:
    """Cycles with the numbers of their groups: alike in range, and then in mean level."""
    ranges = np.array([c.high - c.low for c in cycles])
    means = np.array([0.5 * (c.high + c.low) for c in cycles])
    number, group = 0, np.zeros(len(cycles), dtype=int)
    for alike in _clusters(ranges, ALIKE * ranges + 4.0 * noise):
        for own in _clusters(means[alike], ALIKE * ranges[alike] + 4.0 * noise):
            group[alike[own]] = number
            number += 1
    return [cycle._replace(group=int(g)) for cycle, g in zip(cycles, group, strict=True)]


def _clusters(values: Floats, gap: Floats) -> list[np.ndarray]:
    """Indices of values, (n,), that no gap in their order parts; by increasing value."""
    order = np.argsort(values, kind="stable")
    parted = np.flatnonzero(np.diff(values[order]) > gap[order][1:]) + 1
    return [np.sort(own) for own in np.split(order, parted)]


def _once_round(recording: Recording, inner: list[int]) -> int | None:
    """The turn to start from, if the recording is one cycle that starts between its turns."""
    columns = (recording.force, recording.displacement)
    once = all(abs(c[-1] - c[0]) <= CLOSED * np.ptp(c) + 4.0 * noise_of(c) for c in columns)
    return inner[0] if once and len(inner) == 2 else None


def _rolled(recording: Recording, start: int) -> Recording:
    def rolled(column: Floats) -> Floats:
        return np.append(column[start:], column[1 : start + 1])

    return recording._replace(
        force=rolled(recording.force),
        displacement=rolled(recording.displacement),
        time=None,
        normal_force=None if recording.normal_force is None else rolled(recording.normal_force),
    )


def _no_cycle(label: str, driver: str, path: SmoothPath, inner: list[int]) -> str:
    """What was found instead of a cycle, and what to do."""
    ends = f"{label}: {driver} runs from {path.smooth[0]:.4g} to {path.smooth[-1]:.4g}"
    if not inner:
        return (
            f"{ends} and never turns back by more than {path.band:.2g}: no cycle to average; "
            "record whole cycles, or fit it as it is, a first loading"
        )
    levels = ", ".join(f"{level:.4g}" for level in path.smooth[inner[:6]])
    times = "once" if len(inner) == 1 else f"{len(inner)} times"
    return (
        f"{ends} and turns {times}, at {levels}{', ...' if len(inner) > 6 else ''}: no three turns "
        "make a cycle that returns to its level; record on until it does"
    )

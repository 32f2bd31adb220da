"""Cycles of a recording: their starts, turns and ends, and their groups of one amplitude."""

from __future__ import annotations

import dataclasses

import numpy as np

from jbeamshell.common.errors import InputError
from jbeamshell.measured.loops import CLOSED, Loop, make_loop
from jbeamshell.measured.reversals import (
    SMALLEST,
    Floats,
    SmoothPath,
    extremes,
    find_driver,
    has_plateau,
    noise_of,
    smoothed_path,
)

ALIKE = 0.05  # difference of levels over a cycle's range, below which they are alike
MORE = 1.1  # ratio of points in whole cycles above which the other column is the driver
COMPLETE = 0.02  # distance of an end from a turn over the branch, below which it is a turn


@dataclasses.dataclass(frozen=True)
class Cycle:
    """Cycle from a turn to the second next turn, which is at the same level or passes it.

    Attributes
    ----------
    start, turn, end : indices of points of the recording
    levels : levels of the driving column at start, turn and end; if the recording begins or ends
        shortly before a turn, the level of that turn is taken from the other end
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


@dataclasses.dataclass(frozen=True, eq=False)
class Cycles:
    """Recording split into cycles.

    Attributes
    ----------
    recording : recording as given; a single cycle that starts between its turns is rotated in time
        to start at one
    driver : "force" or "displacement"
    path : (points,) driving column without its noise
    noise : standard deviation of the remaining noise of the path
    band : dead band: smallest move that counts
    turns : indices of the points at which the path turns
    cycles : cycles in the order of time; points between two groups may belong to no cycle
    approach, tail : (first, last) index of the points before the first cycle, such as a first
        loading, and after the last, such as an incomplete cycle
    """

    recording: Loop
    driver: str
    path: Floats
    noise: float
    band: float
    turns: tuple[int, ...]
    cycles: tuple[Cycle, ...]
    approach: tuple[int, int]
    tail: tuple[int, int]

    @property
    def responding(self) -> str:
        """Name of the column that does not drive."""
        return "displacement" if self.driver == "force" else "force"

    @property
    def response(self) -> Floats:
        """Column (points,) that does not drive."""
        return getattr(self.recording, self.responding)

    def group(self, number: int) -> list[Cycle]:
        """Cycles of one amplitude group."""
        return [cycle for cycle in self.cycles if cycle.group == number]

    @property
    def groups(self) -> int:
        """Number of amplitude groups."""
        return 1 + max(cycle.group for cycle in self.cycles)


def split_cycles(
    recording: Loop, driver: str | None = None, *, smallest: float = SMALLEST
) -> Cycles:
    """Find the cycles of a recording.

    The driving column turns where it moves back by more than the dead band, which is ``smallest``
    of its range or the range of its noise if that is larger.  A move back by less than a tenth of
    the moves before and after it is a back-slip and no turn.  Three turns make a cycle if the third
    is at the level of the first, to 5 % of the cycle's range.  Cycles whose levels agree to 5 % are
    of one amplitude.

    Parameters
    ----------
    recording : recording of one test
    driver : "force" or "displacement"; None takes the column of `find_driver`; without a plateau
        the other one if its whole cycles cover at least 10 % more points
    smallest : range of the smallest cycle to be found, over the whole range

    Returns
    -------
    Cycles
        the driving column without noise, and the cycles in the order of time

    Raises
    ------
    InputError
        if there is no reversal or no whole cycle, or if an argument is out of range
    """
    if not isinstance(recording, Loop):
        raise InputError(f"recording: a {type(recording).__name__} is no recording: give a Loop")
    if not (driver is None or (isinstance(driver, str) and driver in ("force", "displacement"))):
        raise InputError(f"driver = {driver!r}: give 'force' or 'displacement'")
    if not 0.0 < smallest < 1.0:
        raise InputError(f"smallest = {smallest}: give a share of the range between 0 and 1")
    # Raises for one that was made by hand.
    whole = make_loop(recording.force, recording.displacement, recording.label)
    if whole.dropped:
        notes = (*recording.notes, *whole.notes)
        recording = whole.but(dropped=recording.dropped + whole.dropped, notes=notes)
    driver = driver or _driver(recording, smallest)
    path = smoothed_path(getattr(recording, driver), smallest)
    turns, inner = _turns(path)
    cycles = _cycles(path.smooth, turns, path.noise)
    if not cycles and (start := _once_round(recording, inner)) is not None:
        rolled = _rolled(recording, start)
        smooth = np.append(path.smooth[start:], path.smooth[1 : start + 1])
        path = path._replace(smooth=smooth)
        turns, inner = _turns(path)
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


def _driver(recording: Loop, smallest: float) -> str:
    columns = recording.force, recording.displacement
    if has_plateau(*columns):
        return "displacement"
    first = find_driver(*columns)
    second = "displacement" if first == "force" else "force"
    within = {}
    for name in (first, second):
        path = smoothed_path(getattr(recording, name), smallest)
        turns, _ = _turns(path)
        within[name] = sum(c.end - c.start for c in _cycles(path.smooth, turns, path.noise))
    return second if within[second] > MORE * within[first] else first


def _turns(path: SmoothPath) -> tuple[list[int], list[int]]:
    """Turns with the ends that complete a branch, and turns inside the path."""
    found = extremes(path.smooth, path.band)
    inner = found[1:-1]
    if len(found) < 3:
        return inner, inner
    moves, slack = np.abs(np.diff(path.smooth[found])), 3.0 * path.noise
    first = 0 if moves[0] >= (1.0 - COMPLETE) * moves[1] - slack else 1
    last = len(found) if moves[-1] >= (1.0 - COMPLETE) * moves[-2] - slack else -1
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
        elif (passed := _passed(path, a, b, c)) is not None:
            cycles.append(Cycle(a, b, passed, (start, middle, start)))
            i += 2
        else:
            i += 1
    return cycles


def _passed(path: Floats, start: int, turn: int, end: int) -> int | None:
    """Point at which the way to the end passes the level of the start; None if it is no cycle.

    Start and turn must enclose the path before, whose memory they have wiped out then.
    """
    up = float(np.sign(path[start] - path[turn]))
    level, slack = up * path[start], ALIKE * abs(path[start] - path[turn])
    before = up * path[: turn + 1]
    if np.max(before) > level + slack or np.min(before) < up * path[turn] - slack:
        return None
    beyond = up * path[turn:end] >= level
    return turn + int(np.argmax(beyond)) if np.any(beyond) else None


def _grouped(cycles: list[Cycle], noise: float) -> list[Cycle]:
    """Cycles with the numbers of their groups, which are alike in range and in mean level."""
    ranges = np.array([c.high - c.low for c in cycles])
    means = np.array([0.5 * (c.high + c.low) for c in cycles])
    number, group = 0, np.zeros(len(cycles), dtype=int)
    for alike in _clusters(ranges, ALIKE * ranges + 4.0 * noise):
        for own in _clusters(means[alike], ALIKE * ranges[alike] + 4.0 * noise):
            group[alike[own]] = number
            number += 1
    return [
        dataclasses.replace(cycle, group=int(g)) for cycle, g in zip(cycles, group, strict=True)
    ]


def _clusters(values: Floats, gap: Floats) -> list[np.ndarray]:
    """Indices of values (n,) in clusters without a larger gap, by increasing value."""
    order = np.argsort(values, kind="stable")
    splits = np.flatnonzero(np.diff(values[order]) > gap[order][1:]) + 1
    return [np.sort(own) for own in np.split(order, splits)]


def _once_round(recording: Loop, inner: list[int]) -> int | None:
    """Turn to start from if the recording is one cycle that starts between its turns, else None."""
    columns = (recording.force, recording.displacement)
    once = all(abs(c[-1] - c[0]) <= CLOSED * np.ptp(c) + 4.0 * noise_of(c) for c in columns)
    return inner[0] if once and len(inner) == 2 else None


def _rolled(recording: Loop, start: int) -> Loop:
    def rolled(column: Floats) -> Floats:
        return np.append(column[start:], column[1 : start + 1])

    return recording.but(
        force=rolled(recording.force),
        displacement=rolled(recording.displacement),
        time=None,
        normal_force=None if recording.normal_force is None else rolled(recording.normal_force),
    )


def _no_cycle(label: str, driver: str, path: SmoothPath, inner: list[int]) -> str:
    """Message on what was found instead of a cycle, and what to do."""
    ends = f"{label}: {driver} runs from {path.smooth[0]:.4g} to {path.smooth[-1]:.4g}"
    if not inner:
        return (
            f"{ends} and never turns back by more than {path.band:.2g}: no cycle to average; "
            "record whole cycles, or fit it as a backbone, which is a first loading"
        )
    levels = ", ".join(f"{level:.4g}" for level in path.smooth[inner[:6]])
    times = "once" if len(inner) == 1 else f"{len(inner)} times"
    return (
        f"{ends} and turns {times}, at {levels}{', ...' if len(inner) > 6 else ''}: no three turns "
        "make a cycle that returns to its level; record whole cycles"
    )

"""The steady loop that the cycles of a recording repeat, and how far they scatter about it."""

from __future__ import annotations

import numpy as np

from jbeamshell.common.errors import InputError
from jbeamshell.measured.loops import Loop
from jbeamshell.measured.recordings import Recording
from jbeamshell.measured.reversals import SMALLEST, Floats, noise_of
from jbeamshell.measured.splitting import Cycle, Cycles, split_cycles

STEADY = 0.01  # of the range of the response: cycles that lie closer repeat
PARTS = 16  # of a loop, the means over which are compared
POINTS = 200  # of a mean loop at most
FEWEST = 8  # knots of a branch
# Of the curve against kinks, per sample at a knot.  It bridges gaps; and with this much of it the
# heights of white noise scatter like independent means of the samples around each knot.
STIFFNESS = 0.02
DRIFTS = ("keep", "linear", "cycle")


def steady_loops(
    recording: Recording | Loop,
    driver: str | None = None,
    drift: str = "keep",
    *,
    smallest: float = SMALLEST,
    steady: float = STEADY,
    points: int = POINTS,
) -> list[Loop]:
    """The mean steady loop of every amplitude in a recording, closed.

    Cycles count as steady whose response, averaged over 16 parts of the loop, lies within
    ``steady`` of the response's range of the median of the later half of the cycles, or within
    three times what is usual for those or what their noise makes of it (rms over the parts).

    Parameters
    ----------
    recording : of one test
    driver : "force" or "displacement"; None finds out
    drift : "keep" it; "linear" removes from both columns the straight line in time (in points if
        there is no time) that their cycles' means follow; "cycle" removes what the means do
    smallest : range of the smallest cycle to be found, over the whole range
    steady : distance, over the response's range, within which cycles repeat
    points : of each loop at most

    Returns
    -------
    one loop per amplitude, by increasing amplitude, from turn to turn to turn, with ``noise``,
    ``scatter`` and ``cycles``; its notes tell what was left out or removed

    Raises
    ------
    InputError
        if there is no reversal, or no whole cycle
    """
    if drift not in DRIFTS:
        raise InputError(f"drift = {drift!r}: choose among {DRIFTS}")
    if not 0.0 <= steady < np.inf:
        raise InputError(f"steady = {steady}: give a part of the range, such as {STEADY}")
    if not 2 * FEWEST < points < np.inf:
        raise InputError(f"points = {points}: give more than {2 * FEWEST}")
    found = split_cycles(recording, driver, smallest=smallest)
    if drift != "keep":
        found = _without_drift(found, drift, smallest)
    loops = [_mean_loop(found, number, steady, points) for number in range(found.groups)]
    # Where a straight line crosses zero is known no better than its slope.
    return [loop._replace(free_zero=drift != "keep") for loop in loops]


class _ClosedCurve:
    """A closed loop of straight pieces, least squares through samples.

    A loop is run through by its phase: 0 to 1 down from the high turn to the low one, 1 to 2 up
    again, in proportion to the driving column.

    Parameters
    ----------
    phase : (samples,) of all cycles
    knots : of each branch
    """

    def __init__(self, phase: Floats, knots: int) -> None:
        # Between even and as dense as the samples: no cell is empty, and none is far too full.
        even = np.linspace(0.0, 1.0, knots + 1)
        branches = []
        for start in (0.0, 1.0):
            own = np.clip(phase[(phase >= start) & (phase <= start + 1.0)] - start, 0.0, 1.0)
            dense = np.quantile(np.concatenate([own, [0.0, 1.0]]), even)
            dense[[0, -1]] = 0.0, 1.0
            branches.append(start + 0.5 * (even + dense))
        self.knots = np.append(branches[0][:-1], branches[1])  # the last is the first again
        self.size = self.knots.size - 1
        rows = [i for i in range(1, self.size) if i != knots]  # turns may be sharp
        second = np.zeros((len(rows), self.size))
        for row, i in zip(second, rows, strict=True):
            before, after = self.knots[i] - self.knots[i - 1], self.knots[i + 1] - self.knots[i]
            width = 0.5 * (before + after)
            row[i - 1], row[(i + 1) % self.size] = width / before, width / after
            row[i] = -row[i - 1] - row[(i + 1) % self.size]
        self._smoothness = STIFFNESS * second.T @ second

    def through(self, phase: Floats, values: Floats) -> Floats:
        """Heights at the knots, (size,), that fit samples, (samples,) each, best."""
        cell = np.clip(np.searchsorted(self.knots, phase, "right") - 1, 0, self.size - 1)
        right = (phase - self.knots[cell]) / np.diff(self.knots)[cell]
        left, after = 1.0 - right, (cell + 1) % self.size
        matrix, vector = self._smoothness * (phase.size / self.size), np.zeros(self.size)
        for i, a in ((cell, left), (after, right)):
            np.add.at(vector, i, a * values)
            for j, b in ((cell, left), (after, right)):
                np.add.at(matrix, (i, j), a * b)
        return np.asarray(np.linalg.solve(matrix, vector))

    def at(self, phase: Floats, heights: Floats) -> Floats:
        """The curve with such heights at the knots, (size,), at phases of any shape."""
        return np.interp(phase, self.knots, np.append(heights, heights[0]))

    def parts(self, heights: Floats) -> Floats:
        """Means over equal parts of the loop, (PARTS,)."""
        fine = (np.arange(PARTS * 16) + 0.5) * 2.0 / (PARTS * 16)
        return self.at(fine, heights).reshape(PARTS, -1).mean(axis=1)


def _phases(found: Cycles, cycle: Cycle) -> tuple[np.ndarray, Floats]:
    """Points of a cycle, without its back-slips, and their phases, (samples,) each."""
    points, phases = [], []
    start, middle, end = cycle.levels
    branches = (cycle.start, cycle.turn, start, middle), (cycle.turn, cycle.end, middle, end)
    for first, last, here, there in branches:
        way = (found.path[first:last] - here) / (there - here)  # 0 to 1, whichever way it runs
        slack = 4.0 * found.noise / abs(there - here)
        ahead = way >= np.maximum.accumulate(way) - slack
        rising = there > here
        points.append(first + np.flatnonzero(ahead))
        phases.append(float(rising) + np.clip(way[ahead], 0.0, 1.0))
    return np.concatenate(points), np.concatenate(phases)


def _mean_loop(found: Cycles, number: int, steady: float, points: int) -> Loop:
    cycles = found.group(number)
    samples = [_phases(found, cycle) for cycle in cycles]
    response = found.response
    per_cycle = float(np.median([phase.size for _, phase in samples]))
    knots = int(np.clip(per_cycle // 2, FEWEST, (points - 1) // 2))
    curve = _ClosedCurve(np.concatenate([phase for _, phase in samples]), knots)
    heights = np.array([curve.through(phase, response[i]) for i, phase in samples])
    repeats, limit = _repeating(curve, heights, steady, noise_of(response), per_cycle)
    own = np.flatnonzero(repeats)
    where = np.concatenate([samples[i][0] for i in own])
    phase = np.concatenate([samples[i][1] for i in own])
    mean = curve.through(phase, response[where])
    noise = scatter = None
    if own.size > 1:
        left = response[where] - curve.at(phase, mean)
        noise = float(np.sqrt(np.sum(left**2) / max(phase.size - curve.size, 1)))
        spread = np.std(heights[own], axis=0, ddof=1)
        scatter = np.append(spread, spread[0])
    low = float(np.mean([cycles[i].low for i in own]))
    high = float(np.mean([cycles[i].high for i in own]))
    drive = low + (high - low) * np.abs(curve.knots - 1.0)
    columns = {found.driver: drive, found.answer: np.append(mean, mean[0])}
    recording = found.recording
    label = recording.label
    if found.groups > 1:
        label = f"{label}: {found.driver} {low:.4g} to {high:.4g}"
    return Loop(
        label=label,
        noise=noise,
        cycles=int(own.size),
        dropped=recording.dropped,
        scatter=scatter,
        notes=(*recording.notes, *_notes(found, number, curve, heights, repeats, limit)),
        driver=found.driver,
        force=columns["force"],
        displacement=columns["displacement"],
    )


def _repeating(
    curve: _ClosedCurve, heights: Floats, steady: float, noise: float, per_cycle: float
) -> tuple[np.ndarray, float]:
    """Which cycles, (cycles,), repeat the median of the later half, and how close that is."""
    parts = np.array([curve.parts(own) for own in heights])
    later = slice(len(heights) // 2, None)
    distance = np.sqrt(np.mean((parts - np.median(parts[later], axis=0)) ** 2, axis=1))
    usual = 3.0 * float(np.median(distance[later]))
    noisy = 2.0 * noise * float(np.sqrt(PARTS / per_cycle))
    limit = max(steady * float(np.ptp(np.median(heights, axis=0))), usual, noisy)
    return distance <= limit, limit


def _notes(
    found: Cycles,
    number: int,
    curve: _ClosedCurve,
    heights: Floats,
    repeats: np.ndarray,
    limit: float,
) -> list[str]:
    """What was averaged, what was left out, and whether the mean hides a drift."""
    count, own = len(repeats), f"{found.driver}-driven cycle"
    if count == 1:
        (only,) = found.group(number)
        gap = abs(found.response[only.end] - found.response[only.start])
        return [
            f"one {own} only, whose {found.answer} returns to within {gap:.2g}: neither its noise "
            "is known nor whether it is steady"
        ]
    notes = [f"mean of {np.count_nonzero(repeats)} of {count} {own}s"]
    left = ", ".join(str(i + 1) for i in np.flatnonzero(~repeats))
    if left:
        notes[0] += (
            f"; left out, as their {found.answer} is off by more than {limit:.2g}: {left[:60]}"
        )
    levels = np.array([curve.parts(own).mean() for own in heights[repeats]])
    turn = np.arange(levels.size, dtype=float)
    slope = _slope(turn, levels)
    drift, error = slope * levels.size, np.std(levels - slope * turn) * np.sqrt(12.0 / levels.size)
    if levels.size > 3 and abs(drift) > max(STEADY * float(np.ptp(heights)), 3.0 * error):
        notes.append(
            f"the {found.answer} drifts by {drift:.2g} meanwhile: the argument drift removes it"
        )
    return notes


def _without_drift(found: Cycles, drift: str, smallest: float) -> Cycles:
    """The same cycles with their columns straightened."""
    recording = found.recording
    clock = recording.time
    if clock is None or not np.all(np.diff(clock) >= 0.0) or clock[0] == clock[-1]:
        clock = np.arange(found.path.size, dtype=float)
    middles = np.array([0.5 * (clock[c.start] + clock[c.end]) for c in found.cycles])
    levels = {
        found.driver: np.array([0.5 * (c.low + c.high) for c in found.cycles]),
        found.answer: np.array([_level(found, c) for c in found.cycles]),
    }
    groups = np.array([c.group for c in found.cycles])
    straight, told = {}, []
    for name, level in levels.items():
        column = getattr(recording, name)
        if drift == "cycle":
            middle = [np.median(level[groups == g]) for g in range(found.groups)]
            wander = _through(clock, middles, level - np.array(middle)[groups])
        else:
            wander = _common_slope(found, groups, middles, level, clock, column) * (
                clock - clock[0]
            )
        straight[name] = column - wander
        told.append(f"{name} {float(np.ptp(wander)):.3g}")
    note = f"removed from the recording: a {drift} drift of {' and '.join(told)} in all"
    recording = recording._replace(**straight, notes=(*recording.notes, note))
    return split_cycles(recording, found.driver, smallest=smallest)


def _level(found: Cycles, cycle: Cycle) -> float:
    """Mean of the response over a cycle, however its points are spaced."""
    points, phase = _phases(found, cycle)
    curve = _ClosedCurve(phase, FEWEST)
    return float(curve.parts(curve.through(phase, found.response[points])).mean())


def _common_slope(
    found: Cycles, groups: np.ndarray, middles: Floats, level: Floats, clock: Floats, column: Floats
) -> float:
    """Slope in time of the cycles' levels; by the gap of a cycle where none is repeated."""
    slopes = []
    for number in range(found.groups):
        own = groups == number
        if np.count_nonzero(own) > 1:
            slopes.append((_slope(middles[own], level[own]), np.count_nonzero(own)))
    if slopes:
        values, counts = np.array(slopes).T
        return float(np.average(values, weights=counts))
    gaps = [
        (column[c.end] - column[c.start]) / (clock[c.end] - clock[c.start]) for c in found.cycles
    ]
    return float(np.median(gaps))


def _through(clock: Floats, middles: Floats, offsets: Floats) -> Floats:
    """Straight lines from offset to offset, drawn on to both ends of the clock."""
    if offsets.size == 1:
        return np.full(clock.shape, offsets[0])
    slopes = np.diff(offsets) / np.diff(middles)
    before = np.minimum(clock - middles[0], 0.0) * slopes[0]
    after = np.maximum(clock - middles[-1], 0.0) * slopes[-1]
    return np.interp(clock, middles, offsets) + before + after


def _slope(x: Floats, y: Floats) -> float:
    """Median slope between points half of them apart (Theil): a few odd ones do not turn it."""
    half = max(x.size // 2, 1)
    if x.size < 2:
        return 0.0
    return float(np.median((y[half:] - y[:-half]) / (x[half:] - x[:-half])))

"""Mean loops of recordings with noise in both columns.

Where the driving column is noisy, its level tells neither the branch nor the place of a sample: the
samples near a turn scatter across it, and the largest of them lies beyond it.  So samples are put
in order by time.  Both columns are averaged over the same samples, at equal parts of the time from
turn to turn, so that every mean pair lies on the loop but for its noise.  A turn is where parabolas
through the samples before and after it meet.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from jbeamshell.measured.reversals import Floats
from jbeamshell.measured.splitting import Cycle, Cycles

FEWEST = 8  # samples of a branch
CELLS = 47  # most mean pairs of a branch
WINDOW = 0.2  # part of a branch beside a turn through which parabolas are laid
SHIFTS = np.linspace(
    -0.1, 0.1, 21
)  # parts of a branch by which a turn may lie beside its first guess
BEGIN = 0.05  # part of a branch beside an end of the recording, within which a turn is at the end
QUIET = 1e-4  # noise of the drive over its range, below which it is none
LITTLE = 0.03  # and over that of the response, likewise
SHARED = 0.5  # part of the drive's roughness that the response follows, above which it is no noise
ROUNDING = 1e-6  # of a column's range
BENT = 1.0 / 6.0  # of a pair's distance from the chord of its neighbours; 1/12 on a parabola
MEDIAN = 0.4549  # median of the square of a normal number
STRAIGHT = [0, 1, 3]  # of the columns of two parabolas
ORDER, SQUARES = 5, 252.0  # of differences, and the sum of the squares of their weights


class Noises(NamedTuple):
    """Standard deviations of a single sample of both columns."""

    drive: float
    response: float


class PairedMeans(NamedTuple):
    """Mean pairs of cycles of one amplitude, from the high turn to the low one and back.

    Attributes
    ----------
    columns : (2, points) driving and responding column; the first, the middle and the last point
        are the turns
    errors : (2, points) their standard errors over the noise of a single sample
    """

    columns: Floats
    errors: Floats

    @property
    def bent(self) -> Floats:
        """Distance (points,) along the response by which a mean pair lies beside a bent loop."""
        drive, response = self.columns
        off, middle = np.zeros(drive.size), drive.size // 2
        for own in (slice(0, middle + 1), slice(middle, None)):
            x, y = drive[own], response[own]
            way = x[2:] - x[:-2]
            part = np.divide(x[1:-1] - x[:-2], way, np.full(way.size, 0.5), where=way != 0.0)
            chord = y[:-2] + np.clip(part, 0.0, 1.0) * (y[2:] - y[:-2])
            off[own][1:-1] = BENT * np.abs(y[1:-1] - chord)
        return off


def noises_of(found: Cycles, cycles: list[Cycle]) -> Noises | None:
    """Noise of both columns by their roughness; None if that of the drive is negligible.

    What uneven times add to the roughness of the drive, the response follows by the loop's slope.
    """
    drive, response = getattr(found.recording, found.driver), found.response
    rough = []
    for cycle in cycles:
        for a, b in ((cycle.start, cycle.turn), (cycle.turn, cycle.end)):
            if b - a < FEWEST:
                return None
            rough.append([np.diff(column[a : b + 1], ORDER) for column in (drive, response)])
    drives, answers = np.concatenate(rough, axis=1)
    squares = [float(np.median(each**2)) / (MEDIAN * SQUARES) for each in (drives, answers)]
    slope = float(np.ptp(response) / np.ptp(drive)) * float(
        np.sign(np.corrcoef(drive, response)[0, 1])
    )
    shared = float(np.median(drives * answers / slope)) / (MEDIAN * SQUARES)
    if shared > SHARED * squares[0]:
        return None
    noises = Noises(*np.sqrt(squares).tolist())
    part, other = noises.drive / float(np.ptp(drive)), noises.response / float(np.ptp(response))
    return noises if part > max(QUIET, LITTLE * other) else None


def paired_means(found: Cycles, cycles: list[Cycle], noises: Noises) -> PairedMeans:
    """Mean pairs of some cycles of one amplitude."""
    columns = np.stack([getattr(found.recording, found.driver), found.response])
    last = columns.shape[1] - 1
    length = 0.5 * float(np.median([cycle.end - cycle.start for cycle in cycles]))
    reach = max(int(WINDOW * length), FEWEST // 2)
    cycles = [  # noise hides whether a recording begins and ends at a turn
        dataclasses.replace(
            cycle,
            start=cycle.start if cycle.start > BEGIN * length else 0,
            end=cycle.end if last - cycle.end > BEGIN * length else last,
        )
        for cycle in cycles
    ]
    branches = [(c, a, b) for c in cycles for a, b in ((c.start, c.turn), (c.turn, c.end))]
    sharp = _sharp(columns[0], [(a, b) for _, a, b in branches])
    turns, sides = dict[int, Turn](), dict[int, bool]()
    for cycle, a, b in branches:
        down = (cycle.levels[0] > cycle.levels[1]) == (a == cycle.start)
        sides |= {a: down, b: not down}
    closed = sides.get(0) is not None and sides.get(0) == sides.get(last)
    time = np.arange(-reach, reach + 1)
    form = length, noises, sharp
    for i in sides:
        if i in (0, last) and closed:  # from turn to turn: the end goes on at the start
            turns[i] = _turn(columns[:, time % last], time, sides[i], *form)
        elif reach <= i <= last - reach and i in found.turns:
            turns[i] = _turn(columns[:, i + time], time, sides[i], *form)
    for cycle in cycles:
        for i in (cycle.start, cycle.turn):
            if not any(sides[i] == sides[other] for other in turns):  # near an end
                part = time[(time >= -i) & (time <= last - i)]
                turns[i] = _turn(columns[:, i + part], part, sides[i], *form)
    ends = {i: i + (turns[i].time if i in turns else 0.0) for i in sides}
    if not closed:
        ends = {i: float(np.clip(time, 0, last)) for i, time in ends.items()}
    place, part, up = (
        np.concatenate(each)
        for each in zip(
            *(_passed(found, ends[a], ends[b], a, b, not sides[a]) for _, a, b in branches),
            strict=True,
        )
    )
    cells = CELLS + 1
    counts = np.zeros(1, int)
    while not np.all(counts):
        cells -= 1
        cell = np.minimum((part * cells).astype(int), cells - 1) + cells * up
        counts = np.bincount(cell, minlength=2 * cells)
    own = columns[:, place % last]  # a whole cycle goes on at its start
    sums = np.stack([np.bincount(cell, column, 2 * cells) for column in own])
    if closed and last in turns:
        del turns[last]
    (top, above), (bottom, below) = (
        _mean([turn for i, turn in turns.items() if sides[i] == high]) for high in (True, False)
    )
    means, errors = sums / counts, np.tile(1.0 / np.sqrt(counts), (2, 1))
    return PairedMeans(
        _around(top, means[:, :cells], bottom, means[:, cells:]),
        _around(above, errors[:, :cells], below, errors[:, cells:]),
    )


def _passed(
    found: Cycles, begin: float, end: float, first: int, last: int, up: bool
) -> tuple[Floats, Floats, Floats]:
    """Samples between the times of two turns without back-slips, their parts of it, and up."""
    place = np.arange(int(np.ceil(begin)), int(np.ceil(end)))
    way = (found.path[first : last + 1] - found.path[first]) * (1.0 if up else -1.0)
    behind = way < np.maximum.accumulate(way) - 4.0 * found.noise
    ahead = ~behind[np.clip(place - first, 0, last - first)]
    return place[ahead], ((place - begin) / (end - begin))[ahead], np.full(ahead.sum(), up, int)


def _around(top: Floats, down: Floats, bottom: Floats, up: Floats) -> Floats:
    """Columns (2, points) from the high turn to the low one and back."""
    return np.concatenate([top[:, None], down, bottom[:, None], up, top[:, None]], axis=1)


class Turn(NamedTuple):
    """Turn: its time in samples, levels (2,) of both columns, and their errors over the noise."""

    time: float
    levels: Floats
    errors: Floats


def _sharp(drive: Floats, branches: list[tuple[int, int]]) -> bool:
    """True if the drive goes rather at a constant rate than as a sine."""
    left = np.zeros(2)
    for a, b in branches:
        way = np.linspace(0.0, 1.0, b - a + 1)
        for i, rate in enumerate((way, -np.cos(np.pi * way))):
            left[i] += 1.0 - np.corrcoef(drive[a : b + 1], rate)[0, 1] ** 2
    return bool(left[0] < left[1])


def _turn(
    columns: Floats, time: NDArray[np.int64], high: bool, length: float, noises: Noises, sharp: bool
) -> Turn:
    """Turn within a window (2, samples) about its first guess."""
    # A turn at an end of the recording has samples on one side alone, which do not tell its time.
    shifts = length * SHIFTS * min(-time[0], time[-1]) / max(-time[0], time[-1])
    if not sharp:  # the top of a sine through the drive

        def sine(time: Any) -> Floats:
            angle = np.pi * np.asarray(time) / length
            return np.stack([np.ones(angle.shape), np.sin(angle), np.cos(angle)], axis=-1)

        whole = np.linalg.pinv(sine(time))
        _, rise, top = (whole @ columns[0] * (1.0 if high else -1.0)).tolist()
        best = float(np.clip(length / np.pi * np.arctan2(rise, top), shifts[0], shifts[-1]))
        at_top = sine(best) @ whole
        other = np.linalg.pinv(_parabolas(time - best))[0]
        levels = np.array([at_top @ columns[0], other @ columns[1]])
        return Turn(best, levels, np.linalg.norm([at_top, other], axis=1))
    sizes = np.maximum(noises, ROUNDING * np.ptp(columns, axis=1))
    scaled = (columns - columns[:, [time.size // 2]]) / sizes[:, None]

    def rows(shift: float) -> list[Floats]:
        both = _parabolas(time - shift)
        return [both[:, STRAIGHT], both]  # the drive goes at a constant rate

    def left(shift: float) -> float:
        pairs = zip(rows(shift), scaled, strict=True)
        return sum(float(np.sum((y - x @ np.linalg.lstsq(x, y)[0]) ** 2)) for x, y in pairs)

    best, step = min(shifts.tolist(), key=left), shifts[1] - shifts[0]
    if step > 0.0:
        best = float(minimize_scalar(left, bounds=(best - step, best + step), method="bounded").x)
    inverses = [np.linalg.pinv(x) for x in rows(best)]
    levels = np.array([own[0] @ column for own, column in zip(inverses, columns, strict=True)])
    # The time of a sharp turn has an error, which moves both levels.
    at, zero = time - best, np.zeros(time.size)
    slopes = np.stack([zero, at < 0, 2.0 * np.minimum(at, 0.0), at > 0, 2.0 * np.maximum(at, 0.0)])
    moved = [
        own.T @ (inverse @ y)
        for own, inverse, y in zip((slopes[STRAIGHT], slopes), inverses, scaled, strict=True)
    ]
    triples = zip(rows(best), inverses, moved, strict=True)
    free = np.concatenate([by - x @ (inverse @ by) for x, inverse, by in triples])
    by_time = [inverse[0] @ by for inverse, by in zip(inverses, moved, strict=True)]
    own_errors = [np.linalg.norm(inverse[0]) for inverse in inverses]
    return Turn(best, levels, np.hypot(own_errors, np.array(by_time) / np.linalg.norm(free)))


def _parabolas(time: NDArray[Any]) -> Floats:
    """Columns (samples, 5) of two parabolas that meet at time 0."""
    before, after = np.minimum(time, 0.0), np.maximum(time, 0.0)
    return np.stack([np.ones(time.size), before, before**2, after, after**2], axis=1)


def _mean(turns: list[Turn]) -> tuple[Floats, Floats]:
    """Mean levels (2,) of some turns of one level, and their errors over the noise."""
    levels, errors = (
        np.array([getattr(turn, name) for turn in turns]) for name in ("levels", "errors")
    )
    return np.mean(levels, axis=0), np.linalg.norm(errors, axis=0) / len(turns)

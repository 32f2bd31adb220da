"""Reversals of a noisy load path, and the choice of the column that drives a test."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SMALLEST = 0.05  # move back over the range, below which it is no reversal
NESTED = 0.1  # move back over each of its neighbours, below which it is a back-slip
GROSS_SLIP = 0.02  # tangent over secant stiffness, below which everything slides
SLIDING = 0.1  # sliding part of the travel, above which the displacement drives
PARTS = 25  # of a branch, over which force and displacement are compared
SHUFFLED = 2.0  # scatter of displacement over force to its converse, above which it drives
TOLD = 0.01  # part of the range that this scatter has at least
CALM = 0.001  # excess travel over the travel from turn to turn of a column without noise
EVEN = 0.5  # unevenness of one column over that of the other, below which it drives
OF_NOISE = 0.2  # unevenness over the noise, above which it is told
OF_SAMPLE = 0.25  # and times the points of a branch: a sine that turns between two samples
FEWEST = 5  # points of a branch that tells its rate

Floats = NDArray[np.float64]


class SmoothPath(NamedTuple):
    """Load path without its noise.

    Attributes
    ----------
    smooth : (points,) path, smoothed if it is noisy
    noise : standard deviation of the remaining noise
    band : dead band: smallest move that counts
    """

    smooth: Floats
    noise: float
    band: float


def noise_of(column: Floats) -> float:
    """Standard deviation of the white noise on a smooth column (points,), by a robust estimate."""
    third = np.abs(np.diff(column, 3))  # almost zero for a smooth column
    return float(np.median(third) / (0.6745 * np.sqrt(20.0))) if third.size else 0.0


def smoothed_path(drive: Floats, smallest: float = SMALLEST) -> SmoothPath:
    """Smooth a load path as much as its noise requires and its turns allow.

    Local parabolas over w points cut a sharp turn by 3 w / 32 steps and leave 3/2 of the noise over
    the square root of w; the width makes both errors about equal.

    Parameters
    ----------
    drive : (points,) load path
    smallest : least dead band, over the range
    """
    scale, noise = float(np.ptp(drive)), noise_of(drive)
    band = max(smallest * scale, min(_extremes(drive.size) * noise, 0.7 * scale))
    ends = extremes(drive, band) or [0, drive.size]
    branch = float(np.median(np.diff(ends)))  # points from turn to turn
    width = int(min((16.0 * noise / scale * branch) ** (2.0 / 3.0), branch / 5.0)) // 2 * 2 + 1
    if width < 5:
        return SmoothPath(drive, noise, band)
    left = 1.5 * noise / np.sqrt(width)
    band = max(smallest * scale, _extremes(drive.size / width) * left)
    return SmoothPath(_local_parabolas(drive, width), left, band)


def find_turns(drive: Floats, smallest: float = SMALLEST) -> list[int]:
    """Indices at which a noisy path (points,) turns, without its ends."""
    path = smoothed_path(drive, smallest)
    return extremes(path.smooth, path.band)[1:-1]


def extremes(path: Floats, band: float) -> list[int]:
    """Indices of a path's first extreme, its turns and its last extreme; none if it does not move.

    Moves within the dead band do not count.  Neither does a back-slip: a move back by less than a
    tenth of the moves before and after it.
    """
    level = path.tolist()
    found: list[int] = []
    low = high = direction = 0
    for i in _corners(path):
        if direction >= 0 and level[i] > level[high]:
            high = i
        if direction <= 0 and level[i] < level[low]:
            low = i
        if direction >= 0 and level[high] - level[i] > band:
            found.append(high)
            low, direction = i, -1
        elif direction <= 0 and level[i] - level[low] > band:
            found.append(low)
            high, direction = i, 1
    if direction:
        found.append(high if direction > 0 else low)
    return _without_slips(path, found)


def find_driver(force: Floats, displacement: Floats) -> str:
    """Find the column, "force" or "displacement", that drove a test.

    It is the displacement if there is a plateau, see `has_plateau`.  Else it is the column that
    goes from turn to turn as machines do, at a constant rate or as a sine; the other one bends as
    the joint softens.  Where neither tells, it is the column that travels from turn to turn with
    less movement to and fro, and the force if both are smooth.

    Parameters
    ----------
    force, displacement : (points,) columns of a recording, evenly in time
    """
    if has_plateau(force, displacement):
        return "displacement"
    uneven, excess, least = {}, {}, 0.0
    for name, column in (("force", force), ("displacement", displacement)):
        path = smoothed_path(column)
        ends = extremes(path.smooth, path.band)
        uneven[name] = _unevenness(column, ends)
        net = float(np.sum(np.abs(np.diff(column[ends])))) or float(np.ptp(column))
        excess[name] = float(np.sum(np.abs(np.diff(column)))) / net - 1.0
        least = max(least, OF_NOISE * noise_of(column) / float(np.ptp(column)))
        least = max(least, OF_SAMPLE * max(len(ends) - 1, 1) / column.size)
    even, other = sorted(uneven, key=uneven.__getitem__)
    if uneven[other] > least and uneven[even] < EVEN * uneven[other]:
        return even
    noisy = max(excess.values()) > CALM
    return "displacement" if noisy and excess["displacement"] < 0.5 * excess["force"] else "force"


def _unevenness(column: Floats, ends: list[int]) -> float:
    """Deviation of the branches between some extremes from straight lines or half sines in time.

    It is a root mean square without the noise, over the range of the column; 0 where no branch goes
    from turn to turn, as in a first loading.
    """
    turns = [i for i in ends if 0 < i < column.size - 1]
    if len(turns) == 1 and abs(column[-1] - column[0]) < SMALLEST * np.ptp(column):
        turns = ends  # one cycle from turn to turn to turn
    squares = []
    for here, there in itertools.pairwise(turns):
        way, branch = np.linspace(0.0, 1.0, there - here + 1), column[here : there + 1]
        if branch.size < FEWEST or np.ptp(branch) == 0.0:
            continue
        rates = (way, -np.cos(np.pi * way))
        alike = max(float(np.corrcoef(branch, rate)[0, 1]) ** 2 for rate in rates)
        squares.append(float(np.var(branch)) * (1.0 - alike))
    if not squares:
        return 0.0
    return max(float(np.mean(squares)) - noise_of(column) ** 2, 0.0) ** 0.5 / float(np.ptp(column))


def has_plateau(force: Floats, displacement: Floats) -> bool:
    """True if everything slides for a part of the time, which only displacement control can do.

    Much of the displacement's travel happens at constant force then; or along a branch it scatters
    over the force far more than the force over it, as on a noisy plateau.

    Parameters
    ----------
    force, displacement : (points,) columns of a recording
    """
    return _sliding(force, displacement) > SLIDING or _shuffled(force, displacement)


def _sliding(force: Floats, displacement: Floats) -> float:
    """Part of the displacement's travel at constant force, over means of some points each."""
    path = smoothed_path(displacement)
    branch = np.diff(extremes(path.smooth, path.band) or [0, displacement.size])
    size = max(int(np.median(branch)) // PARTS, 1)
    whole = displacement.size // size * size
    rise, way = (
        np.abs(np.diff(column[:whole].reshape(-1, size).mean(axis=1))) / np.ptp(column)
        for column in (force, displacement)
    )
    noise = 3.0 * np.sqrt(2.0 / size) * noise_of(force) / np.ptp(force)
    if noise > 0.25 / PARTS:  # too much to tell a constant force
        return 0.0
    constant = rise < GROSS_SLIP * way + noise
    return float(np.sum(way[constant]) / np.sum(way))


def _shuffled(force: Floats, displacement: Floats) -> bool:
    """True if the order of the forces shuffles a branch, and that of its displacements does not.

    The scatter of a column over another is that of neighbours in the other's order (von Neumann
    1941). Noise of either column makes both scatters about equal where no plateau is.
    """
    path = smoothed_path(displacement)
    ends = extremes(path.smooth, path.band) or [0, displacement.size - 1]
    u, f = displacement / np.ptp(displacement), force / np.ptp(force)
    squares, count = np.zeros(2), 0
    for here, there in itertools.pairwise(ends):
        branch = slice(here, there + 1)
        for i, (x, y) in enumerate(((f, u), (u, f))):
            neighbours = np.diff(y[branch][np.argsort(x[branch], kind="stable")])
            squares[i] += 0.5 * float(neighbours @ neighbours)
        count += there - here
    scatter = np.sqrt(squares / max(count, 1))
    return bool(scatter[0] > max(SHUFFLED * scatter[1], TOLD))


def _corners(path: Floats) -> list[int]:
    """Indices of first point, local extremes (first point of a plateau) and last point."""
    moves = np.append(0, np.flatnonzero(np.diff(path)) + 1)
    signs = np.sign(np.diff(path[moves]))
    corners = moves[1:-1][signs[1:] != signs[:-1]]
    return [0, *corners.tolist(), int(moves[-1])]


def _without_slips(path: Floats, found: list[int]) -> list[int]:
    """Extremes without the pairs that enclose a back-slip; the smallest is removed first."""
    kept = np.asarray(found, dtype=int)
    while kept.size > 3:
        moves = np.abs(np.diff(path[kept]))
        inner = moves[1:-1] / np.minimum(moves[:-2], moves[2:])
        i = int(np.argmin(inner))
        if inner[i] > NESTED:
            break
        kept = np.delete(kept, [i + 1, i + 2])
    return [int(i) for i in kept]


def _extremes(points: float) -> float:
    """Expected range of so many independent values of unit noise, with a margin of one."""
    return 2.0 * float(np.sqrt(2.0 * np.log(max(points, 2.0)))) + 1.0


def _local_parabolas(column: Floats, width: int) -> Floats:
    """Column smoothed by least-squares parabolas (Savitzky & Golay), mirrored at its ends."""
    half = width // 2
    offset = np.arange(-half, half + 1.0)
    second, fourth = np.sum(offset**2), np.sum(offset**4)
    weights = (fourth - second * offset**2) / (width * fourth - second**2)
    start = 2.0 * column[0] - column[half:0:-1]
    end = 2.0 * column[-1] - column[-2 : -half - 2 : -1]
    return np.convolve(np.concatenate([start, column, end]), weights, mode="valid")


def median_slope(x: Floats, y: Floats) -> float:
    """Median slope (Theil) between points half of the points apart; outliers do not change it."""
    half = max(x.size // 2, 1)
    if x.size < 2:
        return 0.0
    return float(np.median((y[half:] - y[:-half]) / (x[half:] - x[:-half])))

"""Where a noisy load path turns, and which of two columns is the load path."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SMALLEST = 0.05  # of the range: a move back that is smaller is no reversal
NESTED = 0.1  # of both its neighbours: a move back that is smaller is a back-slip
GROSS_SLIP = 0.02  # of the secant stiffness: where the tangent is lower, everything slides
SLIDING = 0.1  # of the way: where more of it slides, the displacement drives
CALM = 0.001  # to and fro, over the way from turn to turn, of a column without noise

Floats = NDArray[np.float64]


class SmoothPath(NamedTuple):
    """A load path without its noise.

    Attributes
    ----------
    smooth : (points,) the path, smoothed if it is noisy
    noise : standard deviation of the noise left in it
    band : smallest move that counts as one
    """

    smooth: Floats
    noise: float
    band: float


def noise_of(column: Floats) -> float:
    """Standard deviation of the white noise on a smooth column, (points,), robustly."""
    third = np.abs(np.diff(column, 3))  # of a smooth column, next to nothing
    return float(np.median(third) / (0.6745 * np.sqrt(20.0))) if third.size else 0.0


def smoothed_path(drive: Floats, smallest: float = SMALLEST) -> SmoothPath:
    """A load path (points,) smoothed as much as its noise asks for and its turns allow.

    Local parabolas over w points cut a sharp turn by 3/32 of w steps and leave 3/2 of the noise
    over the root of w; the width makes both alike.

    Parameters
    ----------
    drive : (points,)
    smallest : move that counts at least, over the range
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
    """Indices at which a noisy path (points,) turns, its ends left out."""
    path = smoothed_path(drive, smallest)
    return extremes(path.smooth, path.band)[1:-1]


def extremes(path: Floats, band: float) -> list[int]:
    """Indices of a path's first extreme, its turns and its last extreme; none if it never moves.

    Moves by no more than the dead band are no moves; nor is a back-slip, which is a move back by
    less than a tenth of the moves before and after it.
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
    """Which of two columns (points,) drove the test.

    The one that runs from turn to turn with less to and fro; where neither has any, the
    displacement if much of it happens at a force that stays, which no force can command; else the
    force.
    """
    excess = {}
    for name, column in (("force", force), ("displacement", displacement)):
        path = smoothed_path(column)
        ends = column[extremes(path.smooth, path.band)]
        net = float(np.sum(np.abs(np.diff(ends)))) or float(np.ptp(column))
        excess[name] = float(np.sum(np.abs(np.diff(column)))) / net - 1.0
    if max(excess.values()) > CALM:
        return "displacement" if excess["displacement"] < 0.5 * excess["force"] else "force"
    rise = np.abs(np.diff(force)) / np.ptp(force)
    way = np.abs(np.diff(displacement)) / np.ptp(displacement)
    sliding = np.sum(way[rise < GROSS_SLIP * way]) / np.sum(way)
    return "displacement" if sliding > SLIDING else "force"


def _corners(path: Floats) -> list[int]:
    """First point, local extremes (a plateau's first point) and last point."""
    moves = np.append(0, np.flatnonzero(np.diff(path)) + 1)
    signs = np.sign(np.diff(path[moves]))
    corners = moves[1:-1][signs[1:] != signs[:-1]]
    return [0, *corners.tolist(), int(moves[-1])]


def _without_slips(path: Floats, found: list[int]) -> list[int]:
    """Extremes without the pairs that enclose a back-slip, the smallest taken first."""
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
    """From the lowest to the highest of so many independent values of unit noise, and a bit."""
    return 2.0 * float(np.sqrt(2.0 * np.log(max(points, 2.0)))) + 1.0


def _local_parabolas(column: Floats, width: int) -> Floats:
    """Least-squares parabola around every point (Savitzky & Golay), mirrored at the ends."""
    half = width // 2
    offset = np.arange(-half, half + 1.0)
    second, fourth = np.sum(offset**2), np.sum(offset**4)
    weights = (fourth - second * offset**2) / (width * fourth - second**2)
    start = 2.0 * column[0] - column[half:0:-1]
    end = 2.0 * column[-1] - column[-2 : -half - 2 : -1]
    return np.convolve(np.concatenate([start, column, end]), weights, mode="valid")

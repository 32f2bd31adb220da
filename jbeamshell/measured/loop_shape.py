"""Shape of measured cycles: their work, and what their branches tell of the joint.

A branch of a rate-independent joint softens from turn to turn: over the displacement its force is
concave, over the force its displacement is convex (Masing 1926).  A branch that stiffens has a
clearance in it; one whose width is that of an ellipse is viscous, or one channel lags the other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jbeamshell.measured.closed_curve import FEWEST_KNOTS, PARTS, ClosedCurve, phases_of
from jbeamshell.measured.reversals import Floats, noise_of
from jbeamshell.measured.splitting import Cycles

CELLS = PARTS // 2  # parts of a branch
MOST_KNOTS = 64  # of a branch
FEW_CYCLES = 3  # cycles from which their scatter is known
NOTHING = 1e-12
SURE = 4.0  # standard errors beyond which a figure is no noise

# Figures that tell synthetic loops apart, see tests/measured/test_inspection.py.
NO_WORK = 0.004  # work over the product of the ranges, below which a loop is a line
BACKWARD = 0.1  # mean slope along the drive over the ranges, below which a loop leans backward
CONVEX = 0.1  # part of the range by which a branch stiffens
UNLIKE = 0.05  # part of the range by which both branches differ
FLAT = 0.1  # slope at the branch's end over that from turn to turn, below which everything slides
ROUND = 0.1  # misfit of an ellipse over the width, below which the loop is one
NARROW = 0.5  # width in the middle over the largest, below which a loop is pinched

_FINE = (np.arange(CELLS * 64) + 0.5) / (CELLS * 64)
ELLIPSE = np.sqrt(_FINE * (1.0 - _FINE)).reshape(CELLS, -1).mean(axis=1)
PARABOLA = (_FINE * (1.0 - _FINE)).reshape(CELLS, -1).mean(axis=1)


class LoopShape(NamedTuple):
    """Figures of the mean cycle of one amplitude, each with its standard error.

    Lengths along the response are parts of its range, those along the drive parts of the drive's.

    Attributes
    ----------
    driver : column that drives
    slope : mean slope of the response along the drive
    correlation : correlation of force and displacement over the whole recording
    work : work of a cycle over the product of both ranges; 1 for a rectangle
    work_error : its standard error
    convexity : part of the range by which the branches stiffen, 0 without
    asymmetry : difference of both branches, each from turn to turn
    end_slope : slope at the end of a branch over that from turn to turn, along the displacement
    roundness : misfit of an ellipse over the width of the loop, 0 for an ellipse; 1 in noise
    waist : width in the middle over the largest
    error : standard error of a height of a branch
    drift : change of a cycle's mean response from the first compared cycle to the last
    """

    driver: str
    slope: float
    correlation: float
    work: float
    work_error: float
    convexity: float
    asymmetry: float
    end_slope: float
    roundness: float
    waist: float
    error: float
    drift: float

    @property
    def kind(self) -> str:
        """Word for the shape, one of `KINDS`."""
        little = max(NO_WORK, SURE * self.work_error)
        if self.slope < -(BACKWARD + SURE * self.error):
            return "backward" if self.correlation < -BACKWARD else "elastic"
        if self.work < -little:
            return "negative work"
        if self.convexity > CONVEX + SURE * self.error:
            return "pinched" if self.waist < NARROW else "bearing"
        if self.work < little:
            return "elastic"
        if self.roundness < ROUND:
            return "viscous"
        return "gross slip" if self.end_slope < FLAT else "micro-slip"

    @property
    def asymmetric(self) -> bool:
        """True if both branches differ by more than noise."""
        return self.asymmetry > UNLIKE + SURE * self.error


KINDS = {
    "backward": "leans backward: the force falls as the displacement rises",
    "negative work": "turns the wrong way: its work is negative",
    "pinched": "pinched: it stiffens towards its turns and is narrow between them",
    "bearing": "stiffens towards its turns, as where a bolt bears on its hole",
    "elastic": "hardly any work",
    "viscous": "an ellipse",
    "gross slip": "gross slip: its ends are flat",
    "micro-slip": "micro-slip",
}


def shape_of(found: Cycles, number: int, averaged: int = 1) -> LoopShape:
    """Shape of the cycles of an amplitude group; the first third of them may be a run-in.

    Parameters
    ----------
    found : cycles of a recording
    number : number of the group
    averaged : number of cycles of which each is the mean already
    """
    cycles = found.group(number)
    samples = [phases_of(found, cycle) for cycle in cycles[len(cycles) // 3 :]]
    count, per_cycle = len(samples), float(np.median([phase.size for _, phase in samples]))
    knots = int(np.clip(per_cycle // 2, FEWEST_KNOTS, MOST_KNOTS))
    curve = ClosedCurve(np.concatenate([phase for _, phase in samples]), knots)
    heights = np.array([curve.through(phase, found.response[i]) for i, phase in samples])
    span = float(np.ptp(heights.mean(axis=0)))
    parts = np.array([curve.parts(own) for own in heights]) / span
    noise = noise_of(found.response) / span
    # White noise of the samples, or what the cycles scatter; few cycles cannot tell how slow it is.
    error, work_error = noise / np.sqrt(max(per_cycle / PARTS, 1.0) * count), noise
    if count >= FEW_CYCLES:
        level = parts - parts.mean(axis=1, keepdims=True)
        work_error = float(np.std(_work(parts), ddof=1) / np.sqrt(count))
        error = max(error, float(np.sqrt(np.mean(np.var(level, axis=0, ddof=1)) / count)))
        work_error = max(work_error, error * np.sqrt(2.0 / CELLS))
    drift = float(np.median(np.diff(parts.mean(axis=1)))) * (count - 1) if count > 1 else 0.0
    recording = found.recording
    lean = float(np.corrcoef(recording.force, recording.displacement)[0, 1])
    work_error = max(work_error, _wiggle(curve, heights.mean(axis=0) / span))
    shape = _shape(parts.mean(axis=0), found.driver, lean, error, work_error, drift)
    if max(count, averaged) >= FEW_CYCLES:
        return shape
    unlike = shape.asymmetry  # slow noise makes unlike branches too
    return shape._replace(error=max(error, unlike / SURE), work_error=max(work_error, unlike))


def _wiggle(curve: ClosedCurve, heights: Floats) -> float:
    """Standard error of the work by what repeats in every cycle but is no branch, such as hum."""
    middles = (np.arange(PARTS) + 0.5) / CELLS
    inside = np.abs(curve.knots[:-1] % 1.0 - 0.5) < 0.5 - 0.5 / CELLS  # a turn is a corner
    smooth = np.interp(curve.knots[:-1], middles, curve.parts(heights))
    return float(np.std((heights - smooth)[inside])) / np.sqrt(CELLS)


def _work(parts: Floats) -> Floats:
    """Signed area (...) of loops (..., PARTS) over the response: that of the branches' distance."""
    return np.mean(parts[..., CELLS:] - parts[..., CELLS - 1 :: -1], axis=-1)


def _shape(
    parts: Floats, driver: str, correlation: float, error: float, work_error: float, drift: float
) -> LoopShape:
    """Shape from the means (PARTS,) of the response over its range: a branch down, a branch up."""
    down, up = parts[:CELLS], parts[CELLS:]
    x = (np.arange(CELLS) + 0.5) / CELLS
    width, middle = up - down[::-1], 0.5 * (up + down[::-1])
    straight = np.polynomial.Polynomial.fit(x, middle, 1)(x)
    slope = float(straight[-1] - straight[0]) / (1.0 - 1.0 / CELLS)
    rising, falling = np.copysign(1.0, slope) * up, -np.copysign(1.0, slope) * down
    mean, unlike = 0.5 * (rising + falling), rising - falling
    bend = 1.0 if driver == "displacement" else -1.0  # concave, or convex
    size = float(np.sqrt(np.mean(width**2)))
    left = np.hypot(_beside(width, ELLIPSE), 2.0 * np.sqrt(np.mean((middle - straight) ** 2)))
    rounded = size > 10.0 * error and left < 0.6 * _beside(width, PARABOLA)
    ends = np.diff(mean)[-2:].mean() * CELLS / max(abs(mean[-1] - mean[0]), NOTHING)
    widest = max(float(np.abs(width).max()), NOTHING)
    return LoopShape(
        driver,
        slope,
        correlation,
        work=bend * float(_work(parts)),
        work_error=work_error,
        convexity=_hull_gap(bend * mean),
        asymmetry=float(np.std(unlike)),
        end_slope=float(ends if driver == "displacement" else 1.0 / max(ends, NOTHING)),
        roundness=float(left / size) if rounded else 1.0,
        waist=float(np.abs(width[CELLS // 2 - 1 : CELLS // 2 + 1]).mean()) / widest,
        error=error,
        drift=drift,
    )


def _beside(width: Floats, form: Floats) -> float:
    """Root mean square that the best multiple of a form leaves of a width."""
    return float(np.sqrt(np.mean((width - form * (width @ form) / (form @ form)) ** 2)))


def _hull_gap(branch: Floats) -> float:
    """Largest distance of a branch (cells,) below its concave hull."""
    hull = [0]
    for i in range(1, branch.size):
        while len(hull) > 1:
            a, b = hull[-2:]
            if (branch[b] - branch[a]) * (i - a) <= (branch[i] - branch[a]) * (b - a):
                hull.pop()
            else:
                break
        hull.append(i)
    return float(np.max(np.interp(np.arange(branch.size), hull, branch[hull]) - branch))

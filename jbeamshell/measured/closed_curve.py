"""Closed curve of straight pieces: least squares of the response over the phase of a cycle."""

from __future__ import annotations

import numpy as np

from jbeamshell.measured.reversals import Floats
from jbeamshell.measured.splitting import Cycle, Cycles

PARTS = 16  # parts of a loop whose means are compared
FEWEST_KNOTS = 8  # knots of a branch
# Stiffness against kinks, per sample at a knot.  It bridges gaps; and with this value the heights
# of white noise scatter like independent means of the samples around each knot.
STIFFNESS = 0.02


class ClosedCurve:
    """Closed loop of straight pieces, fitted to samples by least squares.

    The phase runs along the loop in proportion to the driving column: from 0 at the high turn down
    to 1 at the low turn, and up again to 2.

    Parameters
    ----------
    phase : (samples,) phases of the samples of all cycles
    knots : number of knots of each branch
    """

    def __init__(self, phase: Floats, knots: int) -> None:
        # Half evenly spaced, half by the samples' density: no cell is empty or far too full.
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
        """Heights at the knots (size,) that fit values (samples,) at their phases best."""
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
        """Curve with heights (size,) at the knots, evaluated at phases of any shape."""
        return np.interp(phase, self.knots, np.append(heights, heights[0]))

    def parts(self, heights: Floats) -> Floats:
        """Means (PARTS,) over equal parts of the loop."""
        fine = (np.arange(PARTS * 16) + 0.5) * 2.0 / (PARTS * 16)
        return self.at(fine, heights).reshape(PARTS, -1).mean(axis=1)


def phases_of(found: Cycles, cycle: Cycle) -> tuple[np.ndarray, Floats]:
    """Indices (samples,) of the points of a cycle without its back-slips, and their phases."""
    points, phases = [], []
    start, middle, end = cycle.levels
    branches = (cycle.start, cycle.turn, start, middle), (cycle.turn, cycle.end, middle, end)
    for first, last, here, there in branches:
        way = (found.path[first:last] - here) / (there - here)  # from 0 to 1, rising or falling
        slack = 4.0 * found.noise / abs(there - here)
        ahead = way >= np.maximum.accumulate(way) - slack
        rising = there > here
        points.append(first + np.flatnonzero(ahead))
        phases.append(float(rising) + np.clip(way[ahead], 0.0, 1.0))
    return np.concatenate(points), np.concatenate(phases)

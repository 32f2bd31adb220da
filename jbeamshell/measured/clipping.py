"""Clipped columns: a sensor or an amplifier at the end of its range."""

from __future__ import annotations

import numpy as np

from jbeamshell.measured.reversals import Floats, noise_of

SHORTEST = 4  # samples at the limit
COARSE = 0.1  # largest step of a converter over the range
BESIDE = 0.02  # part of the other column's range that it moves to and fro meanwhile


def clipped(column: Floats, other: Floats) -> float | None:
    """Limit at which a column is clipped; None if it is not.

    A column is clipped if it stays at its largest or smallest value while the other column moves
    up to a turn and back again.  One that slides leaves its plateau at the turn, and one that
    sticks begins it there.

    Parameters
    ----------
    column, other : (points,) force and displacement, or displacement and force
    """
    steps = BESIDE + 3.0 * max(_step(column), _step(other))
    least = steps * float(np.ptp(other)) + 6.0 * noise_of(other)
    for limit in (float(np.max(column)), float(np.min(column))):
        at = np.concatenate([[False], np.abs(column - limit) <= 1e-9 * np.ptp(column), [False]])
        begins, ends = np.flatnonzero(np.diff(at.astype(int))).reshape(-1, 2).T
        for begin, end in zip(begins, ends, strict=True):
            run = other[begin:end]
            if run.size < SHORTEST:
                continue
            for turn in (int(np.argmax(run)), int(np.argmin(run))):
                if min(abs(run[turn] - run[0]), abs(run[turn] - run[-1])) > least:
                    return limit
    return None


def _step(column: Floats) -> float:
    """Smallest step of a column over its range: that of the converter, if it is coarse."""
    moved = np.abs(np.diff(column))
    return min(float(np.min(moved[moved > 0.0])) / float(np.ptp(column)), COARSE)

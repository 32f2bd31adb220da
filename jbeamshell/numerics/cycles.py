"""Closed cycles of a load path, and the work along their branches."""

from __future__ import annotations

import numpy as np
from jax import Array

from jbeamshell.common.numbers_of import numbers_of


def branch_work(force: Array, displacement: Array) -> Array:
    """Integral of F du along a smooth branch, exact where both are parabolas of the step number.

    Parameters
    ----------
    force, displacement : (steps+1,) along the branch; with an odd number of steps the last one is
        taken as straight
    """
    even = 2 * ((force.shape[0] - 1) // 2)
    f, u = force[: even + 1], displacement[: even + 1]
    f0, f1, f2, u0, u1, u2 = f[:-2:2], f[1::2], f[2::2], u[:-2:2], u[1::2], u[2::2]
    at0, at1, at2 = -1.5 * u0 + 2.0 * u1 - 0.5 * u2, 0.5 * (u2 - u0), 0.5 * u0 - 2.0 * u1 + 1.5 * u2
    # Simpson's rule on F du/dstep.
    work = numbers_of(force).sum(f0 * at0 + 4.0 * f1 * at1 + f2 * at2) / 3.0
    if even + 1 < force.shape[0]:
        work = work + 0.5 * (force[-2] + force[-1]) * (displacement[-1] - displacement[-2])
    return work


def turning_points(path: np.ndarray) -> list[int]:
    """Indices of the start, the reversals and the end of a load path (steps,)."""
    moves = np.flatnonzero(np.diff(path)) + 1
    signs = np.sign(path[moves] - path[moves - 1])
    turns = moves[:-1][signs[1:] != signs[:-1]] if moves.size else []
    return [0, *map(int, turns), len(path) - 1]


def closed_cycles(path: np.ndarray) -> tuple[tuple[int, int, int], ...]:
    """Cycles (start, turn, end) of a load path (steps,) that return to the load at their start."""
    turns = turning_points(path)
    close = 1e-6 * np.ptp(path)
    cycles, i = [], 0
    while i + 2 < len(turns):
        a, b, c = turns[i : i + 3]
        if abs(path[c] - path[a]) <= close:
            cycles.append((a, b, c))
            i += 2
        else:
            i += 1
    return tuple(cycles)

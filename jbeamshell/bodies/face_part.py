"""Newton's step on the part of a face on which points slide or open.

With C the bodies whose points stick, R the slopes of the contact law (`face_law.slip_slopes`) and r
the force out of balance, the force that the slip adds on the nodes is

    (1 - Q C) d = r,    Q = B' k R B.

Its rows are those of the unit matrix where nothing slides, so that it is solved for on the others
alone: by factors where they are few, else by GMRES (Saad and Schultz 1986), because the waves of a
face have much the same stiffness.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
import scipy.sparse
from jax import Array, lax
from numpy.typing import NDArray
from scipy.linalg import lapack

from jbeamshell.bodies.face import Face, Sticking
from jbeamshell.common.numbers_of import numbers_of

PARTS = np.array([4, 8, 16]) / 16  # of the face, each of which has a program
LEAST = 24  # displacements, below which a part is not worth its program
MANY = 500  # displacements, from which on iterations take less time than factors
FINEST = 1e-5  # error of iterations: the flexibility of large parts has half of the digits
MOST = 150  # iterations, after which factors are taken

Vector = NDArray[np.float64]


def part_of_step(
    face: Face, slopes: Array, right: Array, sticking: Sticking, driven: Array, rough: Array
) -> Array:
    """Force d (N,) on the nodes.

    Parameters
    ----------
    face : bodies and points
    slopes : (q, 3, 3) R
    right : (N,) r
    sticking : bodies whose points stick
    driven : True where the load is held in place
    rough : error over r at which iterations may end
    """
    slopes = face.points.stiffness[:, :, None] * slopes
    if numbers_of(right) is np:
        away = 1.0 / float(sticking.soft) if driven else 0.0
        found: Array = _by_numpy(face, slopes, right, sticking, away, float(rough))
        return found
    return _in_programs(face, slopes, right, sticking, driven)


def _by_numpy(
    face: Face, slopes: Any, right: Any, sticking: Sticking, away: float, rough: float
) -> Any:
    """Force on the nodes; ``away`` is that of the load per displacement, where it is held."""
    groups = np.flatnonzero(slopes.reshape(len(face.shares), -1).any(axis=1))
    places: Any = face.places[groups]
    slopes = slopes.reshape(len(face.shares), -1, 3, 3)[groups].reshape(-1, 3, 3)
    blocks: Any = face._replace(shares=face.shares[groups]).blocks(slopes)
    changed = right != 0.0
    changed[places[blocks.any(axis=2)]] = True
    beside = np.zeros(right.size, bool)
    beside[places[blocks.any(axis=1)]] = True
    assert sticking.memory is not None
    rows, columns, flexible = sticking.memory.part(changed, beside)
    place = np.zeros((2, right.size), int)
    place[0, rows], place[1, columns] = np.arange(rows.size), np.arange(columns.size)
    softer = _by_rows(blocks, place[0, places], place[1, places], (rows.size, columns.size))
    here, there = sticking.pulled[rows], away * sticking.pulled[columns]

    def apply(force: Vector) -> Vector:
        moved = flexible @ force.astype(flexible.dtype)
        if away:
            moved -= there * (here @ force)
        return force - softer @ moved

    found = np.zeros(right.size)
    if rows.size >= MANY:
        solved, close = _gmres(apply, right[rows], max(rough, FINEST))
        if close:
            found[rows] = solved
            return found
    matrix = softer @ (flexible - np.outer(there, here) if away else flexible)
    np.negative(matrix, out=matrix)
    np.fill_diagonal(matrix, np.diagonal(matrix) + 1.0)
    factors, pivots, failed = lapack.dgetrf(matrix.T, overwrite_a=1)
    found[rows] = np.nan if failed else lapack.dgetrs(factors, pivots, right[rows], trans=1)[0]
    return found


def _by_rows(blocks: Vector, rows: Any, columns: Any, shape: tuple[int, int]) -> Any:
    """Sparse sum of blocks (g, n, n) at rows and columns (g, n)."""
    every = np.broadcast_to(rows[:, :, None], blocks.shape).ravel()
    order = np.argsort(every, kind="stable")
    begins = np.append(0, np.cumsum(np.bincount(every, minlength=shape[0])))
    indices = np.broadcast_to(columns[:, None], blocks.shape).ravel()[order]
    return scipy.sparse.csr_array((blocks.ravel()[order], indices, begins), shape)


def _gmres(apply: Callable[[Vector], Vector], right: Vector, rough: float) -> tuple[Vector, bool]:
    """Solution of a linear system to an error over its right side, and True if it was found."""
    size = float(np.linalg.norm(right))
    basis, upper = np.empty((MOST + 1, right.size)), np.zeros((MOST, MOST))
    turns: list[tuple[float, float]] = []
    left = [size]
    np.divide(right, size, out=basis[0])
    for k in range(MOST):
        new, known = apply(basis[k]), basis[: k + 1]
        along = known @ new
        new -= along @ known
        again = known @ new  # what rounding has left
        new -= again @ known
        length = math.sqrt(new @ new)
        column = (along + again).tolist()
        for i, (c, s) in enumerate(turns):
            a, b = column[i : i + 2]
            column[i], column[i + 1] = c * a + s * b, c * b - s * a
        root = math.hypot(column[k], length)
        if not root > 0.0:
            break
        c, s = column[k] / root, length / root
        column[k] = root
        upper[: k + 1, k] = column
        turns.append((c, s))
        left[k:] = c * left[k], -s * left[k]
        if abs(left[k + 1]) <= rough * size:
            return np.linalg.solve(upper[: k + 1, : k + 1], left[: k + 1]) @ known, True
        np.divide(new, length, out=basis[k + 1])
    return right, False


def _in_programs(
    face: Face, slopes: Array, right: Array, sticking: Sticking, driven: Array
) -> Array:
    """The same on the least of some parts of the face, each of which has its program."""
    size, blocks, places = right.size, face.blocks(slopes), face.places
    counts = sorted({n for part in PARTS if (n := math.ceil(size * part)) >= LEAST or n == size})
    slides = jnp.any(blocks != 0.0, axis=(1, 2))
    near = (right != 0.0).at[places].max(slides[:, None])
    order = jnp.argsort(~near, stable=True)
    place = jnp.zeros(size, int).at[order].set(np.arange(size))[places]
    where = place[:, :, None], place[:, None, :]
    away = jnp.where(driven, 1.0 / sticking.soft, 0.0)

    def on_part(count: int) -> Array:
        part = order[:count]
        softer = jnp.zeros((count, count)).at[where].add(blocks, mode="drop")
        flexible, pulled = sticking.inverse[part[:, None], part], sticking.pulled[part]
        flexible -= away * pulled[:, None] * pulled
        matrix = jnp.eye(count) - softer @ flexible
        return jnp.zeros(size).at[part].set(jnp.linalg.solve(matrix, right[part]))

    branch = jnp.searchsorted(np.array(counts), jnp.sum(near))
    found: Array = lax.switch(branch, [lambda count=count: on_part(count) for count in counts])
    return found

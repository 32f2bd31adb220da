"""Linear algebra of residuals that couple only neighbouring blocks.  No physics."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax


class BlockTridiagonal(NamedTuple):
    """A matrix of n x n blocks of size m x m, zero beyond the first off-diagonals.

    Attributes
    ----------
    lower, diagonal, upper : (n, m, m) blocks of row i in columns i-1, i and i+1; lower[0] and
        upper[-1] are zero
    """

    lower: Array
    diagonal: Array
    upper: Array

    @property
    def transpose(self) -> BlockTridiagonal:
        """The transposed matrix."""
        lower, diagonal, upper = (jnp.swapaxes(blocks, 1, 2) for blocks in self)
        return BlockTridiagonal(jnp.roll(upper, 1, axis=0), diagonal, jnp.roll(lower, -1, axis=0))


def jacobian(linear: Callable[[Array], Array], like: Array) -> BlockTridiagonal:
    """The matrix of a linear map between (n, m) arrays that couples only neighbouring rows.

    Every third row is probed at once, so it costs 3 m applications whatever n is.
    """
    n, m = like.shape
    colour = np.arange(n) % 3
    seeds = (colour[None, :, None, None] == np.arange(3)[:, None, None, None]) * np.eye(m)
    # (3, m, n, m): colour of the probed rows, probed column; then the response.
    seeds = jnp.asarray(np.moveaxis(seeds, 3, 1), like.dtype)
    response = jax.vmap(jax.vmap(linear))(seeds)
    row = np.arange(n)
    lower, diagonal, upper = (
        jnp.swapaxes(response[(colour + shift) % 3, :, row, :], 1, 2) for shift in (-1, 0, 1)
    )
    return BlockTridiagonal(lower.at[0].set(0.0), diagonal, upper.at[-1].set(0.0))


def solve(matrix: BlockTridiagonal, rhs: Array) -> Array:
    """Solve matrix x = rhs, (n, m), by block elimination without pivoting.

    The residuals of this package have diagonal blocks that dominate or are positive definite.
    """
    m = rhs.shape[1]

    def eliminate(above: Array, row: tuple[Array, ...]) -> tuple[Array, Array]:
        lower, diagonal, upper, b = row
        seen = _product(lower, above)  # of the row above: [its upper block, its right-hand side]
        pivot, right = diagonal - seen[:, :m], b - seen[:, m]
        solved = _gauss_jordan(jnp.concatenate([pivot, upper, right[:, None]], axis=1))
        return solved, solved

    def substitute(below: Array, row: Array) -> tuple[Array, Array]:
        x = row[:, m] - jnp.sum(row[:, :m] * below, axis=1)
        return x, x

    _, rows = lax.scan(eliminate, jnp.zeros((m, m + 1), rhs.dtype), (*matrix, rhs))
    _, x = lax.scan(substitute, jnp.zeros(m, rhs.dtype), rows, reverse=True)
    return x


def linear_solve(linear: Callable[[Array], Array], rhs: Array) -> Array:
    """Solve linear(x) = rhs for a map that couples only neighbouring rows; transposable in rhs."""
    matrix = jacobian(linear, rhs)
    return lax.custom_linear_solve(
        linear,
        rhs,
        solve=lambda _, b: solve(matrix, b),
        transpose_solve=lambda _, b: solve(matrix.transpose, b),
    )


def _product(a: Array, b: Array) -> Array:
    """Matrix product of small blocks, as arithmetic that fuses instead of a library call."""
    return jnp.sum(a[:, :, None] * b[None, :, :], axis=1)


def _gauss_jordan(augmented: Array) -> Array:
    """Columns x of [a, b] reduced to [1, x] for a block (m, m + columns), without pivoting."""
    m = augmented.shape[0]
    for k in range(m):
        row = augmented[k] / augmented[k, k]
        augmented = (augmented - augmented[:, k : k + 1] * row).at[k].set(row)
    return augmented[:, m:]

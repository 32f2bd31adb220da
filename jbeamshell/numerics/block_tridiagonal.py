"""Linear algebra of block-tridiagonal matrices.  No physics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

SMALL = 4  # largest size of blocks solved entry by entry; compiling time grows with its cube


class BlockTridiagonal(NamedTuple):
    """Matrix of n x n blocks of size m x m, zero beyond the first off-diagonals.

    Attributes
    ----------
    lower, diagonal, upper : (m, m, n) entries of the blocks of row i in columns i-1, i and i+1;
        lower[..., 0] and upper[..., -1] are zero
    """

    lower: Array
    diagonal: Array
    upper: Array

    @property
    def transpose(self) -> BlockTridiagonal:
        """Transposed matrix."""
        lower, diagonal, upper = (jnp.swapaxes(blocks, 0, 1) for blocks in self)
        return BlockTridiagonal(jnp.roll(upper, 1, axis=-1), diagonal, jnp.roll(lower, -1, axis=-1))


def jacobian(linear: Callable[[Array], Array], like: Array) -> BlockTridiagonal:
    """Matrix of a linear map between (n, m) arrays that couples only neighbouring rows.

    Every third row is probed at once, so it costs 3 m applications for any n.

    Parameters
    ----------
    linear : linear map from (n, m) to (n, m)
    like : (n, m) array with the shape and type of its argument
    """
    response = jax.vmap(jax.vmap(linear))(jnp.asarray(seeds(like)))
    columns = by_neighbour(response, np.arange(like.shape[0]))
    lower, diagonal, upper = jnp.moveaxis(columns, (1, 2), (2, 3))
    return BlockTridiagonal(lower.at[..., 0].set(0.0), diagonal, upper.at[..., -1].set(0.0))


def seeds(like: Array) -> np.ndarray:
    """Probes (3, m, n, m) of an (n, m) array: a unit in every third row, for each column."""
    n, m = like.shape
    colour = np.arange(n) % 3
    units = (colour[None, :, None, None] == np.arange(3)[:, None, None, None]) * np.eye(m)
    return np.moveaxis(units, 3, 1).astype(like.dtype)


def by_neighbour(response: ArrayLike, rows: np.ndarray) -> Array:
    """Sort responses to the probes by the row of the unit: the row before, the same, the next.

    Parameters
    ----------
    response : (3, m, k, ...) responses of k items to `seeds`
    rows : (k,) row to which each item belongs

    Returns
    -------
    (3, m, k, ...) responses to a unit in the row before, in the same row and in the next
    """
    response = jnp.asarray(response)
    colour = (rows % 3).reshape(1, -1, *[1] * (response.ndim - 3))

    def shifted(by: int) -> Array:  # a selection is vectorised by the compiler, a gather is not
        first, second, third = (response[(c + by) % 3] for c in range(3))
        return jnp.where(colour == 0, first, jnp.where(colour == 1, second, third))

    return jnp.stack([shifted(-1), shifted(0), shifted(1)])


def solve(matrix: BlockTridiagonal, rhs: Array) -> Array:
    """Solve matrix x = rhs, (n, m), by block elimination without pivoting.

    It is stable for diagonal blocks that dominate or are positive definite, as in this package.
    """
    m = rhs.shape[1]
    if m > SMALL:
        return _solve_blocks(matrix, rhs)
    entries = [[[blocks[i, j] for j in range(m)] for i in range(m)] for blocks in matrix]
    return jnp.stack(_solve_entries(entries, [rhs[:, i] for i in range(m)]), axis=1)


def _solve_entries(matrix: Sequence, rhs: Sequence[Array]) -> list[Array]:
    """Solve matrix x = rhs by block elimination with every entry of a block as a scalar.

    It is twice as fast as with whole blocks if the compiler makes the loop one function.

    Parameters
    ----------
    matrix : lower, diagonal and upper blocks, m x m entries (n,) each
    rhs : m entries (n,)

    Returns
    -------
    m entries (n,) of x
    """
    m = len(rhs)

    def eliminate(above: list, row: tuple) -> tuple[list, list]:
        lower, diagonal, upper, right = row
        # Product of the lower block with [upper block, right-hand side] of the row above.
        seen = [[_dot(low, column) for column in zip(*above, strict=True)] for low in lower]
        pivot = [[diagonal[i][j] - seen[i][j] for j in range(m)] for i in range(m)]
        left = [r - each[m] for r, each in zip(right, seen, strict=True)]
        known = [[*u, b] for u, b in zip(upper, left, strict=True)]
        solved = _divided(pivot, known)
        return solved, solved

    def substitute(below: list, row: list) -> tuple[list, list]:
        x = [each[m] - _dot(each[:m], below) for each in row]
        return x, x

    zero = jnp.zeros_like(rhs[0][0])
    _, rows = lax.scan(eliminate, [[zero] * (m + 1)] * m, (*matrix, list(rhs)))
    return list(lax.scan(substitute, [zero] * m, rows, reverse=True)[1])


def _divided(pivot: list[list[Array]], known: list[list[Array]]) -> list[list[Array]]:
    """Inverse of a small block times some columns, entry by entry."""
    m = len(pivot)
    if m == 3:  # cofactors have the shortest chain of operations
        pairs = [(1, 2), (2, 0), (0, 1)]
        cofactors = [
            [pivot[i][k] * pivot[j][n] - pivot[i][n] * pivot[j][k] for k, n in pairs]
            for i, j in pairs
        ]
        scale = 1.0 / _dot(pivot[0], cofactors[0])
        inverse = [[c * scale for c in column] for column in zip(*cofactors, strict=True)]
        columns = list(zip(*known, strict=True))
        return [[_dot(row, column) for column in columns] for row in inverse]
    return divided(pivot, known)


def divided(pivot: Sequence[Sequence[Array]], known: Sequence[Sequence[Array]]) -> list:
    """Inverse of a block times some columns, by Gauss-Jordan elimination without pivoting.

    Parameters
    ----------
    pivot : m x m entries, arrays of one shape
    known : m rows of any number of columns, arrays of that shape
    """
    m = len(pivot)
    rows = [[*p, *k] for p, k in zip(pivot, known, strict=True)]
    for k in range(m):
        scale = 1.0 / rows[k][k]
        rows[k] = [a * scale for a in rows[k]]
        for i in set(range(m)) - {k}:
            factor = rows[i][k]
            rows[i] = [a - factor * b for a, b in zip(rows[i], rows[k], strict=True)]
    return [row[m:] for row in rows]


def _dot(a: Sequence[Array], b: Sequence[Array]) -> Array:
    """Sum of products."""
    return sum((x * y for x, y in zip(a[1:], b[1:], strict=True)), a[0] * b[0])


def _solve_blocks(matrix: BlockTridiagonal, rhs: Array) -> Array:
    """Solve matrix x = rhs with whole blocks."""
    m = rhs.shape[1]

    def eliminate(above: Array, row: tuple[Array, ...]) -> tuple[Array, Array]:
        lower, diagonal, upper, b = row
        seen = _product(lower, above)  # above: [upper block, right-hand side] of the row above
        pivot, right = diagonal - seen[:, :m], b - seen[:, m]
        solved = gauss_jordan(jnp.concatenate([pivot, upper, right[:, None]], axis=1))
        return solved, solved

    def substitute(below: Array, row: Array) -> tuple[Array, Array]:
        x = row[:, m] - jnp.sum(row[:, :m] * below, axis=1)
        return x, x

    blocks = (jnp.moveaxis(entries, -1, 0) for entries in matrix)
    _, rows = lax.scan(eliminate, jnp.zeros((m, m + 1), rhs.dtype), (*blocks, rhs))
    _, x = lax.scan(substitute, jnp.zeros(m, rhs.dtype), rows, reverse=True)
    return x


def linear_solve(linear: Callable[[Array], Array], rhs: Array) -> Array:
    """Solve linear(x) = rhs, (n, m), for a map that couples only neighbouring rows.

    Derivatives with respect to the right-hand side pass in both directions.
    """
    matrix = jacobian(linear, rhs)
    return lax.custom_linear_solve(
        linear,
        rhs,
        solve=lambda _, b: _solve_blocks(matrix, b),
        transpose_solve=lambda _, b: _solve_blocks(matrix.transpose, b),
    )


def _product(a: Array, b: Array) -> Array:
    """Matrix product of small blocks, as arithmetic that the compiler fuses."""
    return jnp.sum(a[:, :, None] * b[None, :, :], axis=1)


def gauss_jordan(augmented: Array) -> Array:
    """Columns x of a block [a, b], (m, m + columns), that is reduced to [1, x] without pivoting."""
    m = augmented.shape[0]
    for k in range(m):
        row = augmented[k] / augmented[k, k]
        augmented = (augmented - augmented[:, k : k + 1] * row).at[k].set(row)
    return augmented[:, m:]


def inverse(block: Array) -> Array:
    """Inverse of a small block (m, m), without pivoting."""
    return gauss_jordan(
        jnp.concatenate([block, jnp.eye(block.shape[0], dtype=block.dtype)], axis=1)
    )

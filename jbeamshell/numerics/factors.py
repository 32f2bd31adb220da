"""Triangular factors of small dense matrices, one after the other in a batch.

XLA factorises and solves batches of matrices on several threads at once, which wait for each other
for ever where a loop holds several such batches (jaxlib 0.10, two threads).  Under `jax.vmap` the
functions here take one matrix after the other.  Their slopes are products of matrices.

References
----------
Murray, I. (2016). Differentiation of the Cholesky decomposition. arXiv 1602.07527.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.custom_batching import sequential_vmap
from scipy.linalg import lapack

from jbeamshell.common.numbers_of import numbers_of


def inverse_cholesky(matrix: Array) -> Array:
    """Inverse of the lower factor L of symmetric positive definite matrices L L' (..., n, n).

    NaN where a matrix is not positive definite.
    """
    if numbers_of(matrix) is jnp:
        found = _inverse_cholesky
        for _ in matrix.shape[:-2]:
            found = jax.vmap(found)
        return found(matrix)
    inverse: Any = np.empty_like(matrix)
    for place in np.ndindex(matrix.shape[:-2] if matrix.size else 0):  # LAPACK complains of none
        lower, failed = lapack.dpotrf(matrix[place], lower=1)
        inverse[place] = np.nan if failed else lapack.dtrtri(lower, lower=1)[0]
    return inverse


@jax.custom_jvp
def _inverse_cholesky(matrix: Array) -> Array:
    return _one_by_one(matrix)


@sequential_vmap
def _one_by_one(matrix: Array) -> Array:
    lower = lax.linalg.cholesky(matrix, symmetrize_input=False)
    one = jnp.eye(matrix.shape[0], dtype=matrix.dtype)
    return lax.linalg.triangular_solve(lower, one, left_side=False, lower=True)


@_inverse_cholesky.defjvp
def _inverse_cholesky_slope(matrix: tuple[Array], change: tuple[Array]) -> tuple[Array, Array]:
    inverse = _inverse_cholesky(*matrix)
    between = jnp.tril(inverse @ change[0] @ inverse.T)
    return inverse, -(between - 0.5 * jnp.diag(jnp.diag(between))) @ inverse


def solve(matrix: Array, sides: Array) -> Array:
    """Solution x of A x = b for a symmetric positive definite matrix (n, n) and b (n, ...)."""
    return solver(matrix)(sides)


def solver(matrix: Array) -> Callable[[Array], Array]:
    """Function of b (n, ...) that solves A x = b for a symmetric positive definite matrix (n, n).

    It gives NaN where the matrix is not definite.
    """
    if numbers_of(matrix) is jnp:
        inverse = inverse_cholesky(matrix)
        return lambda sides: inverse.T @ (inverse @ sides)
    lower, failed = lapack.dpotrf(matrix, lower=1)
    if failed:
        return lambda sides: np.full_like(sides, np.nan)  # type: ignore[return-value]
    return lambda sides: lapack.dpotrs(lower, sides, lower=1)[0].reshape(sides.shape)


def half_solved(matrix: Array, sides: Array) -> Array:
    """Solution of L x = b (n, k), L the lower factor of a symmetric positive definite matrix.

    NaN where the matrix is not definite.
    """
    if numbers_of(matrix, sides) is jnp:
        return inverse_cholesky(matrix) @ sides
    lower, failed = lapack.dpotrf(matrix, lower=1)
    found: Array = np.nan * sides if failed else lapack.dtrtrs(lower, sides, lower=1)[0]
    return found


def inverse(matrix: Array) -> Array:
    """Inverse of a symmetric positive definite matrix (n, n); NaN where it is not definite."""
    if numbers_of(matrix) is jnp:
        factor = inverse_cholesky(matrix)
        return factor.T @ factor
    lower, failed = lapack.dpotrf(matrix, lower=1)
    if failed:
        return np.full_like(matrix, np.nan)  # type: ignore[return-value]
    half = np.tril(lapack.dpotri(lower, lower=1, overwrite_c=1)[0])
    half += np.tril(half, -1).T
    return half

"""Triangular factors of small dense matrices, one after the other in a batch.

XLA factorises and solves batches of matrices on several threads at once, which wait for each other
for ever where a loop holds several such batches (jaxlib 0.10, two threads).  Under `jax.vmap` the
functions here take one matrix after the other.  Their slopes are products of matrices.

References
----------
Murray, I. (2016). Differentiation of the Cholesky decomposition. arXiv 1602.07527.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.custom_batching import sequential_vmap

SHRINK = 8  # powers of two from row to row of a matrix that is factorised without pivoting


class LowerUpper(NamedTuple):
    """Factors L (unit diagonal) and U of a matrix L U, (n, n) each, and what is made of them.

    Attributes
    ----------
    lower, upper : L and U
    reduced : (n, sides) L^-1 of the right-hand sides
    inverse_lower, inverse_upper : L^-1 and U^-1
    """

    lower: Array
    upper: Array
    reduced: Array
    inverse_lower: Array
    inverse_upper: Array


@jax.custom_jvp
def inverse_cholesky(matrix: Array) -> Array:
    """Inverse of the lower factor L of a symmetric positive definite matrix L L' (n, n).

    NaN where the matrix is not positive definite.
    """
    return _inverse_cholesky(matrix)


@sequential_vmap
def _inverse_cholesky(matrix: Array) -> Array:
    return _inverse_lower(lax.linalg.cholesky(matrix, symmetrize_input=False), False)


@inverse_cholesky.defjvp
def _inverse_cholesky_slope(matrix: tuple[Array], change: tuple[Array]) -> tuple[Array, Array]:
    inverse = inverse_cholesky(*matrix)
    between = jnp.tril(inverse @ change[0] @ inverse.T)
    return inverse, -(between - 0.5 * jnp.diag(jnp.diag(between))) @ inverse


def solve(matrix: Array, sides: Array) -> Array:
    """Solution x of A x = b for a symmetric positive definite matrix (n, n) and b (n, ...)."""
    inverse = inverse_cholesky(matrix)
    return inverse.T @ (inverse @ sides)


@jax.custom_jvp
def lower_upper(matrix: Array, sides: Array) -> LowerUpper:
    """Factors of a matrix (n, n) without pivoting, and right-hand sides (n, sides) reduced by them.

    NaN where a pivot is so small that rows would have to be exchanged.
    """
    return _lower_upper(matrix, sides)


@sequential_vmap
def _lower_upper(matrix: Array, sides: Array) -> LowerUpper:
    n = matrix.shape[0]
    # Rows that shrink by powers of two keep LAPACK from exchanging them, and cost no digits.
    scale = 2.0 ** (-min(SHRINK, 900 // n) * np.arange(n))
    block, _, order = lax.linalg.lu(jnp.concatenate([matrix, sides], axis=1) * scale[:, None])
    exchanged = jnp.where(jnp.all(order == np.arange(n)), 0.0, jnp.nan)
    one = jnp.eye(n, dtype=matrix.dtype)
    lower = jnp.tril(block[:, :n] * (scale / scale[:, None]), -1) + one + exchanged
    block = block / scale[:, None] + exchanged
    upper, reduced = jnp.triu(block[:, :n]), block[:, n:]
    inverse_upper = lax.linalg.triangular_solve(upper, one, left_side=False)
    return LowerUpper(lower, upper, reduced, _inverse_lower(lower, True), inverse_upper)


@lower_upper.defjvp
def _lower_upper_slope(
    inputs: tuple[Array, Array], change: tuple[Array, Array]
) -> tuple[LowerUpper, LowerUpper]:
    factors = lower_upper(*inputs)
    between = factors.inverse_lower @ change[0] @ factors.inverse_upper
    below, above = jnp.tril(between, -1), jnp.triu(between)
    return factors, LowerUpper(
        factors.lower @ below,
        above @ factors.upper,
        factors.inverse_lower @ change[1] - below @ factors.reduced,
        -below @ factors.inverse_lower,
        -factors.inverse_upper @ above,
    )


@sequential_vmap
def inverse_unit_lower(lower: Array) -> Array:
    """Inverse of a lower triangular matrix (n, n) with a unit diagonal; without slopes."""
    return _inverse_lower(lower, True)


def _inverse_lower(lower: Array, unit_diagonal: bool) -> Array:
    one = jnp.eye(lower.shape[0], dtype=lower.dtype)
    return lax.linalg.triangular_solve(
        lower, one, left_side=False, lower=True, unit_diagonal=unit_diagonal
    )

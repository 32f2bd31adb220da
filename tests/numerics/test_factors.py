"""Triangular factors: what they are of, their slopes, and batches of them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jbeamshell.numerics import factors

N = 40
RANDOM = np.random.default_rng(1)
MATRIX = jnp.asarray(np.eye(N) * 9.0 + RANDOM.uniform(-0.2, 0.2, (N, N)))
SIDES = jnp.asarray(RANDOM.uniform(-1.0, 1.0, (N, 3)))
CHANGE = jnp.asarray(RANDOM.uniform(-1.0, 1.0, (N, N)))
SYMMETRIC = MATRIX + MATRIX.T, CHANGE + CHANGE.T


def lower_upper(matrix):
    """Factors with right-hand sides that depend on the matrix too."""
    return factors.lower_upper(matrix, matrix[:, :3] @ SIDES[:3])


def test_lower_and_upper_factors_are_those_of_the_matrix():
    lower, upper, reduced, inverse_lower, inverse_upper = factors.lower_upper(MATRIX, SIDES)
    np.testing.assert_allclose(lower @ reduced, SIDES, atol=1e-12)
    np.testing.assert_allclose(lower @ upper, MATRIX, atol=1e-12)
    np.testing.assert_allclose(lower @ inverse_lower, np.eye(N), atol=1e-12)
    np.testing.assert_allclose(inverse_upper @ upper, np.eye(N), atol=1e-12)
    np.testing.assert_allclose(np.triu(lower, 1), 0.0)
    np.testing.assert_allclose(np.tril(upper, -1), 0.0)
    np.testing.assert_allclose(np.diag(lower), 1.0)


def test_a_matrix_whose_rows_must_be_exchanged_has_no_factors():
    assert jnp.all(jnp.isnan(factors.lower_upper(MATRIX.at[0, 0].set(1e-9), SIDES).lower))


def test_a_matrix_with_a_negative_mode_has_no_cholesky_factor():
    assert jnp.any(jnp.isnan(factors.inverse_cholesky(SYMMETRIC[0].at[3, 3].set(-1.0))))


def test_a_symmetric_matrix_is_solved():
    np.testing.assert_allclose(
        factors.solve(SYMMETRIC[0], SIDES), np.linalg.solve(SYMMETRIC[0], SIDES), rtol=1e-11
    )


@pytest.mark.parametrize(
    ("function", "matrix", "change"),
    [(lower_upper, MATRIX, CHANGE), (factors.inverse_cholesky, *SYMMETRIC)],
)
def test_slopes_are_those_of_differences_and_the_same_in_reverse(function, matrix, change):
    def flat(step):
        return jnp.concatenate([part.ravel() for part in jax.tree.leaves(function(step))])

    step = 1e-5
    differences = (flat(matrix + step * change) - flat(matrix - step * change)) / (2.0 * step)
    found, slopes = jax.jvp(flat, (matrix,), (change,))
    np.testing.assert_allclose(slopes, differences, atol=1e-8 * np.abs(differences).max())
    weights = jnp.cos(jnp.arange(found.size))
    back = jax.grad(lambda m: weights @ flat(m))(matrix)
    np.testing.assert_allclose(jnp.vdot(back, change), weights @ slopes, rtol=1e-10)


def test_a_batch_is_what_its_matrices_are():
    batch = jnp.stack([SYMMETRIC[0], 2.0 * SYMMETRIC[0]])

    def both(matrix):
        return factors.inverse_cholesky(matrix), lower_upper(matrix)

    together = jax.jit(jax.vmap(jax.grad(lambda m: sum(map(jnp.sum, jax.tree.leaves(both(m)))))))
    alone = [jax.grad(lambda m: sum(map(jnp.sum, jax.tree.leaves(both(m)))))(m) for m in batch]
    np.testing.assert_allclose(together(batch), alone, rtol=1e-12)

"""Triangular factors: what they are of, their slopes, and batches of them."""

import jax
import jax.numpy as jnp
import numpy as np

from jbeamshell.numerics import factors

N = 40
RANDOM = np.random.default_rng(1)
MATRIX = jnp.asarray(np.eye(N) * 9.0 + RANDOM.uniform(-0.2, 0.2, (N, N)))
SIDES = jnp.asarray(RANDOM.uniform(-1.0, 1.0, (N, 3)))
CHANGE = jnp.asarray(RANDOM.uniform(-1.0, 1.0, (N, N)))
SYMMETRIC = MATRIX + MATRIX.T, CHANGE + CHANGE.T


def test_a_matrix_with_a_negative_mode_has_no_cholesky_factor():
    assert jnp.any(jnp.isnan(factors.inverse_cholesky(SYMMETRIC[0].at[3, 3].set(-1.0))))


def test_a_symmetric_matrix_is_solved():
    np.testing.assert_allclose(
        factors.solve(SYMMETRIC[0], SIDES), np.linalg.solve(SYMMETRIC[0], SIDES), rtol=1e-11
    )


def test_slopes_are_those_of_differences_and_the_same_in_reverse():
    matrix, change = SYMMETRIC

    @jax.jit
    def flat(step):
        return factors.inverse_cholesky(step).ravel()

    step = 1e-5
    differences = (flat(matrix + step * change) - flat(matrix - step * change)) / (2.0 * step)
    found, slopes = jax.jvp(flat, (matrix,), (change,))
    np.testing.assert_allclose(slopes, differences, atol=1e-8 * np.abs(differences).max())
    weights = jnp.cos(jnp.arange(found.size))
    back = jax.jit(jax.grad(lambda m: weights @ flat(m)))(matrix)
    np.testing.assert_allclose(np.vdot(back, change), np.vdot(weights, slopes), rtol=1e-10)


def test_a_batch_is_what_its_matrices_are():
    batch = jnp.stack([SYMMETRIC[0], 2.0 * SYMMETRIC[0]])

    def total(matrix):
        return jnp.sum(factors.inverse_cholesky(matrix))

    together = jax.jit(jax.vmap(jax.grad(total)))(batch)
    alone = jax.jit(jax.grad(total))
    np.testing.assert_allclose(together, [alone(m) for m in batch], rtol=1e-12)

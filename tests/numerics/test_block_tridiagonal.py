"""Block-tridiagonal matrices against dense ones."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jbeamshell.numerics.block_tridiagonal import BlockTridiagonal, jacobian, linear_solve, solve

SHAPES = [(6, 2), (7, 3), (5, 6)]  # of entries, of cofactors, of whole blocks
shapes = pytest.mark.parametrize(("n", "m"), SHAPES)


def matrix_of(n, m, seed=0):
    """A random matrix, diagonally dominant and not symmetric."""
    lower, diagonal, upper = np.random.default_rng(seed).normal(size=(3, m, m, n))
    lower[..., 0] = upper[..., -1] = 0
    dominant = diagonal + 4 * m * np.eye(m)[..., None]
    return BlockTridiagonal(*map(jnp.asarray, (lower, dominant, upper)))


def dense(matrix):
    lower, diagonal, upper = map(np.asarray, matrix)
    m, _, n = diagonal.shape
    full = np.zeros((n, m, n, m))
    for i in range(n):
        full[i, :, i] = diagonal[..., i]
        if i > 0:
            full[i, :, i - 1] = lower[..., i]
        if i < n - 1:
            full[i, :, i + 1] = upper[..., i]
    return full.reshape(n * m, n * m)


def apply(matrix, x):
    above, below = jnp.roll(x, 1, axis=0), jnp.roll(x, -1, axis=0)
    parts = zip(matrix, (above, x, below), strict=True)
    return sum(jnp.einsum("ijn,nj->ni", blocks, y) for blocks, y in parts)


def vector(n, m, seed=1):
    return jnp.asarray(np.random.default_rng(seed).normal(size=(n, m)))


@shapes
def test_jacobian_recovers_a_matrix_from_its_action(n, m):
    matrix = matrix_of(n, m)
    found = jax.jit(lambda zero: jacobian(lambda x: apply(matrix, x), zero))(np.zeros((n, m)))
    np.testing.assert_allclose(dense(found), dense(matrix), atol=1e-13)
    for got, blocks in zip(found, matrix, strict=True):
        np.testing.assert_allclose(got, blocks, atol=1e-13)


@shapes
def test_transpose(n, m):
    matrix = matrix_of(n, m)
    np.testing.assert_array_equal(dense(matrix.transpose), dense(matrix).T)
    assert not np.any(np.asarray(matrix.transpose.lower)[..., 0])
    assert not np.any(np.asarray(matrix.transpose.upper)[..., -1])


@shapes
def test_solve_is_the_dense_solution(n, m):
    matrix, rhs = matrix_of(n, m), vector(n, m)
    expected = np.linalg.solve(dense(matrix), rhs.ravel())
    found = np.asarray(jax.jit(solve)(matrix, rhs))
    np.testing.assert_allclose(found.ravel(), expected, rtol=1e-11, atol=1e-14)


def scaled_solve(scale, rhs):
    """Solve a system that depends on a parameter, knowing only its action."""
    matrix = matrix_of(*rhs.shape)
    return linear_solve(lambda x: apply(matrix, x) + scale * jnp.cos(scale) * x, rhs)


def test_linear_solve_and_its_derivatives():
    n, m = 8, 4
    rhs, d_rhs, out = vector(n, m), vector(n, m, 2), vector(n, m, 3)
    scale, d_scale = jnp.array(0.7), jnp.array(-1.3)
    x, dx = map(
        np.asarray,
        jax.jit(lambda *at: jax.jvp(scaled_solve, at[:2], at[2:]))(scale, rhs, d_scale, d_rhs),
    )

    full = dense(matrix_of(n, m)) + 0.7 * np.cos(0.7) * np.eye(n * m)
    np.testing.assert_allclose(full @ x.ravel(), rhs.ravel(), atol=1e-12)
    slope = (np.cos(0.7) - 0.7 * np.sin(0.7)) * -1.3
    right = np.ravel(d_rhs) - slope * x.ravel()
    np.testing.assert_allclose(full @ dx.ravel(), right, atol=1e-12)

    in_scale, in_rhs = jax.jit(lambda *at: jax.vjp(scaled_solve, *at)[1](out))(scale, rhs)
    transposed = float(in_scale) * float(d_scale) + np.vdot(in_rhs, d_rhs)
    np.testing.assert_allclose(np.vdot(out, dx), transposed, rtol=1e-12)


def test_linear_solve_in_a_batch():
    scales, sides = jnp.array([0.1, 0.9, 2.0]), jnp.stack([vector(8, 4, s) for s in (4, 5, 6)])
    batch = jax.jit(jax.vmap(scaled_solve))(scales, sides)
    alone = jax.jit(scaled_solve)
    for scale, rhs, x in zip(scales, sides, batch, strict=True):
        np.testing.assert_allclose(x, alone(scale, rhs), rtol=1e-12, atol=1e-15)

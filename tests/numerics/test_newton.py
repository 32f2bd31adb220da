"""Newton's method on residuals of a few numbers, with kinks like those of friction and contact."""

import jax.numpy as jnp
import pytest

from jbeamshell.numerics.block_tridiagonal import BlockTridiagonal
from jbeamshell.numerics.newton import Newton, Problem

JUMP = 4e-11  # residual that round-off leaves, below the tolerance of 1e-10


def row(matrix):
    """Matrix of a single row of blocks."""
    diagonal = jnp.asarray(matrix)[..., None]
    return BlockTridiagonal(jnp.zeros_like(diagonal), diagonal, jnp.zeros_like(diagonal))


def nearly_slipping(x):
    """Residual of a point at a kink: its tangent is steep on one side, nearly flat on the other.

    The steep side leads to the flat one, and from there a step goes far.
    """
    steep = x[0, 0] <= 0.0
    return jnp.where(steep, x - JUMP, x), steep


@pytest.mark.parametrize("start", [-1.0, 0.5 * JUMP, 1e-3])
def test_an_iterate_within_the_tolerance_is_kept_where_the_next_step_leads_far_off(start):
    problem = Problem(
        evaluate=nearly_slipping,
        limit=lambda old, new: new,
        tangent=lambda steep, slope: row(jnp.where(steep, slope, 1e-7 * slope)[None, None]),
        refresh=lambda *_: jnp.ones(()),
    )
    _, (iterations, error) = Newton().solve(problem, jnp.full((1, 1), start), jnp.ones(()))
    assert error <= 1e-10
    assert iterations < 20


def test_no_more_steps_are_tried_than_allowed():
    """The tangent is twice too stiff: every step halves the residual."""
    problem = Problem(
        evaluate=lambda x: (x, jnp.zeros(())),
        limit=lambda old, new: new,
        tangent=lambda _, slope: row(slope[None, None]),
        refresh=lambda *_: jnp.full((), 2.0),
    )
    found = Newton(max_iterations=5).solve(problem, jnp.ones((1, 1)), jnp.full((), 2.0))
    assert found[1] == (5, 0.5**5)

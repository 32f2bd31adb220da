"""Tests of small programs."""

import jax
import jax.numpy as jnp
import pytest

from jbeamshell.common.checks import is_staged
from jbeamshell.common.small import Small


@Small
def cubic(given: tuple[jax.Array, jax.Array], power: int) -> jax.Array:
    a, x = given
    return a * x**power


def test_a_small_program_goes_into_every_transformation():
    """Compiler options are for whole programs: inside a transformation there are none."""
    a, x = jnp.asarray(2.0), jnp.asarray(3.0)
    assert cubic((a, x), 3) == 54.0
    assert cubic((2.0, x), 3) == 54.0  # a plain number stays static
    assert jax.jit(lambda x: cubic((a, x), 3))(x) == 54.0
    assert jax.jit(lambda x: x + cubic((a, a), 3))(x) == 19.0
    assert jax.grad(lambda x: cubic((a, x), 3))(x) == 54.0
    assert jax.grad(lambda x: x * cubic((a, a), 3))(x) == 16.0
    assert jax.vmap(lambda x: cubic((a, x), 3))(jnp.stack([x, a])) == pytest.approx([54.0, 16.0])


def test_staged_is_what_jit_traces_even_where_no_number_is_traced():
    found = []

    def look(x):
        found.append(is_staged())
        return x

    look(1.0)
    jax.jit(look)(1.0)
    jax.grad(look)(1.0)
    jax.vmap(look)(jnp.ones(2))
    assert found == [False, True, False, False]

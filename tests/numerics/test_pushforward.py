"""Derivatives of a loop without reverse mode, by a function that says the same."""

import jax
import jax.numpy as jnp
import numpy as np
from jax.test_util import check_grads

from jbeamshell.numerics.pushforward import pushforward

TERMS = 12


def series(at, beside):
    """Sum of the first powers of x, weighted, and their last one."""
    x, weight = at
    powers = x ** jnp.arange(1, TERMS + 1)
    return {"sum": weight * jnp.sum(jnp.where(jnp.arange(TERMS) < beside, powers, 0.0))}


@jax.custom_jvp
def summed(x, weight, count):
    """The same sum by a loop that ends when it is done, which has no reverse derivative."""

    def go_on(state):
        return state[0] < count

    def add(state):
        done, power, total = state
        return done + 1, power * x, total + power * x

    return {"sum": weight * jax.lax.while_loop(go_on, add, (0, jnp.ones_like(x), 0.0 * x))[2]}


@summed.defjvp
def _along(given, changes):
    x, weight, count = given
    return summed(*given), pushforward(series, (x, weight), count, changes[:2])


def total(x, weight):
    return summed(x, weight, jnp.asarray(7))["sum"]


def test_derivatives_of_both_modes_are_those_of_differences():
    check_grads(jax.jit(total), (0.8, 1.3), order=1, modes=("fwd", "rev"))


def test_forward_and_reverse_are_transposes_in_batches_too():
    """Lanes of points, and tangents at one point, side by side."""
    x, weight = jnp.linspace(0.2, 0.9, 5), jnp.linspace(1.0, 2.0, 5)
    for over in (jax.jit(jax.vmap(total)),):
        known = jax.vmap(lambda x, weight: series((x, weight), 7)["sum"])
        both = (jax.jit(mode(over, (0, 1)))(x, weight) for mode in (jax.jacfwd, jax.jacrev))
        wanted = jax.jit(jax.jacfwd(known, (0, 1)))(x, weight)
        for found in both:
            for one, other in zip(found, wanted, strict=True):
                np.testing.assert_allclose(one, other, rtol=1e-12)


def test_a_constant_argument_has_no_part():
    slope = jax.grad(total, argnums=0)(0.8, 1.3)
    np.testing.assert_allclose(slope, 1.3 * sum(k * 0.8 ** (k - 1) for k in range(1, 8)))

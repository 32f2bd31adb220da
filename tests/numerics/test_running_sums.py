"""Tests of running sums."""

import jax
import jax.numpy as jnp
import numpy as np

from jbeamshell.numerics.running_sums import running_sums


def test_running_sums_are_those_of_cumsum():
    values = jax.random.normal(jax.random.key(0), (3, 2, 17))
    np.testing.assert_allclose(running_sums(values), jnp.cumsum(values, axis=-1), atol=1e-13)

"""Results that failed: NaN in values and in derivatives."""

import jax
import jax.numpy as jnp
import numpy as np

from jbeamshell.common.failed import nan_unless


def test_values_and_derivatives_are_nan_where_they_failed():
    sound, values = jnp.array([True, False, True]), {"a": jnp.ones((3, 2)), "b": jnp.ones(3)}
    found = nan_unless(sound, values)
    for part in found.values():
        np.testing.assert_array_equal(np.isnan(part.reshape(3, -1)).all(axis=1), ~sound)
        np.testing.assert_array_equal(part[::2], 1.0)
    for way in (jax.jacfwd, jax.jacrev):
        slopes = np.diagonal(way(lambda b: nan_unless(sound, b))(values["b"]))
        np.testing.assert_array_equal(slopes, [1.0, np.nan, 1.0])

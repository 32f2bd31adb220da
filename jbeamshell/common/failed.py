"""Results that failed, as numbers that nobody takes for a result."""

from __future__ import annotations

from typing import TypeVar

import jax
import jax.numpy as jnp
from jax import Array

T = TypeVar("T")


def nan_unless(sound: Array, values: T) -> T:
    """Values with NaN where they are not sound, and their derivatives too.

    With `jnp.where` the derivatives would be zero there, which is a plausible number.

    Parameters
    ----------
    sound : (...) True where the values hold
    values : pytree of arrays (..., any) of floating-point numbers
    """
    factor = jnp.where(sound, 1.0, jnp.nan)

    def masked(value: Array) -> Array:
        shape = *factor.shape, *[1] * (value.ndim - factor.ndim)
        return value * factor.reshape(shape).astype(value.dtype)

    found: T = jax.tree.map(masked, values)
    return found

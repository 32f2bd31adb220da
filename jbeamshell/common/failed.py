"""Results that failed, as numbers that nobody takes for a result."""

from __future__ import annotations

from typing import TypeVar

import jax
from jax import Array

from jbeamshell.common.numbers_of import numbers_of

T = TypeVar("T")


def nan_unless(sound: Array, values: T) -> T:
    """Values with NaN where they are not sound, and their derivatives too.

    With ``where`` the derivatives would be zero there, which is a plausible number.

    Parameters
    ----------
    sound : (...) True where the values hold
    values : pytree of arrays (..., any) of floating-point numbers
    """
    numbers = numbers_of(sound)
    factor = numbers.where(sound, 1.0, numbers.nan)

    def masked(value: Array) -> Array:
        shape = *factor.shape, *[1] * (value.ndim - factor.ndim)
        return value * factor.reshape(shape).astype(value.dtype)

    found: T = jax.tree.map(masked, values)
    return found

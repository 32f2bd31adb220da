"""NumPy or JAX's, by the arrays that are given."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import jax.numpy as jnp
import numpy as np

P = ParamSpec("P")
R = TypeVar("R")


def numbers_of(array: object) -> Any:
    """NumPy for its arrays, which compile nothing, and `jax.numpy` for those of JAX."""
    return np if isinstance(array, np.ndarray | np.generic) else jnp


def quiet(function: Callable[P, R]) -> Callable[P, R]:
    """Function in which NumPy does not warn of overflow and of 0/0, as JAX does not."""
    return np.errstate(all="ignore")(function)

"""NumPy or JAX's, by the arrays that are given."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np


def numbers_of(array: object) -> Any:
    """NumPy for its arrays, which compile nothing, and `jax.numpy` for those of JAX."""
    return np if isinstance(array, np.ndarray | np.generic) else jnp

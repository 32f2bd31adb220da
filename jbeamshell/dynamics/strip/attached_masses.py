"""What rides on the loaded end: a payload, and a chain of masses on springs behind it."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import numpy as np
from jax import Array

from jbeamshell.common.checks import NOT_NEGATIVE, TINY, as_leaf, require, require_number

CHAIN = "give as many positive numbers as there are masses in the chain"


class AttachedMasses(eqx.Module):
    """A linear structure at the loaded end, moving along X; per unit width.

    Attributes
    ----------
    payload : mass that moves with u(L); 0 is none
    masses : (k,) of a chain: the first is held by a spring to u(L), the others to the one before
    springs : (k,) stiffnesses of those springs
    dampers : (k,) dashpots beside them; none are all 0
    """

    payload: Array
    masses: Array
    springs: Array
    dampers: Array

    def __init__(
        self, payload: Any = 0.0, masses: Any = (), springs: Any = (), dampers: Any = None
    ) -> None:
        self.payload = as_leaf(payload, "attached.payload")
        self.masses = as_leaf(list(masses), "attached.masses", CHAIN)
        self.springs = as_leaf(list(springs), "attached.springs", CHAIN)
        own = np.zeros(self.masses.shape) if dampers is None else list(dampers)
        self.dampers = as_leaf(own, "attached.dampers", CHAIN)

    def __check_init__(self) -> None:
        require_number("attached.payload", self.payload, NOT_NEGATIVE, low=-TINY)
        require("attached.masses", self.masses, self.masses.ndim == 1, CHAIN)
        for name, least in (("masses", 0.0), ("springs", 0.0), ("dampers", -TINY)):
            values = getattr(self, name)
            require(f"attached.{name}", values, values.shape == self.masses.shape, CHAIN)
            if not isinstance(values, jax.core.Tracer):
                known = np.asarray(values)
                sound = bool(np.all(np.isfinite(known) & (known > least)))
                require(f"attached.{name}", values, sound, CHAIN)

    @property
    def count(self) -> int:
        """Number of masses in the chain."""
        return int(self.masses.size)

"""Masses attached to the loaded end: a payload, and a chain of masses on springs behind it."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import numpy as np
from jax import Array

from jbeamshell.common.checks import NOT_NEGATIVE, TINY, as_leaf, require, require_number

CHAIN = "give as many positive numbers as there are masses in the chain"


class AttachedMasses(eqx.Module):
    """Linear masses and springs at the loaded end, which move along X; all per unit width.

    Attributes
    ----------
    payload : mass that moves with u(L); 0 is none
    masses : (k,) masses of a chain.  A spring joins the first one to the loaded end, and each other
        one to the mass before it
    springs : (k,) stiffnesses of these springs
    dampers : (k,) viscous damping coefficients of dashpots beside the springs; None is 0

    Raises
    ------
    InputError
        for a negative payload, or a chain whose arrays differ in length or are not positive

    Examples
    --------
    >>> AttachedMasses(payload=20.0, masses=[1.0, 2.0], springs=[500.0, 300.0]).count
    2
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
        given = np.zeros(self.masses.shape) if dampers is None else list(dampers)
        self.dampers = as_leaf(given, "attached.dampers", CHAIN)

    def __check_init__(self) -> None:
        require_number("attached.payload", self.payload, NOT_NEGATIVE, low=-TINY)
        require("attached.masses", self.masses, self.masses.ndim == 1, CHAIN)
        for name, low in (("masses", 0.0), ("springs", 0.0), ("dampers", -TINY)):
            values = getattr(self, name)
            require(f"attached.{name}", values, values.shape == self.masses.shape, CHAIN)
            if not isinstance(values, jax.core.Tracer):
                known = np.asarray(values)
                valid = bool(np.all(np.isfinite(known) & (known > low)))
                require(f"attached.{name}", values, valid, CHAIN)

    @property
    def count(self) -> int:
        """Number of masses in the chain."""
        return int(self.masses.size)

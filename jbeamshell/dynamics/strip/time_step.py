"""Time step of the two-step family of `jbeamshell.dynamics.strip.midpoint`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array


class StepMemory(NamedTuple):
    """Quantities of a step that the next step needs.

    Attributes
    ----------
    v, traction, cap : (n,) tangential displacement, friction traction and cap at q*
    change, rate_change : (b, a) increments of the fields and of their rates
    started : 0 before the first step, else 1
    """

    v: Array
    traction: Array
    cap: Array
    change: Array
    rate_change: Array
    started: Array


class TimeStep(NamedTuple):
    """Time step from z_0 to z_1, evaluated at z* = z_0 + c (z_1 - z_0) - g (z_0 - z_-1).

    Attributes
    ----------
    time, h : start and size of the step
    weight : c = g + 1/2
    """

    time: Array
    h: Array
    weight: Array

    @property
    def last_weight(self) -> Array:
        """Weight g of the last increment."""
        return self.weight - 0.5

    def gauss_mean(self, history: Callable[[Array], Any]) -> Any:
        """Mean of an excitation over the step, by three Gauss points, so that no blow is missed."""
        points, weights = np.polynomial.legendre.leggauss(3)
        times = self.time + 0.5 * (1.0 + points) * self.h
        values = jax.vmap(history)(times)
        return jax.tree.map(lambda v: jnp.sum(0.5 * weights * v), values)

    def evaluated(self, start: Array, change: Array, last_change: Array) -> Array:
        """Value z* from z_0, the increment and the last increment."""
        return start + self.weight * change - self.last_weight * last_change

    def increment(self, value: Array, start: Array, last_change: Array) -> Array:
        """Increment z_1 - z_0 that has a value z*; the inverse of `evaluated`."""
        return (value - start + self.last_weight * last_change) / self.weight

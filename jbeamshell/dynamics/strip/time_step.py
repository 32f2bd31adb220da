"""One step of the two-step family of `jbeamshell.dynamics.strip.midpoint`, and what it hands on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array


class StepMemory(NamedTuple):
    """What a step hands on to the next.

    Attributes
    ----------
    v, traction, cap : (n,) tangential displacement, friction and mu R at q*
    change, gain : (b, a) increments of the fields and of their rates
    begun : 0 before the first step
    """

    v: Array
    traction: Array
    cap: Array
    change: Array
    gain: Array
    begun: Array


class TimeStep(NamedTuple):
    """A time step.

    Attributes
    ----------
    time, h : its start and its size
    part : c = g + 1/2, the increment's part in z*
    """

    time: Array
    h: Array
    part: Array

    @property
    def before(self) -> Array:
        """G, the last increment's part in z*, taken away."""
        return self.part - 0.5

    def mean(self, history: Callable[[Array], Any]) -> Any:
        """Mean of what acts from outside, by Gauss's three points: short blows are not missed."""
        points, weights = np.polynomial.legendre.leggauss(3)
        times = self.time + 0.5 * (1.0 + points) * self.h
        seen = jax.vmap(history)(times)
        return jax.tree.map(lambda values: jnp.sum(0.5 * weights * values), seen)

    def reached(self, start: Array, change: Array, last: Array) -> Array:
        """z* of a start and its increments."""
        return start + self.part * change - self.before * last

    def gain(self, rate: Array, start: Array, last: Array) -> Array:
        """Increment of the rates from their z*."""
        return (rate - start + self.before * last) / self.part


class ChainPull(NamedTuple):
    """A chain of masses during a step: what it pulls with at the loaded end, linear in its motion.

    Attributes
    ----------
    still, slope : force for no increment of u(L), and per increment
    first, each : (k,) increments of the chain likewise
    """

    still: Array
    slope: Array
    first: Array
    each: Array

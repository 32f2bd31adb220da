"""Bijections between an unbounded search space and the open interval of a parameter.

The model runs at plain values; its derivatives are multiplied by the slopes of the bijections.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.special import logit

FARTHEST = 40.0  # largest coordinate in the search space; beyond it exp overflows or vanishes
INSET = 1e-9  # distance of a box from its open bounds, over its width
AT_BOUND = 1e-3  # distance from a bound, over the box's width, below which a fit ended at it


class Bijection(NamedTuple):
    """Map from the real line to an open interval; zero maps to the start.

    On the scale t = x or t = log x it is t0 + p without bounds, t_low + (t0 - t_low) exp(p) with
    one bound, and a logistic curve in p with two.

    Attributes
    ----------
    start, low, high : start and bounds of the parameter x
    log : True if the scale is logarithmic
    """

    start: float
    low: float
    high: float
    log: bool

    def value(self, point: float) -> float:
        """Parameter at a point of the search space."""
        return self._unscaled(self._at(float(point))[0])

    def slope(self, point: float) -> float:
        """Derivative of the parameter with respect to the point."""
        t, dt = self._at(float(point))
        return float(dt * self._unscaled(t) if self.log else dt)

    def traced(self, point: Array) -> tuple[Array, Array]:
        """Parameter at a traced point, and the derivative of its scale t there."""
        t, dt = self._at(point, jnp)
        return (jnp.exp(t) if self.log else t), jnp.broadcast_to(jnp.asarray(dt), jnp.shape(point))

    def at_part(self, part: float) -> float:
        """Parameter at a part, 0 to 1, of the way from bound to bound on its scale."""
        low, high = self._scaled(self.low), self._scaled(self.high)
        return self._unscaled(low + part * (high - low))

    def point(self, value: float) -> float:
        """Inverse of `value`; values on or beyond a bound are moved inside."""
        start, low, high = map(self._scaled, (self.start, self.low, self.high))
        t = self._scaled(value)
        if np.isfinite(low) and np.isfinite(high):
            point = logit((t - low) / (high - low)) - logit((start - low) / (high - low))
        elif np.isfinite(low):
            point = np.log((t - low) / (start - low)) if t > low else -FARTHEST
        elif np.isfinite(high):
            point = -np.log((high - t) / (high - start)) if t < high else FARTHEST
        else:
            point = (t - start) / self._unit
            if not self.log:
                return float(point)
        return float(np.clip(point, -FARTHEST, FARTHEST))

    def boxed(self) -> tuple[Bijection, tuple[float, float]]:
        """Bijection on the same scale without bounds, and the bounds as a box in its space."""
        free = Bijection(self.start, 0.0 if self.log else -np.inf, np.inf, self.log)
        low, high = ((self._scaled(b) - self._scaled(self.start)) / self._unit for b in self[1:3])
        inset = INSET * (high - low) if np.isfinite(high - low) else INSET
        return free, (low + inset, high - inset)

    def bound_at(self, value: float) -> float | None:
        """Bound at which a value ended; None if it lies inside."""
        low, high, t = map(self._scaled, (self.low, self.high, value))
        width = high - low if np.isfinite(high - low) else self._unit
        at_low, at_high = t - low < AT_BOUND * width, high - t < AT_BOUND * width
        return self.low if at_low else self.high if at_high else None

    @property
    def _unit(self) -> float:
        return 1.0 if self.log or self.start == 0.0 else abs(self.start)

    def _scaled(self, value: float) -> float:
        if not self.log:
            return float(value)
        return float(np.log(value)) if value > 0.0 else -np.inf

    def _unscaled(self, t: float) -> float:
        return float(np.exp(t)) if self.log else float(t)

    def _at(self, point: Any, numbers: Any = np) -> tuple[Any, Any]:
        """Parameter on its scale, and its derivative; ``numbers`` is numpy or jax.numpy."""
        start, low, high = map(self._scaled, (self.start, self.low, self.high))
        if not (self.log or np.isfinite(low) or np.isfinite(high)):
            return start + self._unit * point, self._unit
        p = numbers.clip(point, -FARTHEST, FARTHEST)
        if np.isfinite(low) and np.isfinite(high):
            part = 1.0 / (1.0 + numbers.exp(-p - logit((start - low) / (high - low))))
            return low + (high - low) * part, (high - low) * part * (1.0 - part)
        if np.isfinite(low):
            rise = (start - low) * numbers.exp(p)
            return low + rise, rise
        if np.isfinite(high):
            fall = (high - start) * numbers.exp(-p)
            return high - fall, fall
        return start + self._unit * p, self._unit

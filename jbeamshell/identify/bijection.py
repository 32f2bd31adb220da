"""Bijections between an unbounded search space and the open interval of a parameter.

The model runs at plain values; its derivatives are multiplied by the slopes of the bijections.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import expit, logit

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
        return self._unscaled(self._at(point)[0])

    def slope(self, point: float) -> float:
        """Derivative of the parameter with respect to the point."""
        t, dt = self._at(point)
        return dt * self._unscaled(t) if self.log else dt

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

    def _at(self, point: float) -> tuple[float, float]:
        """Parameter on its scale, and its derivative."""
        start, low, high = map(self._scaled, (self.start, self.low, self.high))
        unbounded = not (self.log or np.isfinite(low) or np.isfinite(high))
        p = float(point) if unbounded else float(np.clip(point, -FARTHEST, FARTHEST))
        if np.isfinite(low) and np.isfinite(high):
            part = expit(logit((start - low) / (high - low)) + p)
            return low + (high - low) * part, (high - low) * part * (1.0 - part)
        if np.isfinite(low):
            rise = (start - low) * np.exp(p)
            return low + rise, rise
        if np.isfinite(high):
            fall = (high - start) * np.exp(-p)
            return high - fall, fall
        return start + self._unit * p, self._unit

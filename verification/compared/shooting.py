r"""Shooting: integrate from one end, correct the start until the other end is right.

Whatever is unknown at X = 0 is multiplied by the fastest growth on its way to X = L, and so is its
rounding: exact integration does not help.  The squeeze, psi'' = psi/lambda^2 with lambda^2 =
kappa_s H^2 (1-nu)/6, grows by exp(L/lambda): e^440 for the 200 x 2 mm strip of Brink (2015, section
4.7.2), who shoots.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

CORRECTIONS = 5
PIECES = 200


class Squeeze(NamedTuple):
    """Squeezed strip by shooting.

    Attributes
    ----------
    length : L over H
    growth : log10 of the growth, L/(lambda ln 10)
    error : largest of psi along the strip, of psi under the load
    condition : of the end's xi from the start's psi, both of order 1 under the load
    """

    length: float
    growth: float
    error: float
    condition: float


def squeeze_length(kappa_s: float, poisson_ratio: float) -> float:
    """Decay length of the squeeze over H, sqrt(kappa_s (1-nu)/6), of a free strip."""
    return float(np.sqrt(kappa_s * (1.0 - poisson_ratio) / 6.0))


def shoot_squeeze(length: float, kappa_s: float = 0.44, poisson_ratio: float = 0.3) -> Squeeze:
    """Squeeze a free strip over its first half, by shooting from X = 0; lengths are over H.

    In units of psi under the load: lambda^2 psi'' = psi + 1 there, psi beyond, psi' = 0 at both
    ends, psi(0) unknown.
    """
    decay = squeeze_length(kappa_s, poisson_ratio)
    piece = 0.5 * length / decay / PIECES
    step = np.array([[np.cosh(piece), np.sinh(piece)], [np.sinh(piece), np.cosh(piece)]])

    def path(start: float) -> np.ndarray:
        at, found = np.array([start, 0.0]), []
        for load in np.repeat([-1.0, 0.0], PIECES):
            at = step @ (at - [load, 0.0]) + [load, 0.0]
            found.append(at)
        return np.array(found)

    start, (none, one) = -1.0, (path(value)[-1, 1] for value in (0.0, 1.0))
    slope = one - none
    for _ in range(CORRECTIONS):
        start = start - path(start)[-1, 1] / slope
    x = np.linspace(0.0, length, 2 * PIECES + 1)[1:] / decay
    half, whole = 0.5 * length / decay, length / decay
    # cosh and sinh over sinh of the whole, by exponentials that do not grow
    inner = -1.0 + _ratio(x, whole) * 0.5 * -np.expm1(-2.0 * (whole - half)) * np.exp(whole - half)
    outer = -_ratio(whole - x, whole) * 0.5 * -np.expm1(-2.0 * half) * np.exp(half)
    exact = np.where(x <= half, inner, outer)
    error = float(np.max(np.abs(path(start)[:, 0] - exact)))
    return Squeeze(length, whole / np.log(10.0), error, float(abs(slope)))


def _ratio(x: np.ndarray, whole: float) -> np.ndarray:
    """cosh(x)/sinh(whole), for x up to the whole."""
    return np.exp(x - whole) * (1.0 + np.exp(-2.0 * x)) / -np.expm1(-2.0 * whole)

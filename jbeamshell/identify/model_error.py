"""Residuals of a fitted model: their number of independent points, and their part beyond noise.

Least squares takes residuals for independent noise.  What a wrong model leaves is smooth along a
curve, so many points of it say no more than a few.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

SURE = 1.65  # standard errors beyond which a correlation is no chance; white noise is in 5 of 100
LAGS = 1.3  # lags over the root of the points, over which slow correlation shows


def independent_points(residuals: Sequence[Vector]) -> float:
    """Number of independent points that residuals along several curves are worth.

    n points of autocorrelation rho_k estimate a mean as well as n/(1 + 2 sum rho_k) independent
    ones (Bayley and Hammersley, J. R. Stat. Soc. Suppl. 8, 1946).  The sum takes the sizes of
    rho_k: the second branch of a loop repeats the first with the other sign, and so do the
    derivatives of the model.  What white noise adds to their squares is taken off.  Of slow noise,
    this counts rather too few points than too many.

    All points count where nothing tells the residuals from white noise: neither rho_1 nor
    Bartlett's sum over a few lags (Newey and West, Econometrica 55, 1987; for their number Lazarus
    et al., J. Bus. Econ. Stat. 36, 2018).

    Parameters
    ----------
    residuals : residuals along each curve, over their noise
    """
    points = sum(own.size for own in residuals)
    products = np.zeros(max(own.size for own in residuals))
    pairs = np.zeros(products.size)
    for own in residuals:
        products[: own.size] += np.correlate(own, own, "full")[own.size - 1 :]
        pairs[: own.size] += np.arange(own.size, 0, -1)
    if products[0] == 0.0 or products.size < 2:
        return float(points)
    correlation, chance = products[1:] / products[0], np.sqrt(pairs[1:]) / points
    few = min(int(np.ceil(LAGS * np.sqrt(points))), correlation.size)
    bartlett = 1.0 - np.arange(1, few + 1) / (few + 1)
    slow, by_chance = bartlett @ correlation[:few], np.linalg.norm(bartlett * chance[:few])
    if correlation[0] < SURE * chance[0] and slow < SURE * by_chance:
        return float(points)
    size = np.sqrt(np.maximum(correlation**2 - chance**2, 0.0))
    return points / (1.0 + 2.0 * float(np.sum(size)))


def model_misfit(residual: Vector) -> float:
    """Root mean square of the part of a residual along a curve that is no white noise."""
    return float(np.sqrt(max(float(np.mean(residual**2)) - white_noise(residual) ** 2, 0.0)))


def white_noise(residual: Vector) -> float:
    """Size of the white noise of a residual along a curve, from the differences of neighbours.

    See von Neumann, Ann. Math. Stat. 12, 1941.
    """
    if residual.size < 2:
        return 0.0
    return float(np.sqrt(np.mean(np.diff(residual) ** 2) / 2.0))

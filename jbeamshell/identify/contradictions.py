"""Measurements that contradict each other: alone, each would have other values than all together.

Each measurement alone would move the fit by the Gauss-Newton step of its own rows.  A model that is
wrong leaves about as much of each measurement alone as of all; contradicting measurements leave
much less, and their steps part by many of their own standard errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jbeamshell.identify.model_error import independent_points

APART = 0.5  # of the misfit of all together, left by each alone, below which they contradict
MANY = 5.0  # standard errors of each alone between what they would have
LEAST = 1e-12  # eigenvalue over the largest, below which a measurement does not tell a direction


class Wish(NamedTuple):
    """Step of the parameters that one measurement alone asks for.

    Attributes
    ----------
    step : (n,) Gauss-Newton step in the search space
    deviation : (n,) its standard errors, infinite where the measurement does not tell
    left : sum of the squares that it leaves
    """

    step: NDArray[np.float64]
    deviation: NDArray[np.float64]
    left: float


def contradiction(
    residual: NDArray[np.float64], jacobian: NDArray[np.float64], slices: Sequence[slice]
) -> tuple[int, int, int, float, float] | None:
    """Worst contradiction of two measurements; None if there is none.

    Parameters
    ----------
    residual, jacobian : (rows,) and (rows, n) at the minimum of all together
    slices : rows of each measurement

    Returns
    -------
    Axis, the numbers of the measurements that would have it least and most, and their steps
    """
    wishes = [_wish(residual[own], jacobian[own]) for own in slices]
    together = sum(float(residual[own] @ residual[own]) for own in slices)
    if len(wishes) < 2 or sum(wish.left for wish in wishes) > APART**2 * together:
        return None
    steps = np.array([wish.step for wish in wishes])
    deviations = np.array([wish.deviation for wish in wishes])
    apart = np.abs(steps[:, None] - steps[None])
    errors = np.sqrt(deviations[:, None] ** 2 + deviations[None] ** 2)
    some = np.isfinite(errors) & (apart != 0.0)  # 0 over 0 where both are met exactly
    ratio = np.divide(apart, errors, out=np.zeros_like(apart), where=some)
    axis = int(np.argmax(np.max(ratio, axis=(0, 1))))
    if np.max(ratio[..., axis]) < MANY:
        return None
    sure = np.where(ratio[..., axis] >= MANY, apart[..., axis], 0.0)
    pair = np.unravel_index(int(np.argmax(sure)), sure.shape)
    low, high = sorted(map(int, pair), key=lambda i: steps[i, axis])
    return axis, low, high, float(steps[low, axis]), float(steps[high, axis])


def _wish(residual: NDArray[np.float64], jacobian: NDArray[np.float64]) -> Wish:
    values, vectors = np.linalg.eigh(jacobian.T @ jacobian)
    told = values > LEAST * max(float(values[-1]), np.finfo(float).tiny)
    inverse = (vectors[:, told] / values[told]) @ vectors[:, told].T
    step = -inverse @ (jacobian.T @ residual)
    rest = residual + jacobian @ step
    left = float(rest @ rest)
    worth = min(independent_points([rest]), residual.size - float(np.sum(told)))
    variance = left / max(worth, 1.0)
    untold = np.sum(vectors[:, ~told] ** 2, axis=1) > LEAST
    deviation = np.sqrt(variance * np.maximum(np.diag(inverse), np.finfo(float).tiny))
    return Wish(step, np.where(untold, np.inf, deviation), left)

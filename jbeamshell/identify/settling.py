"""Last part of a search: on along the direction that the data know least.

The response of a grid has kinks where nodes begin to slip.  Along a direction that hardly changes
it, they stop a search far from the minimum, and its derivative at a point is that of a kink.  So
the response is compared over the width of the confidence interval, where kinks are small.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jbeamshell.identify.experiment import Evaluation
from jbeamshell.identify.problem import Problem
from jbeamshell.identify.uncertainty import Uncertainty, uncertainty_at

ROUNDS = 8  # most moves along weakest directions
SHORTEST, LONGEST = 0.02, 0.7  # half widths over which the response is compared
NEARER = 0.3  # part of the width at which a minimum is looked for too
GAIN = 1e-2  # relative gain in cost below which a search has settled
ROUNDING = 1e-9  # residual that is rounding
WORTH = 0.1  # part of the rise in cost that the other directions must take back to be moved
WIDER = 1.5  # factor by which an interval may exceed the width over which it was found
STRAIGHT = 0.05  # part by which a derivative may differ over the interval and still stand

Vector = NDArray[np.float64]


class Settled(NamedTuple):
    """End of a search from which no step along the weakest direction leads on.

    Attributes
    ----------
    point : (n,) coordinates in the search space
    jacobian : (rows, n) derivatives; along the weakest direction those over its interval
    settled : False if the last move still gained
    """

    point: Vector
    jacobian: Vector
    settled: bool


def settle(
    problem: Problem,
    point: Vector,
    report: Callable[[int, Vector, float], None],
) -> Settled:
    """Go on from the end of a search along the weakest direction of J'J, as long as that gains.

    Parameters
    ----------
    problem : least-squares problem
    point : (n,) end of the search
    report : called after every move with its number, the point and the cost
    """
    here = problem(point)
    jacobian, rounding = here.jacobian, ROUNDING**2 * here.residual.size
    for move in range(1, ROUNDS + 1):
        found = uncertainty_at(problem, point, jacobian)
        width = _width(found)
        jacobian, tried = _over_interval(problem, found, here, width)
        trial = point + _step(jacobian, here, ~found.at_bound)
        best = _cheapest(problem, [*tried, trial])
        least = here.cost - max(GAIN * here.cost, rounding)
        if jacobian is not here.jacobian and not problem(best).cost < least:
            # The kinks that the width bridges may hide a minimum nearer by.
            _, nearer = _over_interval(problem, found, here, NEARER * width)
            best = _cheapest(problem, [best, *nearer])
        there = problem(best)
        if there.cost < least and np.all(np.isfinite(there.jacobian)):
            point, here, jacobian = best, there, there.jacobian
            report(move, point, here.cost)
        elif _width(uncertainty_at(problem, point, jacobian)) <= WIDER * width:
            return Settled(point, jacobian, True)
    return Settled(point, jacobian, False)


def _cheapest(problem: Problem, points: list[Vector]) -> Vector:
    """Point (n,) of least cost among those where the response has a derivative, if any has."""

    def cost(point: Vector) -> float:
        at = problem(point)
        return at.cost if bool(np.all(np.isfinite(at.jacobian))) else np.inf

    return min(points, key=cost)


def _width(found: Uncertainty) -> float:
    """Half width of the interval along the weakest direction, within bounds."""
    weakest = (1.0 / np.sqrt(eigenvalue) for eigenvalue, _ in found.directions()[:1])
    return float(np.clip(found.quantile(0.95) * sum(weakest), SHORTEST, LONGEST))


def _over_interval(
    problem: Problem, found: Uncertainty, here: Evaluation, width: float
) -> tuple[Vector, list[Vector]]:
    """Derivatives with those of the weakest direction over its interval, and the interval's ends.

    Where the model finds no equilibrium at an end, such as beyond gross slip, the other side
    counts alone.  A derivative that holds over the interval is kept as it is.
    """
    directions = [vector for _, vector in found.directions()]
    if not directions:
        return here.jacobian, []
    others = np.array(directions[1:]).reshape(-1, found.point.size).T
    ends = [
        _relaxed(problem, found.point + side * width * directions[0], here, others)
        for side in (-1.0, 1.0)
    ]
    ways = [end for end in ends if problem(end).converged]
    if not ways:
        return here.jacobian, []
    first = ways[0] if len(ways) > 1 else found.point
    way = ways[-1] - first
    residuals = [problem(at).residual for at in (first, ways[-1])]
    foreseen, change = here.jacobian @ way, residuals[1] - residuals[0]
    missed = change - foreseen
    if np.linalg.norm(missed) <= STRAIGHT * np.linalg.norm(foreseen):
        return here.jacobian, ways
    return here.jacobian + np.outer(missed, way) / (way @ way), ways


def _relaxed(problem: Problem, end: Vector, here: Evaluation, others: Vector) -> Vector:
    """End of an interval after a Gauss-Newton step along the other directions (n, others)."""
    there = problem(end)
    if not (there.converged and others.size):
        return end
    slopes = here.jacobian @ others
    step = np.linalg.lstsq(slopes, -there.residual)[0]
    rest = there.residual + slopes @ step
    if there.cost - rest @ rest < WORTH * abs(there.cost - here.cost):
        return end
    relaxed = end + others @ np.clip(step, -LONGEST, LONGEST)
    return min(end, relaxed, key=lambda at: problem(at).cost)


def _step(jacobian: Vector, here: Evaluation, inside: NDArray[np.bool_]) -> Vector:
    """Gauss-Newton step (n,) of the axes inside their bounds, none longer than `LONGEST`."""
    step = np.zeros(inside.size)
    step[inside] = np.linalg.lstsq(jacobian[:, inside], -here.residual)[0]
    return np.clip(step, -LONGEST, LONGEST)

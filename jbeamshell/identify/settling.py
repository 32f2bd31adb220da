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

from jbeamshell.identify.problem import Evaluation, Problem
from jbeamshell.identify.search_space import SearchSpace
from jbeamshell.identify.uncertainty import Uncertainty, uncertainty_at

ROUNDS = 12  # most moves along weakest directions
SHORTEST, LONGEST = 0.02, 0.7  # half widths over which the response is compared
GAIN = 1e-3  # relative gain in cost below which a search has settled
ROUNDING = 1e-9  # residual that is rounding
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
    space: SearchSpace,
    point: Vector,
    report: Callable[[Vector, float], None] | None = None,
) -> Settled:
    """Go on from the end of a search along the weakest direction of J'J, as long as that gains.

    Parameters
    ----------
    problem : least-squares problem
    space : search space, n axes
    point : (n,) end of the search
    report : called after every move with the point and the cost
    """
    here = problem(space, point)
    least = ROUNDING**2 * here.residual.size
    for _ in range(ROUNDS):
        found = uncertainty_at(problem, space, point, here.jacobian)
        jacobian, tried = _over_interval(problem, space, found, here)
        trial = point + _step(jacobian, here, ~found.at_bound)
        best, there = min(
            ((at, problem(space, at)) for at in (*tried, trial)), key=lambda pair: pair[1].cost
        )
        if not here.cost - there.cost > max(GAIN * here.cost, least):
            return Settled(point, jacobian, True)
        point, here = best, there
        if report:
            report(point, here.cost)
    return Settled(point, here.jacobian, False)


def _over_interval(
    problem: Problem, space: SearchSpace, found: Uncertainty, here: Evaluation
) -> tuple[Vector, list[Vector]]:
    """Derivatives with those of the weakest direction over its interval, and the interval's ends.

    A derivative that holds over the interval is kept as it is.
    """
    directions = found.directions()
    if not directions:
        return here.jacobian, []
    eigenvalue, vector = directions[0]
    width = float(np.clip(found.quantile(0.95) / np.sqrt(eigenvalue), SHORTEST, LONGEST))
    ends = [found.point + side * width * vector for side in (-1.0, 1.0)]
    below, above = (problem(space, end) for end in ends)
    if not (below.converged and above.converged):
        return here.jacobian, ends
    at_point = here.jacobian @ vector
    over_interval = (above.residual - below.residual) / (2.0 * width)
    change = over_interval - at_point
    if np.linalg.norm(change) <= STRAIGHT * np.linalg.norm(at_point):
        return here.jacobian, ends
    return here.jacobian + np.outer(change, vector), ends


def _step(jacobian: Vector, here: Evaluation, inside: NDArray[np.bool_]) -> Vector:
    """Gauss-Newton step (n,) of the axes inside their bounds, none longer than `LONGEST`."""
    step = np.zeros(inside.size)
    step[inside] = np.linalg.lstsq(jacobian[:, inside], -here.residual)[0]
    return np.clip(step, -LONGEST, LONGEST)

"""Profile likelihood: cost over one parameter, all others fitted anew at each of its values."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.common.progress import bar
from jbeamshell.identify.parameters import FARTHEST
from jbeamshell.identify.problem import Problem
from jbeamshell.identify.search import minimise
from jbeamshell.identify.uncertainty import Uncertainty, check_level

MOST_POINTS = 8  # evaluations to either side
ACCURACY = 0.02  # relative error allowed in the square root of the rise at an interval's end
NUDGE = 0.5  # largest move of the others, in the search space, before they are fitted
MAX_ITERATIONS, TOLERANCE = 40, 1e-4  # of the fits of the other parameters
LONGEST_FIRST_STEP = 2.0  # in the search space


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Profile:
    """Profile likelihood of one parameter.

    Attributes
    ----------
    name : name of the parameter
    values : (points,) values of the parameter, increasing
    rises : (points,) rise of the cost above the minimum, over the squared noise
    interval : ends at which the rise reaches that of the level; a bound of the parameter, or
        infinity, where it never does
    level : confidence level
    settled : True if the fits of the other parameters converged at every point; if not, rises are
        too large there, and the interval may be too short
    """

    name: str
    values: NDArray[np.float64]
    rises: NDArray[np.float64]
    interval: tuple[float, float]
    level: float
    settled: bool = True

    def __repr__(self) -> str:
        low, high = self.interval
        line = f"  {self.name}: {100.0 * self.level:g} % profile interval {low:.6g} to {high:.6g}"
        doubt = "; the other parameters did not converge everywhere, so it may be too short"
        return line if self.settled else line + doubt

    def figures(self) -> dict[str, Any]:
        """Profile as plain numbers for JSON; an infinite end is None."""
        return {
            "level": self.level,
            "settled": self.settled,
            "interval": [end if np.isfinite(end) else None for end in self.interval],
            "values": self.values.tolist(),
            "rises": self.rises.tolist(),
        }


def profile(
    problem: Problem,
    uncertainty: Uncertainty,
    name: str,
    level: float = 0.95,
    max_iterations: int = MAX_ITERATIONS,
    tolerance: float = TOLERANCE,
) -> Profile:
    """Profile likelihood of a parameter at the minimum of a problem; see `Fit.profile`."""
    check_level(level)
    space, best = uncertainty.space, uncertainty.point
    axis = space.names.index(name)
    coordinate = space.coordinates[axis]
    if uncertainty.at_bound[axis]:
        raise InputError(f"profile {name!r}: it ended at its bound; widen its bounds and fit again")
    along = uncertainty.inverse[:, axis] / uncertainty.inverse[axis, axis]
    least, wanted = problem(best).cost, uncertainty.quantile(level)
    points, roots, settled = {0.0: best}, {0.0: 0.0}, True

    def root_at(step: float) -> float:
        """Square root of the rise, which is about linear in the step."""
        nonlocal settled
        # Start from the nearest known step, moved a little: poorly known parameters would run away.
        nearest = min(points, key=lambda known: abs(known - step))
        whole = points[nearest] + np.clip((step - nearest) * along, -NUDGE, NUDGE)
        whole[axis] = best[axis] + step
        points[step], converged = minimise(problem, whole, max_iterations, tolerance, held=[axis])
        settled &= converged
        rise = max(problem(points[step]).cost - least, 0.0)
        roots[step] = float(np.sqrt(rise) / uncertainty.sigma)
        return roots[step]

    spread = float(np.sqrt(uncertainty.covariance[axis, axis]))
    first, ends = min(wanted * spread, LONGEST_FIRST_STEP), []
    with bar(f"profile of {name}", "fit") as shown:

        def counted(step: float) -> float:
            shown.update()
            return root_at(step)

        for side, bound in ((-1.0, coordinate.low), (1.0, coordinate.high)):
            step = _crossing(counted, side, wanted, first)
            ends.append(bound if step is None else coordinate.at(best[axis] + step)[0])
    pairs = sorted((coordinate.at(best[axis] + step)[0], root) for step, root in roots.items())
    values, heights = np.array(pairs).T
    return Profile(name, values, heights**2, (min(ends), max(ends)), level, settled)


def _crossing(
    function: Callable[[float], float], side: float, wanted: float, step: float
) -> float | None:
    """Signed step at which a function that rises from zero reaches a value; None if it does not."""
    inside, outside = (0.0, 0.0), None
    for _ in range(MOST_POINTS):
        if step > FARTHEST:
            return None
        value = function(side * step)
        if abs(value - wanted) < ACCURACY * wanted:
            return side * step
        if value < wanted:
            inside = (step, value)
        else:
            outside = (step, value)
        if outside is None:
            step *= 2.0
            continue
        part = (wanted - inside[1]) / (outside[1] - inside[1])
        step = inside[0] + np.clip(part, 0.1, 0.9) * (outside[0] - inside[0])
    return None if outside is None else side * float(step)

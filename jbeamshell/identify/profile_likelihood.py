"""Profile likelihood: cost over one parameter, all others fitted anew at each of its values."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.common.progress import bar
from jbeamshell.identify.bijection import FARTHEST
from jbeamshell.identify.problem import Evaluation
from jbeamshell.identify.results import Fit
from jbeamshell.identify.search import StoppingRule, minimise
from jbeamshell.identify.uncertainty import check_level

MOST_POINTS = 8  # evaluations to either side
ACCURACY = 0.02  # relative error allowed in the square root of the rise at an interval's end
NUDGE = 0.5  # largest move of the others, in the search space, before they are fitted
LONGEST_FIRST_STEP = 2.0  # in the search space


class Profile(NamedTuple):
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

    def __str__(self) -> str:
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
    result: Fit,
    name: str,
    *,
    level: float = 0.95,
    max_iterations: int = 40,
    tolerance: float = 1e-4,
) -> Profile:
    """Profile likelihood of a fitted parameter, and its confidence interval.

    The intervals of `Fit` linearise the model, which is right for little noise only.  This function
    runs the model: it holds the parameter at other values and fits all others again (Raue et al.,
    Bioinformatics 25, 2009).  It costs up to 16 fits.

    Parameters
    ----------
    result : result of `fit`
    name : one of ``result.values``
    level : confidence level, between 0 and 1
    max_iterations, tolerance : settings of the fits of the other parameters

    Returns
    -------
    Profile
        values of the parameter, rises of the cost, and the interval

    Raises
    ------
    InputError
        if the name was not fitted, or if its value ended at a bound

    Examples
    --------
    ::

        fit = jb.identify.fit(loops, scene, ["contact.friction", "strip.height_ratio"])
        low, high = jb.identify.profile(fit, "contact.friction").interval
    """
    check_level(level)
    if name not in result.values or result.problem is None or result.uncertainty is None:
        raise InputError(f"profile {name!r}: was not fitted; names are {', '.join(result.values)}")
    problem, uncertainty = result.problem, result.uncertainty
    space, best = uncertainty.space, uncertainty.point
    axis = space.names.index(name)
    bijection = space.bijections[axis]
    if uncertainty.at_bound[axis]:
        raise InputError(f"profile {name!r}: it ended at its bound; widen its bounds and fit again")
    others = np.delete(np.arange(best.size), axis)
    along = uncertainty.inverse[:, axis] / uncertainty.inverse[axis, axis]
    least, wanted = problem(space, best).cost, uncertainty.quantile(level)
    stopping = StoppingRule(max_iterations, tolerance, uncertainty.sigma**2)
    points, roots, settled = {0.0: best}, {0.0: 0.0}, True

    def root_at(step: float) -> float:
        """Square root of the rise, which is about linear in the step."""
        nonlocal settled
        # Start from the nearest known step, moved a little: poorly known parameters would run away.
        nearest = min(points, key=lambda known: abs(known - step))
        whole = points[nearest] + np.clip((step - nearest) * along, -NUDGE, NUDGE)
        whole[axis] = best[axis] + step

        def evaluate(part: NDArray[np.float64]) -> Evaluation:
            evaluation = problem(space, np.insert(part, axis, whole[axis]))
            return evaluation._replace(jacobian=evaluation.jacobian[:, others])

        if others.size:
            end = minimise(evaluate, whole[others], stopping)
            whole[others] = end.point
            settled &= end.status == "converged"
        points[step] = whole
        rise = max(evaluate(whole[others]).cost - least, 0.0)
        roots[step] = float(np.sqrt(rise) / uncertainty.sigma)
        return roots[step]

    spread = float(np.sqrt(uncertainty.covariance[axis, axis]))
    first, ends = min(wanted * spread, LONGEST_FIRST_STEP), []
    with bar(f"profile of {name}", "fit") as shown:

        def counted(step: float) -> float:
            shown.update()
            return root_at(step)

        for side, bound in ((-1.0, bijection.low), (1.0, bijection.high)):
            step = _crossing(counted, side, wanted, first)
            ends.append(bound if step is None else bijection.value(best[axis] + step))
    pairs = sorted((bijection.value(best[axis] + step), root) for step, root in roots.items())
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

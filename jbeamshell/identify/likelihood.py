"""Profile likelihood: how far one parameter may go while all others make the best of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.identify.parameters import FARTHEST
from jbeamshell.identify.problem import Point
from jbeamshell.identify.results import Fit
from jbeamshell.identify.search import Limits, minimise
from jbeamshell.identify.uncertainty import check_level

MOST_POINTS = 8  # to either side
CLOSE = 0.02  # of its root: so well the ends of an interval are found
NUDGE = 0.5  # in the search space: most that the others move before they are fitted
FARTHEST_FIRST = 2.0  # step in the search space, however little is known


class Profile(NamedTuple):
    """The profile likelihood of one parameter: the best that all others can do beside it.

    Attributes
    ----------
    name : of the parameter
    values : (points,) increasing
    rises : (points,) of the cost over that of the minimum, over the noise squared
    interval : where the rise reaches that of the level; a bound of the parameter, or infinity,
        where it never does
    level : of confidence
    settled : whether all others settled at every point; if not, rises are too large there, and the
        interval may be too short
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
        return line if self.settled else f"{line}; the others did not settle, so it may be short"

    def figures(self) -> dict[str, Any]:
        """The profile as plain numbers, fit for JSON: an end at infinity is None."""
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
    """Profile likelihood of a fitted parameter, and the interval that it gives.

    Unlike the intervals of `Fit`, it asks the model itself how far the parameter may go, all others
    following; so it is right where these are only good for little noise.

    Parameters
    ----------
    result : of `fit`
    name : one of ``result.values``
    level : of confidence
    max_iterations, tolerance : of the fit of the others

    Raises
    ------
    InputError
        for a name that was not fitted, or that ended at its bound
    """
    check_level(level)
    if name not in result.values or result.problem is None or result.uncertainty is None:
        raise InputError(f"profile {name!r}: was not fitted; names are {', '.join(result.values)}")
    problem, uncertainty = result.problem, result.uncertainty
    space, best = uncertainty.space, uncertainty.point
    entry = space.names.index(name)
    if uncertainty.held[entry]:
        raise InputError(f"profile {name!r}: it ended at its bound; give it more room")
    others = np.delete(np.arange(best.size), entry)
    along = uncertainty.inverse[:, entry] / uncertainty.inverse[entry, entry]
    least, wanted = problem(space, best).cost, uncertainty.quantile(level)

    found, settled = {0.0: best}, True

    def root_at(step: float) -> float:
        """Square root of the rise, which is about linear in the step."""
        nonlocal settled
        # From the nearest step known, and not far at once: what is open would run away.
        nearest = min(found, key=lambda known: abs(known - step))
        whole = found[nearest] + np.clip((step - nearest) * along, -NUDGE, NUDGE)
        whole[entry] = best[entry] + step

        def evaluate(part: NDArray[np.float64]) -> Point:
            point = problem(space, np.insert(part, entry, whole[entry]))
            return point._replace(jacobian=point.jacobian[:, others])

        if others.size:
            end = minimise(
                evaluate, whole[others], Limits(max_iterations, tolerance, uncertainty.sigma**2)
            )
            whole[others] = end.point
            settled &= end.status == "converged"
        cost = evaluate(whole[others]).cost
        found[step] = whole
        return float(np.sqrt(max(cost - least, 0.0)) / uncertainty.sigma)

    spread = float(np.sqrt(uncertainty.covariance[entry, entry]))
    known, ends = {0.0: 0.0}, []
    for side in (-1.0, 1.0):
        end = _crossing(root_at, wanted, side, min(wanted * spread, FARTHEST_FIRST), known)
        bound = space.bijections[entry][1 if side < 0.0 else 2]
        ends.append(bound if end is None else space.bijections[entry].value(best[entry] + end))
    steps = sorted(known, key=lambda step: space.bijections[entry].value(best[entry] + step))
    values = np.array([space.bijections[entry].value(best[entry] + step) for step in steps])
    rises = np.array([known[step] ** 2 for step in steps])
    return Profile(name, values, rises, (min(ends), max(ends)), level, settled)


def _crossing(
    root_at: Callable[[float], float],
    wanted: float,
    side: float,
    step: float,
    known: dict[float, float],
) -> float | None:
    """Signed step at which a rising function of it reaches a value; None if it never does."""
    inside, outside = (0.0, 0.0), None
    for _ in range(MOST_POINTS):
        if step > FARTHEST:
            return None
        root = known[side * step] = root_at(side * step)
        if abs(root - wanted) < CLOSE * wanted:
            return side * step
        if root < wanted:
            inside = (step, root)
        else:
            outside = (step, root)
        if outside is None:
            step *= 2.0
            continue
        part = (wanted - inside[1]) / (outside[1] - inside[1])
        step = inside[0] + np.clip(part, 0.1, 0.9) * (outside[0] - inside[0])
    return None if outside is None else side * float(step)

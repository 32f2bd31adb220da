"""Searches for the minimum of a sum of squares: from one start or several, and on to a bound.

All are `scipy.optimize.least_squares` with the exact Jacobian, along coordinates without bounds.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, lsq_linear

from jbeamshell.common.errors import InputError, UnconvergedError
from jbeamshell.identify.parameters import ON_BOUND
from jbeamshell.identify.problem import Problem
from jbeamshell.identify.runs import Evaluation
from jbeamshell.identify.search_space import SearchSpace

FLAT = 1e-6  # relative gain in cost below which a search has converged
NEAR = 1e-10  # the same of a search on a bound, which begins near its end
GRADIENT = 1e-10  # slope of the cost below which a search has converged, as where nothing is left
PROMISED = 0.02  # part of the cost that a step still promises, from which on none has converged
ROUNDING = 1e-6  # residual of a point that is rounding
SCREENED = 4  # random points tried for each start besides the given one
NO_INFLUENCE = 1e-9  # change of a residual for a unit step below which it is rounding

Vector = NDArray[np.float64]


class FitProgress(NamedTuple):
    """Progress of a fit; as text, it is one line.

    Attributes
    ----------
    search, searches : number of the search, 0 while starts are tried, and how many there are; that
        on a bound is one more
    step : number of the step in the search, or of the start that is tried
    cost : sum of the squared residuals
    values : parameters by name
    elapsed : seconds since the fit began
    left : seconds it may still take if every search uses all its iterations
    """

    search: int
    searches: int
    step: int
    cost: float
    values: dict[str, float]
    elapsed: float
    left: float

    def __str__(self) -> str:
        at = f"search {self.search} of {self.searches}, step" if self.search else "start"
        at = "last part, step" if self.search > self.searches else at
        values = ", ".join(f"{name} = {value:.6g}" for name, value in self.values.items())
        return f"{at} {self.step}, cost {self.cost:.4g}, at most {self.left:.0f} s left: {values}"


class SearchResult(NamedTuple):
    """Point at which a search ended.

    Attributes
    ----------
    point : (n,) coordinates
    converged : False if it ran out of iterations, could not begin, or stopped where a step still
        promises a lower cost
    """

    point: Vector
    converged: bool


def minimise(
    evaluate: Callable[[Vector], Evaluation],
    start: Vector,
    most: int,
    tolerance: float,
    report: Callable[[int, Vector, float], None] | None = None,
    held: Sequence[int] = (),
    flat: float = FLAT,
) -> SearchResult:
    """Run one search, by Gauss-Newton steps within a trust region.

    A point without derivatives is refused as one of infinite cost.

    Parameters
    ----------
    evaluate : function that returns residual and Jacobian at a point (n,), and remembers them
    start : (n,) first point
    most : largest number of points to try
    tolerance : relative change of the parameters below which the search has converged
    report : called after every step with its number, the point and the cost
    held : axes along which the search does not move
    flat : relative gain in cost below which it has converged
    """
    moved, steps = np.delete(np.arange(start.size), held), itertools.count()
    if moved.size == 0:
        return SearchResult(start, True)
    # Scipy's first trust region is as large as the first point.  With that at ones, it allows about
    # a unit along each axis, for most parameters a factor e.
    shift = start[moved] - 1.0

    def whole(part: Vector) -> Vector:
        point = start.copy()
        point[moved] = shift + part
        return point

    def residual(part: Vector) -> Vector:
        at = evaluate(whole(part))
        known = bool(np.all(np.isfinite(at.jacobian)))
        return at.residual if known else np.full_like(at.residual, np.inf)

    def jacobian(part: Vector) -> Vector:
        at, step = evaluate(whole(part)), next(steps)
        if report and step:
            report(step, whole(part), at.cost)
        return at.jacobian[:, moved]

    first = np.ones(moved.size)
    if not np.all(np.isfinite(residual(first))):
        return SearchResult(start, False)
    found = least_squares(
        residual,
        first,
        jacobian,
        x_scale="jac",
        ftol=flat,
        xtol=tolerance,
        gtol=GRADIENT,
        max_nfev=most,
    )
    point = whole(found.x)
    return SearchResult(point, found.status > 0 and not _promises(evaluate(point), moved))


def _promises(at: Evaluation, moved: NDArray[np.intp]) -> bool:
    """True if a step of one unit along each axis at most would lower the cost by much.

    A search between points without equilibrium shrinks its steps until they look converged.
    """
    before = float(at.residual @ at.residual)
    if before <= at.residual.size * ROUNDING**2:
        return False
    after = lsq_linear(at.jacobian[:, moved], -at.residual, (-1.0, 1.0)).cost
    return bool(2.0 * after < (1.0 - PROMISED) * before)


def search(
    problem: Problem,
    starts: int,
    most: int,
    tolerance: float,
    progress: Callable[[FitProgress], None],
) -> list[SearchResult]:
    """Ends of the searches from all starts, the best first; values that ran into bounds are there.

    The starts are the given one, and the best of some points between the bounds.

    Parameters
    ----------
    problem : least-squares problem
    starts : number of searches
    most, tolerance : conditions that end each search, see `minimise`
    progress : called after every step
    """
    check_start(problem)
    space = problem.space
    tried = SCREENED * (starts - 1)
    report = _reporter(space, starts, tried + starts * most, progress)

    def cost(end: SearchResult) -> float:
        return problem(end.point).cost

    costs, points = [], _spread(space, tried)
    for number, point in enumerate(points, 1):
        costs.append(problem(point).cost)
        report(0, number, point, costs[-1])
    best = [points[i] for i in np.argsort(costs, kind="stable")[: starts - 1]]
    ends = [
        minimise(problem, start, most, tolerance, partial(report, number))
        for number, start in enumerate([np.zeros(len(space.names)), *best], 1)
    ]
    ends = sorted(ends, key=cost)
    bounds = space.bounds_at(ends[0].point)
    held = [axis for axis, bound in enumerate(bounds) if bound is not None]
    if held:
        at = ends[0].point.copy()
        for axis in held:
            at[axis] = -ON_BOUND if bounds[axis] == space.coordinates[axis].low else ON_BOUND
        there = minimise(problem, at, most, tolerance, partial(report, starts + 1), held, NEAR)
        ends[0] = ends[0]._replace(point=min(ends[0], there, key=cost).point)
    return ends


def _reporter(
    space: SearchSpace, searches: int, most: int, progress: Callable[[FitProgress], None]
) -> Callable[[int, int, Vector, float], None]:
    """Function that reports a search's number, its step, a point (n,) and its cost."""
    begin, count = time.perf_counter(), itertools.count(1)

    def report(search: int, step: int, point: Vector, cost: float) -> None:
        elapsed, done = time.perf_counter() - begin, next(count)
        left, named = elapsed / done * max(most - done, 0), space.named(space.values(point))
        progress(FitProgress(search, searches, step, cost, named, elapsed, left))

    return report


def check_start(problem: Problem) -> None:
    """Raise unless the model has an equilibrium at the start, and every parameter an influence."""
    start = problem(np.zeros(len(problem.space.names)))
    if not start.converged:
        raise UnconvergedError(
            "the model finds no equilibrium at the start values: start closer, or take "
            "softer sliders (contact.stick_stiffness = 100 or less)"
        )
    data = start.jacobian[: start.prediction.size]
    for name, column in zip(problem.space.names, data.T, strict=True):
        if not np.all(np.isfinite(column)):
            raise UnconvergedError(
                f"free {name!r}: the response has no derivative at its start: start elsewhere"
            )
        if not np.any(np.abs(column) > NO_INFLUENCE):
            raise InputError(
                f"free {name!r}: the data do not depend on it at its start; leave it out"
            )


def _spread(space: SearchSpace, count: int) -> list[Vector]:
    """Points of a Latin hypercube between the bounds."""
    random = np.random.default_rng(0)
    cells = np.stack([random.permutation(count) for _ in space.names], axis=1)
    parts = (cells + random.uniform(size=cells.shape)) / max(count, 1)
    return [
        np.array([one.between(part) for one, part in zip(space.coordinates, row, strict=True)])
        for row in parts.tolist()
    ]

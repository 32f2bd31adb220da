"""Searches for the minimum of a sum of squares: three, each with one job.

Scipy's least squares are the search of every fit.  They have no bounds here, so jaxopt's gradient
search in a box goes on where they ran into one.  Where they do not converge, optax moves many
starts together, and they search again from the best.  The only file that imports jaxopt and optax.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import jaxopt
import numpy as np
import optax
from jax import Array
from numpy.typing import NDArray
from scipy.optimize import least_squares

from jbeamshell.identify.experiment import Evaluation
from jbeamshell.identify.problem import Problem

FLAT = 1e-6  # relative gain in cost below which a search has converged
GRADIENT = 1e-10  # slope of the cost below which a search has converged, as where nothing is left
ADAM_STEPS = 25
ADAM_RATE = 0.15  # step in the search space, where most parameters are logarithms

Vector = NDArray[np.float64]
Evaluate = Callable[[Vector], Evaluation]


class StoppingRule(NamedTuple):
    """Conditions that end a search.

    Attributes
    ----------
    max_iterations : largest number of points that each search tries
    tolerance : relative change of the parameters below which a search has converged
    """

    max_iterations: int
    tolerance: float


class SearchResult(NamedTuple):
    """Point at which a search ended.

    Attributes
    ----------
    point : (n,) coordinates in the unbounded search space
    converged : False if it ran out of iterations, or could not begin
    """

    point: Vector
    converged: bool


def minimise(
    evaluate: Evaluate,
    start: Vector,
    stopping: StoppingRule,
    report: Callable[[int, Vector, float], None] | None = None,
) -> SearchResult:
    """Run one search, by Gauss-Newton steps within a trust region.

    A point without derivatives is refused as one of infinite cost.

    Parameters
    ----------
    evaluate : function that returns residual and Jacobian at a point (n,), and remembers them
    start : (n,) first point
    stopping : conditions that end the search
    report : called after every step with its number, the point and the cost
    """
    # Scipy's first trust region is as large as the first point.  With that at ones, it allows about
    # a unit along each axis, for most parameters a factor e.
    shift, steps = start - 1.0, itertools.count()

    def residual(point: Vector) -> Vector:
        at = evaluate(shift + point)
        known = bool(np.all(np.isfinite(at.jacobian)))
        return at.residual if known else np.full_like(at.residual, np.inf)

    def jacobian(point: Vector) -> Vector:
        at, step = evaluate(shift + point), next(steps)
        if report and step:
            report(step, shift + point, at.cost)
        return at.jacobian

    if not np.all(np.isfinite(residual(start - shift))):
        return SearchResult(start, False)
    found = least_squares(
        residual,
        start - shift,
        jacobian,
        x_scale="jac",
        ftol=FLAT,
        xtol=stopping.tolerance,
        gtol=GRADIENT,
        max_nfev=stopping.max_iterations,
    )
    return SearchResult(shift + found.x, found.status > 0)


def within_bounds(problem: Problem, start: Vector, stopping: StoppingRule) -> SearchResult:
    """Search on by L-BFGS-B in a box whose sides may be reached.

    Parameters
    ----------
    problem : residuals and their derivatives
    start : (n,) point to start from
    stopping : conditions that end the search
    """
    space = problem.space
    boxed, box = space.boxed()
    first = np.clip(boxed.point(space.values(start)), *box.T)
    scale = 1.0 / max(problem(first, boxed).cost, np.finfo(float).tiny)

    def value_and_gradient(params: Array) -> tuple[float, Vector]:
        at = problem(np.asarray(params), boxed)
        return scale * at.cost, 2.0 * scale * at.residual @ at.jacobian

    method = jaxopt.ScipyBoundedMinimize(
        fun=value_and_gradient,
        value_and_grad=True,
        method="L-BFGS-B",
        maxiter=stopping.max_iterations,
        options={"ftol": stopping.tolerance**2, "gtol": stopping.tolerance},
        jit=False,
    )
    params, state = method.run(jnp.asarray(first), bounds=tuple(map(jnp.asarray, box.T)))
    end = space.point(boxed.values(np.asarray(params)))
    return SearchResult(end, bool(state.success))


def together(
    problem: Problem,
    starts: Sequence[Vector],
    report: Callable[[int, Vector, float], None],
) -> Vector:
    """Point (n,) of least cost that many starts meet as Adam moves them in one batch.

    Parameters
    ----------
    problem : residuals and their derivatives
    starts : points (n,) to start from
    report : called after every step with its number, the best point and its cost
    """
    optimiser = optax.adam(optax.cosine_decay_schedule(ADAM_RATE, ADAM_STEPS))
    points: Any = np.stack(starts)
    state = optimiser.init(points)
    seen = []
    for step in range(1, ADAM_STEPS + 1):
        evaluations = [problem(point) for point in points]
        costs = [evaluation.cost for evaluation in evaluations]
        best = int(np.argmin(costs))
        seen.append((costs[best], points[best]))
        report(step, points[best], costs[best])
        gradients = np.stack([at.residual @ at.jacobian for at in evaluations])
        updates, state = optimiser.update(np.nan_to_num(gradients), state)
        points = np.asarray(optax.apply_updates(points, updates))
    return min(seen, key=lambda pair: pair[0])[1]

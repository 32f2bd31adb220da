"""Searches for the minimum of a sum of squares: three, each with one job.

Levenberg-Marquardt is the search of every fit.  It cannot end on a bound, so jaxopt's gradient
search in a box goes on where it ran into one.  Where it does not converge, optax moves many starts
together, and it searches again from the best.  The only file that imports jaxopt and optax.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import jaxopt
import numpy as np
import optax
from jax import Array
from numpy.typing import NDArray

from jbeamshell.identify.experiment import Evaluation
from jbeamshell.identify.problem import Problem

DAMPING = 1e-4  # first damping of a Gauss-Newton step, in parameters of equal influence
MAX_STEP = 1.0  # longest step along an axis of the search space, for most parameters a factor e
FLAT = 1e-6  # relative gain in cost below which a search has converged
REFUSED = 5  # steps in a row, each shorter than the last, that do not gain: the cost has a kink
SHORT = 0.01  # length of a step, of which a kink may refuse so many
ADAM_STEPS = 25
ADAM_RATE = 0.15  # step in the search space, where most parameters are logarithms

Vector = NDArray[np.float64]
Evaluate = Callable[[Vector], Evaluation]


class StoppingRule(NamedTuple):
    """Conditions that end a search.

    Attributes
    ----------
    max_iterations : largest number of iterations of each search
    tolerance : relative change of the parameters below which a search has converged
    noise_cost : cost that the measured noise alone leaves; gains far below it count as none.
        0 if the noise is unknown
    """

    max_iterations: int
    tolerance: float
    noise_cost: float = 0.0


class SearchResult(NamedTuple):
    """Point at which a search ended.

    Attributes
    ----------
    point : (n,) coordinates in the unbounded search space
    converged : False if it ran out of iterations
    """

    point: Vector
    converged: bool


def minimise(
    evaluate: Evaluate,
    start: Vector,
    stopping: StoppingRule,
    report: Callable[[int, Vector, float], None] | None = None,
) -> SearchResult:
    """Run one Levenberg-Marquardt search.

    The damping follows Nielsen (1999), Damping parameter in Marquardt's method.  In NumPy, because
    a search in JAX compiles some eighty small programs, which take longer than the runs.

    Parameters
    ----------
    evaluate : function that returns residual and Jacobian at a point (n,)
    start : (n,) first point
    stopping : conditions that end the search
    report : called after every step with its number, the point and the cost
    """
    # One damping for all axes is too strong for those with little influence: scale by influence.
    current, here = start, evaluate(start)
    influence = np.linalg.norm(here.jacobian, axis=0)
    scale = np.where(influence > 0.0, influence, 1.0)
    cost = 0.5 * float(here.residual @ here.residual)
    damping = DAMPING * float(np.max(np.sum((here.jacobian / scale) ** 2, axis=0), initial=0.0))
    growth, refused = 2.0, 0
    for step in range(1, stopping.max_iterations + 1):
        # The normal equations would square the condition number.
        jacobian = here.jacobian / scale
        rows = np.vstack([jacobian, np.sqrt(damping) * np.eye(start.size)])
        wanted = np.linalg.lstsq(rows, -np.append(here.residual, np.zeros(start.size)))[0]
        trial = current + np.clip(wanted / scale, -MAX_STEP, MAX_STEP)
        there = evaluate(trial)
        before, after = cost, 0.5 * float(there.residual @ there.residual)
        foreseen = 0.5 * wanted @ (damping * wanted - jacobian.T @ here.residual)
        gain = before - after
        taken = gain > 0.0 and bool(np.all(np.isfinite(there.jacobian)))
        if taken:
            current, here, cost = trial, there, after
            damping *= max(1.0 / 3.0, 1.0 - (2.0 * gain / foreseen - 1.0) ** 3)
            growth, refused = 2.0, 0
        else:
            damping, growth, refused = damping * growth, 2.0 * growth, refused + 1
        if report:
            report(step, current, 2.0 * cost)
        change = np.max(np.abs(wanted / scale), initial=0.0)
        flat = FLAT * max(before, 0.5 * stopping.noise_cost)
        kink = refused >= REFUSED and change < SHORT
        if change < stopping.tolerance or (taken and gain < flat) or kink:
            return SearchResult(current, True)
    return SearchResult(current, False)


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

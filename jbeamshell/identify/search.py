"""Searches for the minimum of a sum of squares.

The only file that imports jaxopt and optax.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jaxopt
import numpy as np
import optax
from jax import Array
from numpy.typing import NDArray

from jbeamshell.identify.problem import Evaluation, Problem
from jbeamshell.identify.search_space import SearchSpace

DAMPING = 1e-4  # first damping of a Gauss-Newton step, in parameters of equal influence
MAX_STEP = 1.0  # longest step along an axis of the search space, for most parameters a factor e
FLAT = 1e-6  # relative gain in cost below which a search has converged
ADAM_STEPS = 25
ADAM_RATE = 0.15  # step in the search space, where most parameters are logarithms

Vector = NDArray[np.float64]
Evaluate = Callable[[Vector], Evaluation]
Report = Callable[[int, int, Vector, float], None]


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
    status : "converged" or "max_iterations"
    """

    point: Vector
    status: str


def levenberg_marquardt(
    problem: Problem,
    space: SearchSpace,
    starts: Sequence[Vector],
    stopping: StoppingRule,
    report: Report,
) -> list[SearchResult]:
    """Search by Levenberg-Marquardt from every start, one after the other.

    Parameters
    ----------
    problem : residuals and their derivatives
    space : unbounded search space, n axes
    starts : points (n,) to start from
    stopping : conditions that end each search
    report : called after every step with the number of the search, the number of the step, the
        parameters (n,) and the cost
    """

    def search(number: int, start: Vector) -> SearchResult:
        def report_step(step: int, point: Vector, cost: float) -> None:
            report(number, step, space.values(point), cost)

        return minimise(lambda point: problem(space, point), start, stopping, report_step)

    return [search(number, start) for number, start in enumerate(starts, 1)]


def minimise(
    evaluate: Evaluate,
    start: Vector,
    stopping: StoppingRule,
    report: Callable[[int, Vector, float], None] | None = None,
) -> SearchResult:
    """Run one Levenberg-Marquardt search.

    Parameters
    ----------
    evaluate : function that returns residual and Jacobian at a point (n,)
    start : (n,) first point
    stopping : conditions that end the search
    report : called after every step with its number, the point and the cost
    """
    # One damping for all axes is too strong for those with little influence: scale by influence.
    influence = np.linalg.norm(evaluate(start).jacobian, axis=0)
    scale = np.where(influence > 0.0, influence, 1.0)
    current = start

    def limited(params: Any) -> Vector:
        """Trial point, at most `MAX_STEP` from the current one along every axis."""
        return current + np.clip(np.asarray(params) / scale - current, -MAX_STEP, MAX_STEP)

    # The last release of jaxopt ignores a given Jacobian where it materialises one, so the residual
    # brings its own derivative.
    @jax.custom_jvp
    def residual(params: Array) -> Array:
        return jnp.asarray(evaluate(limited(params)).residual)

    @residual.defjvp
    def _(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
        (params,), (tangent,) = primals, tangents
        evaluation = evaluate(limited(params))
        return jnp.asarray(evaluation.residual), jnp.asarray(evaluation.jacobian / scale) @ tangent

    method = jaxopt.LevenbergMarquardt(
        residual_fun=residual,
        materialize_jac=True,
        solver="qr",  # the normal equations would square the condition number
        damping_parameter=DAMPING,
        jit=False,
    )
    params: Any = jnp.asarray(start * scale)
    state = method.init_state(params)
    for step in range(1, stopping.max_iterations + 1):
        before = float(state.value)
        params, state = method.update(params, state)
        gain = before - float(state.value)  # zero if the step was refused
        if gain > 0.0:
            current = limited(params)
            params = jnp.asarray(current * scale)
        if report:
            report(step, current, 2.0 * float(state.value))
        change = np.max(np.abs(np.asarray(state.delta) / scale), initial=0.0)
        flat = FLAT * max(before, 0.5 * stopping.noise_cost)
        if change < stopping.tolerance or 0.0 < gain < flat:
            return SearchResult(current, "converged")
    return SearchResult(current, "max_iterations")


def l_bfgs_b(
    problem: Problem,
    space: SearchSpace,
    starts: Sequence[Vector],
    stopping: StoppingRule,
    report: Report,
) -> list[SearchResult]:
    """Search by L-BFGS-B from every start, in a box whose sides may be reached.

    Parameters and result as for `levenberg_marquardt`.
    """
    boxed, box = space.boxed()
    sides = tuple(map(jnp.asarray, box.T))

    def search(number: int, start: Vector) -> SearchResult:
        first = np.clip(boxed.point(space.values(start)), *box.T)
        scale = 1.0 / max(problem(boxed, first).cost, np.finfo(float).tiny)
        step = 0

        def value_and_gradient(params: Array) -> tuple[float, Vector]:
            at = problem(boxed, np.asarray(params))
            return scale * at.cost, 2.0 * scale * at.residual @ at.jacobian

        def report_step(params: Array) -> None:
            nonlocal step
            step, point = step + 1, np.asarray(params)
            report(number, step, boxed.values(point), problem(boxed, point).cost)

        method = jaxopt.ScipyBoundedMinimize(
            fun=value_and_gradient,
            value_and_grad=True,
            method="L-BFGS-B",
            maxiter=stopping.max_iterations,
            options={"ftol": stopping.tolerance**2, "gtol": stopping.tolerance},
            callback=report_step,
            jit=False,
        )
        params, state = method.run(jnp.asarray(first), bounds=sides)
        end = space.point(boxed.values(np.asarray(params)))
        return SearchResult(end, "converged" if bool(state.success) else "max_iterations")

    return [search(number, start) for number, start in enumerate(starts, 1)]


def adam(
    problem: Problem,
    space: SearchSpace,
    starts: Sequence[Vector],
    stopping: StoppingRule,
    report: Report,
) -> list[SearchResult]:
    """Search by Adam from all starts in one batch, then by Levenberg-Marquardt from the best point.

    Parameters as for `levenberg_marquardt`; the list holds one result.
    """
    optimiser = optax.adam(optax.cosine_decay_schedule(ADAM_RATE, ADAM_STEPS))
    points: Any = np.stack(starts)
    state = optimiser.init(points)
    seen = []
    for step in range(1, ADAM_STEPS + 1):
        evaluations = problem.batch(space, points)
        costs = [evaluation.cost for evaluation in evaluations]
        best = int(np.argmin(costs))
        seen.append((costs[best], points[best]))
        report(1, step, space.values(points[best]), costs[best])
        gradients = np.stack([at.residual @ at.jacobian for at in evaluations])
        updates, state = optimiser.update(gradients, state)
        points = np.asarray(optax.apply_updates(points, updates))
    _, start = min(seen, key=lambda pair: pair[0])
    return levenberg_marquardt(
        problem,
        space,
        [start],
        stopping,
        lambda _, step, *rest: report(1, ADAM_STEPS + step, *rest),
    )


SEARCHES = {"levenberg-marquardt": levenberg_marquardt, "l-bfgs-b": l_bfgs_b, "adam": adam}

"""Searches for the minimum of a sum of squares.

The only file that imports jaxopt and optax.
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

from jbeamshell.identify.parameters import Space
from jbeamshell.identify.problem import Point, Problem

DAMPING = 1e-4  # first damping, of a Gauss-Newton step in parameters of equal influence
REACH = 1.0  # of a step in the search space, for most parameters a factor e
FLAT = 1e-6  # relative gain in cost at which a search has settled
ADAM_STEPS = 25
ADAM_RATE = 0.15  # of the search space, where most parameters are logarithms

Vector = NDArray[np.float64]
Evaluate = Callable[[Vector], Point]
Report = Callable[[int, int, Vector, float], None]


class Limits(NamedTuple):
    """When a search ends.

    Attributes
    ----------
    iterations : most of each search
    tolerance : relative change of the parameters at which it has settled
    noise : cost that noise alone leaves, of which a small part is no gain; 0 where it is unknown
    """

    iterations: int
    tolerance: float
    noise: float = 0.0


class End(NamedTuple):
    """Where a search ended.

    Attributes
    ----------
    point : (n,) in the unbounded search space
    status : "converged" or "max_iterations"
    """

    point: Vector
    status: str


def levenberg_marquardt(
    problem: Problem, space: Space, starts: Sequence[Vector], limits: Limits, report: Report
) -> list[End]:
    """Ends of searches in the unbounded space, one from every start.

    ``report`` is called with the number of the search, its step, the values and the cost.
    """

    def search(number: int, start: Vector) -> End:
        def told(step: int, at: Vector, cost: float) -> None:
            report(number, step, space.values(at), cost)

        return minimise(lambda point: problem(space, point), start, limits, told)

    return [search(number, start) for number, start in enumerate(starts, 1)]


def minimise(
    evaluate: Evaluate,
    start: Vector,
    limits: Limits,
    report: Callable[[int, Vector, float], None] | None = None,
) -> End:
    """End of one Levenberg-Marquardt search.

    Parameters
    ----------
    evaluate : residual and Jacobian at a point (n,)
    start : (n,) point
    limits : when it ends
    report : called after every step with its number, the point and the cost
    """
    # One damping for all creeps where a parameter changes little: count each by its influence.
    influence = np.linalg.norm(evaluate(start).jacobian, axis=0)
    scale = np.where(influence > 0.0, influence, 1.0)
    here = start

    def within(params: Any) -> Vector:
        """Along every axis no further than it reaches: little-known parameters would run away."""
        return here + np.clip(np.asarray(params) / scale - here, -REACH, REACH)

    method = jaxopt.LevenbergMarquardt(
        residual_fun=lambda p: jnp.asarray(evaluate(within(p)).residual),
        materialize_jac=True,
        solver="qr",  # the normal equations would square the condition
        damping_parameter=DAMPING,
        jit=False,
    )
    # Its last release forgets a jac_fun argument when the Jacobian is materialised.
    method._jac_fun = lambda p: jnp.asarray(evaluate(within(p)).jacobian / scale)
    params: Any = jnp.asarray(start * scale)
    state = method.init_state(params)
    for step in range(1, limits.iterations + 1):
        before = float(state.value)
        params, state = method.update(params, state)
        gained = before - float(state.value)  # nothing when the step was refused
        if gained > 0.0:
            here = within(params)
            params = jnp.asarray(here * scale)
        if report:
            report(step, here, 2.0 * float(state.value))
        change = np.max(np.abs(np.asarray(state.delta) / scale), initial=0.0)
        flat = FLAT * max(before, 0.5 * limits.noise)
        if change < limits.tolerance or 0.0 < gained < flat:
            return End(here, "converged")
    return End(here, "max_iterations")


def l_bfgs_b(
    problem: Problem, space: Space, starts: Sequence[Vector], limits: Limits, report: Report
) -> list[End]:
    """Ends of searches in a box, whose sides they may reach, one from every start."""
    straight, box = space.straight()
    sides = tuple(map(jnp.asarray, box.T))

    def search(number: int, start: Vector) -> End:
        begin = np.clip(straight.point(space.values(start)), *box.T)
        scale = 1.0 / max(problem(straight, begin).cost, np.finfo(float).tiny)
        step = 0

        def value_and_gradient(params: Array) -> tuple[float, Vector]:
            point = problem(straight, np.asarray(params))
            return scale * point.cost, 2.0 * scale * point.residual @ point.jacobian

        def told(params: Array) -> None:
            nonlocal step
            step, at = step + 1, np.asarray(params)
            report(number, step, straight.values(at), problem(straight, at).cost)

        method = jaxopt.ScipyBoundedMinimize(
            fun=value_and_gradient,
            value_and_grad=True,
            method="L-BFGS-B",
            maxiter=limits.iterations,
            options={"ftol": limits.tolerance**2, "gtol": limits.tolerance},
            callback=told,
            jit=False,
        )
        params, state = method.run(jnp.asarray(begin), bounds=sides)
        end = space.point(straight.values(np.asarray(params)))
        return End(end, "converged" if bool(state.success) else "max_iterations")

    return [search(number, start) for number, start in enumerate(starts, 1)]


def adam(
    problem: Problem, space: Space, starts: Sequence[Vector], limits: Limits, report: Report
) -> list[End]:
    """The best of all starts, which go down side by side in one batch, settled by Marquardt."""
    optimiser = optax.adam(optax.cosine_decay_schedule(ADAM_RATE, ADAM_STEPS))
    points: Any = np.stack(starts)
    state = optimiser.init(points)
    seen = []
    for step in range(1, ADAM_STEPS + 1):
        answers = problem.together(space, points)
        costs = [answer.cost for answer in answers]
        best = int(np.argmin(costs))
        seen.append((costs[best], points[best]))
        report(1, step, space.values(points[best]), costs[best])
        gradients = np.stack([answer.residual @ answer.jacobian for answer in answers])
        updates, state = optimiser.update(gradients, state)
        points = np.asarray(optax.apply_updates(points, updates))
    settled = min(seen, key=lambda pair: pair[0])[1]
    return levenberg_marquardt(
        problem,
        space,
        [settled],
        limits,
        lambda _, step, *rest: report(1, ADAM_STEPS + step, *rest),
    )


SEARCHES = {"levenberg-marquardt": levenberg_marquardt, "l-bfgs-b": l_bfgs_b, "adam": adam}

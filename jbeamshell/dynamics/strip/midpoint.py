r"""Implicit time steps with the quasi-static friction law: one Newton solve per step.

The steps belong to the one-parameter family of second-order, A-stable two-step methods (Dahlquist
1963),

    z_1 - z_0 = h f(z*),    z* = (z_0 + z_1)/2 + g (z_1 - 2 z_0 + z_-1).

g = 0 is the midpoint rule.  It conserves the energy of a linear strip, but vibrations too fast for
the step never decay; they disturb the reaction most, and with it friction.  A small g > 0 reduces
them by the factor sqrt(g/(g + 1/2)) in a step, and damps vibrations that the step resolves by
only g (omega h)^3/2 of critical.  With fields q, rates p, the increment d = h p* of q and the
friction traction t,

    M (p_1 - p_0)/h + dPi/dq(q*) + l t = F du(L)/dq + ...,

where t is the friction law's traction after the motion from q* of the last step to q* of this one,
under the cap mu R from elasticity and inertia at q*.  Sharp sliders need no smoothing.  The fields
are the only unknowns, so a time step has the solver, the tangent and the derivatives of a load
step.

Solvers of differential equations need a friction law with a rate instead.  In four cycles of a
strip of 49 nodes, 12,800 of these steps take 2.5 s to an error of 3e-4 of u(L); diffrax's Bosh3
takes 5.4 s to 4e-4, Tsit5 24 s to 4e-3, and Kvaerno3 22 s to 1e-3.
"""

from __future__ import annotations

from typing import Any, ClassVar

import diffrax
import equinox as eqx
import jax.numpy as jnp
from jax import Array

from jbeamshell.dynamics.strip.equations import MotionState
from jbeamshell.dynamics.strip.step_equations import (
    StepEquations,
    StepForces,
    StepMatrices,
    StepMemory,
    TimeStep,
)
from jbeamshell.load_steps.system import V
from jbeamshell.load_steps.tangent import nodal
from jbeamshell.mechanics.friction import coulomb_cap
from jbeamshell.numerics.newton import Newton, Problem

FILTERING = 0.1  # parameter g


class Midpoint(diffrax.AbstractSolver):
    """Solver of diffrax with steps of one size; ``args`` are `StepMatrices`, terms are not used."""

    newton: Newton = eqx.field(default_factory=Newton)
    term_structure: ClassVar = diffrax.AbstractTerm
    interpolation_cls: ClassVar = diffrax.LocalLinearInterpolation

    def order(self, terms: Any) -> int:
        """Order of convergence."""
        return 2

    def init(self, terms: Any, t0: Any, t1: Any, y0: MotionState, args: StepMatrices) -> StepMemory:
        """Memory before the first step."""
        equations, zero = args.equations, jnp.zeros_like(y0.q)
        _, reaction = equations.response(jnp.asarray(t0), y0)
        cap = coulomb_cap(equations.system.foundation.friction, reaction)
        started = jnp.zeros_like(y0.work[0])
        return StepMemory(equations.system.embed(y0.q)[:, V], y0.t, cap, zero, zero, started)

    def func(self, terms: Any, t0: Any, y0: MotionState, args: StepMatrices) -> Any:
        """Not needed, as no step depends on rates."""
        raise NotImplementedError

    def step(
        self,
        terms: Any,
        t0: Any,
        t1: Any,
        y0: MotionState,
        args: StepMatrices,
        solver_state: StepMemory,
        made_jump: Any,
    ) -> Any:
        """One step; it fails if Newton's method does not converge."""
        step = TimeStep(t0, t1 - t0, 0.5 + FILTERING * solver_state.started)
        y1, memory, converged = take_step(args, step, y0, solver_state, self.newton)
        result = diffrax.RESULTS.where(
            converged, diffrax.RESULTS.successful, diffrax.RESULTS.nonlinear_divergence
        )
        return y1, None, {"y0": y0, "y1": y1}, memory, result


def take_step(
    matrices: StepMatrices, step: TimeStep, state: MotionState, last: StepMemory, newton: Newton
) -> tuple[MotionState, StepMemory, Array]:
    """State and memory after a step, and True if Newton's method has converged."""
    equations, system = matrices.equations, matrices.equations.system
    of_step = StepEquations.of(equations, step, state, last)
    problem = Problem(of_step.evaluate, of_step.limit, of_step.tangent)
    root, (_, error) = newton.solve(problem, of_step.guess, matrices.stiffness(step))
    at, prescribed = of_step.forces(root), of_step.prescribed
    response = system.contact_response(at.contact, of_step.before, prescribed)
    change = nodal(system, root)
    rate_change = step.increment(change / step.h, state.p, last.rate_change)
    memory = StepMemory(
        v=at.q[:, V],
        traction=response.traction,
        cap=system.foundation.cap(response.reaction),
        change=change,
        rate_change=rate_change,
        started=jnp.ones_like(last.started),
    )
    # The tractions at the end of the step follow from the motion between q* and the end.
    middle = of_step.before._replace(q=at.q, traction=response.traction)
    moved = system.embed(change)
    end = at.contact._replace(v=(of_step.q + moved)[:, V])
    traction = system.contact_response(end, middle, prescribed).traction
    work = _work(of_step, at, state.t, moved, (response.traction, traction))
    after = MotionState(state.q + change, state.p + rate_change, traction, state.work + work)
    return after, memory, error <= newton.tolerance_for(system.x.dtype)


def _work(
    of_step: StepEquations, at: StepForces, begun: Array, moved: Array, tractions: tuple[Array, ...]
) -> Array:
    """External work and work lost by friction and by damping in a step, (3,).

    Parameters
    ----------
    of_step, at : equations of the step, and forces at its solution
    begun : (n,) friction tractions at its start
    moved : (n, m) increments of the fields
    tractions : (n,) friction tractions at q* and at the end of the step
    """
    system, q = of_step.system, of_step.q
    end_moved = system.end_displacement(q + moved) - system.end_displacement(q)
    external = of_step.force * end_moved - jnp.sum(of_step.ground_forces * moved)
    stored = (tractions[1] ** 2 - begun**2) / (2.0 * system.foundation.slip_stiffness)
    friction = jnp.sum(system.tributary * (tractions[0] * moved[:, V] - stored))
    return jnp.stack([external, friction, jnp.sum(at.damping * moved)])

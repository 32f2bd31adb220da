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
"""

from __future__ import annotations

from typing import Any, ClassVar

import diffrax
import equinox as eqx
import jax.numpy as jnp
from jax import Array

from jbeamshell.dynamics.strip.chain import stretches
from jbeamshell.dynamics.strip.equations import MotionState
from jbeamshell.dynamics.strip.step_equations import StepEquations, StepForces, StepMatrices
from jbeamshell.dynamics.strip.time_step import StepMemory, TimeStep
from jbeamshell.load_steps.system import V
from jbeamshell.load_steps.tangent import nodal
from jbeamshell.numerics.newton import Newton, Problem

FILTERING = 0.1


class Midpoint(diffrax.AbstractSolver):
    """Solver of diffrax with steps of one size; ``args`` are `StepMatrices`.

    Attributes
    ----------
    newton : settings of Newton's method
    filtering : parameter g
    """

    newton: Newton = eqx.field(default_factory=Newton)
    filtering: float = FILTERING
    term_structure: ClassVar = diffrax.AbstractTerm
    interpolation_cls: ClassVar = diffrax.LocalLinearInterpolation

    def order(self, terms: Any) -> int:
        """Order of convergence."""
        return 2

    def init(self, terms: Any, t0: Any, t1: Any, y0: MotionState, args: StepMatrices) -> StepMemory:
        """Memory before the first step."""
        equations = args.equations
        n, cap = equations.n, equations.response(jnp.asarray(t0), y0).cap
        zero = jnp.zeros_like(y0.q)
        started = jnp.zeros_like(y0.work[0])
        return StepMemory(equations.nodal(y0.q)[:, V], y0.t[:n], cap, zero, zero, started)

    def func(self, terms: Any, t0: Any, y0: MotionState, args: StepMatrices) -> MotionState:
        """Rates of a state, which diffrax may need for a first step."""
        return args.equations(t0, y0)

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
        step = TimeStep(t0, t1 - t0, 0.5 + self.filtering * solver_state.started)
        y1, memory, converged = take_step(args, step, y0, solver_state, self.newton)
        result = diffrax.RESULTS.where(
            converged, diffrax.RESULTS.successful, diffrax.RESULTS.nonlinear_divergence
        )
        return y1, None, {"y0": y0, "y1": y1}, memory, result


def take_step(
    matrices: StepMatrices, step: TimeStep, state: MotionState, last: StepMemory, newton: Newton
) -> tuple[MotionState, StepMemory, Array]:
    """State and memory after a step, and True if Newton's method has converged."""
    equations, system, n = matrices.equations, matrices.equations.system, matrices.equations.n
    of_step = StepEquations.of(equations, step, state, last)
    root, (_, error) = newton.solve(
        Problem(of_step.evaluate, of_step.limit, of_step.tangent),
        of_step.guess,
        matrices.stiffness(step, of_step.chain.force_slope, of_step.q),
    )
    at = of_step.forces(root)
    response = system.contact_response(at.contact, of_step.before, at.prescribed)
    nodal_change = system.embed(nodal(system, root))
    end_change = of_step.end_change(nodal_change)
    chain_change = of_step.chain.change + of_step.chain.change_slope * end_change
    change = equations.with_chain(nodal_change, chain_change)
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
    end = at.contact._replace(v=(of_step.q + nodal_change)[:, V])
    traction = system.contact_response(end, middle, at.prescribed).traction
    work = _work(of_step, at, state, change, (response.traction, traction))
    after = MotionState(
        state.q + change,
        state.p + rate_change,
        jnp.append(traction, state.t[n:]),
        state.work + work,
    )
    return after, memory, error <= newton.tolerance_for(system.x.dtype)


def _work(
    of_step: StepEquations,
    at: StepForces,
    state: MotionState,
    change: Array,
    tractions: tuple[Array, Array],
) -> Array:
    """External work and work lost by friction and by damping in a step, (3,).

    Parameters
    ----------
    of_step, at : equations of the step, and forces at its solution
    state : state at its start
    change : (b, a) increments of the active fields
    tractions : (n,) friction tractions at q* and at the end of the step
    """
    equations, system, step = of_step.equations, of_step.equations.system, of_step.step
    attached, n = equations.attached, equations.n
    nodal_change, chain_change = equations.nodal(change), change[n:, 0]
    end_change = of_step.end_change(nodal_change)
    external = of_step.force * end_change - jnp.sum(of_step.ground_forces * nodal_change)
    external = external - of_step.ground * jnp.sum(attached.masses * chain_change)
    stored = (tractions[1] ** 2 - state.t[:n] ** 2) / (2.0 * system.foundation.slip_stiffness)
    friction = jnp.sum(system.tributary * (tractions[0] * nodal_change[:, V] - stored))
    dashpots = jnp.sum(attached.dampers * stretches(end_change, chain_change) ** 2) / step.h
    return jnp.stack([external, friction, jnp.sum(at.damping * nodal_change) + dashpots])

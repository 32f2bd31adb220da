r"""Implicit time steps with the quasi-static friction law: one Newton solve per step.

Of the one-parameter family of second-order, A-stable two-step methods (Dahlquist 1963),

    z_1 - z_0 = h f(z*),    z* = (z_0 + z_1)/2 + g (z_1 - 2 z_0 + z_-1),

g = 0 is the midpoint rule, which keeps the energy of a linear strip, and lets vibrations too fast
for the step ring for ever, in the reaction above all, which friction feels.  A small g > 0 damps
those by sqrt(g/(g + 1/2)) a step, and what the step resolves by g (omega h)^3/2 of critical only.
With fields q, rates p, the increment d = h p* of q and the traction t of friction,

    M (p_1 - p_0)/h + dPi/dq(q*) + l t = F du(L)/dq + ...,

where t is the law's answer to the motion from q* of the last step to that of this one, under the
cap mu R of elasticity and inertia at q*.  Sharp sliders are as good as smooth ones, and the
unknowns are the fields alone: the solver, its tangent and its derivatives are a load step's.
"""

from __future__ import annotations

from typing import Any, ClassVar

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.dynamics.strip.equations import Equations, MotionState
from jbeamshell.dynamics.strip.time_step import ChainPull, StepMemory, TimeStep
from jbeamshell.numerics import block_tridiagonal
from jbeamshell.numerics.block_tridiagonal import BlockTridiagonal
from jbeamshell.numerics.newton import Newton, Problem
from jbeamshell.quasistatic.system import ContactInput, LoadLevel, Prescribed, V, W
from jbeamshell.quasistatic.tangent import (
    Stiffness,
    block_of_node,
    in_blocks,
    initial_stiffness,
    matrix,
    nodal,
    residual_in_blocks,
    with_v,
    zero_unknowns,
)

FILTERING = 0.1


class Midpoint(diffrax.AbstractSolver):
    """Diffrax's interface to the method; ``args`` are a `Prepared`, and steps of one size.

    Attributes
    ----------
    newton : settings of Newton's method
    filtering : g
    """

    newton: Newton = eqx.field(default_factory=Newton)
    filtering: float = FILTERING
    term_structure: ClassVar = diffrax.AbstractTerm
    interpolation_cls: ClassVar = diffrax.LocalLinearInterpolation

    def order(self, terms: Any) -> int:
        """Second."""
        return 2

    def init(self, terms: Any, t0: Any, t1: Any, y0: MotionState, args: Prepared) -> StepMemory:
        """Before the first step."""
        n, cap = args.equations.n, args.equations.response(jnp.asarray(t0), y0).cap
        none = jnp.zeros_like(y0.q)
        begun = jnp.zeros_like(y0.work[0])
        return StepMemory(args.equations.nodal(y0.q)[:, V], y0.t[:n], cap, none, none, begun)

    def func(self, terms: Any, t0: Any, y0: MotionState, args: Prepared) -> MotionState:
        """The vector field, which diffrax may ask for a first step."""
        return args.equations(t0, y0)

    def step(
        self,
        terms: Any,
        t0: Any,
        t1: Any,
        y0: MotionState,
        args: Prepared,
        solver_state: StepMemory,
        made_jump: Any,
    ) -> Any:
        """One step; fails where Newton's method does."""
        stride = TimeStep(t0, t1 - t0, 0.5 + self.filtering * solver_state.begun)
        y1, halfway, sound = args.step(stride, y0, solver_state, self.newton)
        result = diffrax.RESULTS.where(
            sound, diffrax.RESULTS.successful, diffrax.RESULTS.nonlinear_divergence
        )
        return y1, None, {"y0": y0, "y1": y1}, halfway, result


class Prepared(eqx.Module):
    """What all steps of a motion share.

    Attributes
    ----------
    equations : of motion
    static : the stiffness of a load step
    inertial : (3, size, size, blocks) the same entries of the mass matrix
    heaving : (3, size, n) forces of inertia along w per unknown
    """

    equations: Equations
    static: Stiffness
    inertial: Array
    heaving: Array

    def __init__(self, equations: Equations) -> None:
        self.equations, system = equations, equations.system
        self.static = initial_stiffness(system, 1.0)
        like, rest = zero_unknowns(system), system.unloaded().q

        def carried(unknown: Array) -> Array:
            return equations.masses.momentum(rest, system.embed(nodal(system, unknown)))

        def rows(unknown: Array) -> Array:
            weighed = carried(unknown) * self._per_force
            moving = jnp.where(equations.moves, weighed[:, list(system.model.active)], 0.0)
            return in_blocks(moving, like)

        self.inertial = jnp.stack(block_tridiagonal.jacobian(rows, like))
        probes = jnp.asarray(block_tridiagonal.seeds(like))
        block = block_of_node(system)
        along = jax.vmap(jax.vmap(lambda unit: carried(unit)[:, W]))(probes)
        near = block_tridiagonal.by_neighbour(along, block)
        near = near.at[0, :, block == 0].set(0.0)
        self.heaving = near.at[2, :, block == block[-1]].set(0.0)

    @property
    def _per_force(self) -> Array:
        """Residual per force, (m,)."""
        system = self.equations.system
        return jnp.stack([system.residual_scale(field) for field in range(system.model.width)])

    def step(
        self, stride: TimeStep, state: MotionState, last: StepMemory, newton: Newton
    ) -> tuple[MotionState, StepMemory, Array]:
        """The state after a step, what it hands on, and whether equilibrium was found."""
        equations, system, n = self.equations, self.equations.system, self.equations.n
        h, shaken = stride.h, stride.mean(equations.excitation.acceleration)
        acting = stride.mean(equations.excitation.force)
        q0, p0 = equations.nodal(state.q), equations.nodal(state.p)
        ago, gained = equations.nodal(last.change), equations.nodal(last.gain)
        before = LoadLevel(q0.at[:, V].set(last.v), last.traction, last.cap, last.cap, last.cap[0])
        end0 = system.end_displacement(q0)
        drawn = system.end_displacement(stride.reached(q0, jnp.zeros_like(q0), ago)) - end0
        ride = self._ride(stride, state, last, end0 + drawn, shaken[0])
        pushed = jnp.zeros_like(q0).at[:, V].set(shaken[0]).at[:, W].set(shaken[1])
        carried = equations.masses.momentum(q0, pushed)
        like = zero_unknowns(system)

        def parts(unknown: Array) -> tuple[Array, ContactInput, Array, Array, Prescribed]:
            change = system.embed(nodal(system, unknown))
            half, rate = stride.reached(q0, change, ago), change / h
            gain = stride.gain(rate, p0, gained)
            inertia = equations.masses.step_forces(q0, p0, change, gain, half, h)
            damping = equations.damping(half, rate)
            forces = system.elastic_forces(half, 1.0) + inertia + damping + carried
            moved = system.end_displacement(q0 + change) - end0
            prescribed = _prescribed(acting + ride.still + ride.slope * moved)
            contact = ContactInput(forces[:, W], half[:, V], half[:, W])
            return forces, contact, half, damping, prescribed

        def evaluate(unknown: Array) -> tuple[Array, ContactInput]:
            forces, contact, half, _, prescribed = parts(unknown)
            response = system.contact_response(contact, before, prescribed)
            residual = system.balance(forces, half, response, prescribed)[1]
            return residual_in_blocks(residual, unknown, stride.part), contact

        stiffness = self._stiffness(stride, ride.slope, q0)

        def tangent(contact: ContactInput, stiffness: Stiffness) -> BlockTridiagonal:
            return matrix(system, stiffness, contact, before, _prescribed(jnp.zeros_like(end0)))

        def limit(old: Array, new: Array) -> Array:
            here = stride.reached(q0, jnp.zeros_like(q0), ago)[:, V] - last.v
            slip, was = (here + stride.part * nodal(system, x)[:, V] for x in (new, old))
            limited = system.foundation.limited_slip(was, slip, last.traction, last.cap)
            return with_v(system, new, nodal(system, new)[:, V] + (limited - slip) / stride.part)

        guess = in_blocks(h * p0[:, list(system.model.active)], like)
        root, (_, error) = newton.solve(Problem(evaluate, limit, tangent), guess, stiffness)
        _, contact, half, damping, prescribed = parts(root)
        response = system.contact_response(contact, before, prescribed)
        change = nodal(system, root)
        chain = ride.first + ride.each * (system.end_displacement(q0 + system.embed(change)) - end0)
        moved = equations.joined(system.embed(change), chain)
        gain = stride.gain(moved / h, state.p, last.gain)
        now = StepMemory(
            v=half[:, V],
            traction=response.traction,
            cap=system.foundation.cap(response.reaction),
            change=moved,
            gain=gain,
            begun=jnp.ones_like(last.begun),
        )
        # At the end of the step the sliders stand where the motion since q* takes them.
        from_here = before._replace(q=half, traction=now.traction)
        end = contact._replace(v=(q0 + system.embed(change))[:, V])
        onward = system.contact_response(end, from_here, prescribed).traction
        work = self._work(stride, state, moved, (response.traction, onward), damping, carried)
        after = MotionState(
            state.q + moved,
            state.p + gain,
            jnp.append(onward, state.t[n:]),
            state.work + work,
        )
        return after, now, error <= newton.tolerance_for(system.x.dtype)

    def _stiffness(self, stride: TimeStep, slope: Array, q: Array) -> Stiffness:
        """The tangent's part that hardly changes."""
        equations, static, inertia = self.equations, self.static, self.equations.inertia
        elastic, massive = stride.part, 1.0 / (stride.part * jnp.square(stride.h))
        if inertia.damped:
            elastic = elastic + inertia.damping_stiffness / stride.h
            massive = massive + inertia.damping_mass / stride.h
        entries = elastic * static.entries + massive * self.inertial
        conjugate = equations.conjugate(q)
        active = np.array(equations.system.model.active)
        held = slope * conjugate[active, None] * conjugate[active]
        held = held * self._per_force[active, None]
        entries = entries.at[1, -active.size :, -active.size :, -1].add(-held)
        lift_force, v, w = static.contact
        lift_force = elastic * lift_force + massive * self.heaving
        contact = ContactInput(lift_force, stride.part * v, stride.part * w)
        return Stiffness(entries, contact, static.response)

    def _ride(
        self, stride: TimeStep, state: MotionState, last: StepMemory, end: Array, shaken: Array
    ) -> ChainPull:
        """How the chain answers during a step; ``end`` is u(L) at z* of an end that stands."""
        attached, n = self.equations.attached, self.equations.n
        z, rate = state.q[n:, 0], state.p[n:, 0]
        if not attached.count:
            nothing = jnp.zeros_like(end)
            return ChainPull(nothing, nothing, z, z)

        def forces(change: Array, moved: Array) -> Array:
            """Of the springs and dashpots."""
            at = stride.reached(z, change, last.change[n:, 0])
            stretch = jnp.diff(jnp.append(end + stride.part * moved, at))
            drawn = jnp.diff(jnp.append(moved, change))
            return attached.springs * stretch + attached.dampers * drawn / stride.h

        def residual(change: Array, moved: Array) -> Array:
            held = forces(change, moved)
            gain = stride.gain(change / stride.h, rate, last.gain[n:, 0])
            return attached.masses * (gain / stride.h + shaken) + held - jnp.append(held[1:], 0.0)

        still, none = jnp.zeros_like(z), jnp.zeros_like(end)
        system = jax.jacfwd(residual)(still, none)
        left = residual(still, none)
        first = -jnp.linalg.solve(system, left)
        each = -jnp.linalg.solve(system, residual(still, none + 1.0) - left)
        begin = forces(first, none)[0]
        return ChainPull(begin, forces(first + each, none + 1.0)[0] - begin, first, each)

    def _work(
        self,
        stride: TimeStep,
        state: MotionState,
        moved: Array,
        tractions: tuple[Array, Array],
        damping: Array,
        carried: Array,
    ) -> Array:
        """Work from outside, of friction (at q*, at the end) and of damping in a step, (3,)."""
        equations, system, n = self.equations, self.equations.system, self.equations.n
        attached, excitation = equations.attached, equations.excitation
        q0, change, (acts, onward) = equations.nodal(state.q), equations.nodal(moved), tractions
        end = system.end_displacement(q0 + change) - system.end_displacement(q0)
        given = stride.mean(excitation.force) * end - jnp.sum(carried * change)
        shaken = stride.mean(excitation.acceleration)[0]
        given = given - shaken * jnp.sum(attached.masses * moved[n:, 0])
        kept = (onward**2 - state.t[:n] ** 2) / (2.0 * system.foundation.slip_stiffness)
        rubbed = jnp.sum(system.tributary * (acts * change[:, V] - kept))
        drawn = jnp.diff(jnp.append(end, moved[n:, 0]))
        warmed = jnp.sum(damping * change) + jnp.sum(attached.dampers * drawn**2) / stride.h
        return jnp.stack([given, rubbed, warmed])


def _prescribed(force: Array) -> Prescribed:
    one = jnp.ones_like(force)
    return Prescribed(force, one, jnp.zeros_like(force), one)

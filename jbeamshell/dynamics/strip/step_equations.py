"""Equations of one time step of `jbeamshell.dynamics.strip.midpoint`, and their tangent."""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.dynamics.strip.chain import ChainStep, chain_step
from jbeamshell.dynamics.strip.equations import Equations, MotionState
from jbeamshell.dynamics.strip.time_step import StepMemory, TimeStep
from jbeamshell.load_steps.system import ContactInput, LoadLevel, Prescribed, System, V, W
from jbeamshell.load_steps.tangent import (
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
from jbeamshell.numerics import block_tridiagonal
from jbeamshell.numerics.block_tridiagonal import BlockTridiagonal


class StepMatrices(eqx.Module):
    """Equations of motion with the matrices that all time steps share.

    Attributes
    ----------
    equations : equations of motion
    static : stiffness of a load step
    mass : (3, size, size, blocks) entries of the mass matrix, see `Stiffness`
    mass_along_w : (3, size, n) inertia forces along w per unknown
    """

    equations: Equations
    static: Stiffness
    mass: Array
    mass_along_w: Array

    def __init__(self, equations: Equations) -> None:
        self.equations, system = equations, equations.system
        self.static = initial_stiffness(system, 1.0)
        like, q = zero_unknowns(system), system.unloaded().q
        scales = _residual_scales(system)

        def inertia_forces(unknown: Array) -> Array:
            return equations.mass.momentum(q, system.embed(nodal(system, unknown)))

        def rows(unknown: Array) -> Array:
            residual = (inertia_forces(unknown) * scales)[:, list(system.plan.active)]
            return in_blocks(jnp.where(equations.mass.free, residual, 0.0), like)

        self.mass = jnp.stack(block_tridiagonal.jacobian(rows, like))
        probes = jnp.asarray(block_tridiagonal.seeds(like))
        block = block_of_node(system)
        along_w = jax.vmap(jax.vmap(lambda unit: inertia_forces(unit)[:, W]))(probes)
        neighbours = block_tridiagonal.by_neighbour(along_w, block)
        neighbours = neighbours.at[0, :, block == 0].set(0.0)
        self.mass_along_w = neighbours.at[2, :, block == block[-1]].set(0.0)

    def stiffness(self, step: TimeStep, end_slope: Array, q: Array) -> Stiffness:
        """Part of the tangent without the foundation's response, at fields q (n, m).

        Parameters
        ----------
        step : time step
        end_slope : slope of the end force over u(L)
        q : fields at the start of the step
        """
        equations, static, inertia = self.equations, self.static, self.equations.inertia
        elastic, massive = step.weight, 1.0 / (step.weight * jnp.square(step.h))
        if inertia.damped:
            elastic = elastic + inertia.damping_stiffness / step.h
            massive = massive + inertia.damping_mass / step.h
        entries = elastic * static.entries + massive * self.mass
        conjugate = equations.end_conjugate(q)
        active = np.array(equations.system.plan.active)
        end = end_slope * conjugate[active, None] * conjugate[active]
        end = end * _residual_scales(equations.system)[active, None]
        entries = entries.at[1, -active.size :, -active.size :, -1].add(-end)
        lift_force = elastic * static.contact.lift_force + massive * self.mass_along_w
        contact = ContactInput(
            lift_force, step.weight * static.contact.v, step.weight * static.contact.w
        )
        return Stiffness(entries, contact, static.response)


class StepForces(NamedTuple):
    """Forces and contact in a time step, at q*.

    Attributes
    ----------
    q : (n, m) fields q*
    forces, damping : (n, m) all forces but those of the foundation and the end; those of damping
    contact : input of the foundation
    prescribed : end force, by which a load step's equations hold for a time step
    """

    q: Array
    forces: Array
    damping: Array
    contact: ContactInput
    prescribed: Prescribed


class StepEquations(NamedTuple):
    """Equations of one time step, whose unknowns are the increments of the active fields.

    Attributes
    ----------
    equations : equations of motion
    step : time step
    q, p : (n, m) fields and rates at the start of the step
    end : u(L) at the start of the step
    last_change, last_rate_change : (n, m) increments of fields and rates in the last step
    before : friction at q* of the last step
    force, ground : means of the end force and of the foundation's acceleration along X
    ground_forces : (n, m) inertia forces from the acceleration of the foundation
    chain : response of the chain
    """

    equations: Equations
    step: TimeStep
    q: Array
    p: Array
    end: Array
    last_change: Array
    last_rate_change: Array
    before: LoadLevel
    force: Array
    ground: Array
    ground_forces: Array
    chain: ChainStep

    @classmethod
    def of(
        cls, equations: Equations, step: TimeStep, state: MotionState, last: StepMemory
    ) -> StepEquations:
        """Equations of a step from a state, with the memory of the last step."""
        system, n = equations.system, equations.n
        q, last_change = equations.nodal(state.q), equations.nodal(last.change)
        ground = step.gauss_mean(equations.excitation.acceleration)
        end = system.end_displacement(q)
        moved = system.end_displacement(step.evaluated(q, jnp.zeros_like(q), last_change)) - end
        chain = chain_step(
            equations.attached,
            step,
            end + moved,
            (state.q[n:, 0], state.p[n:, 0]),
            (last.change[n:, 0], last.rate_change[n:, 0]),
            ground[0],
        )
        return cls(
            equations=equations,
            step=step,
            q=q,
            p=equations.nodal(state.p),
            end=end,
            last_change=last_change,
            last_rate_change=equations.nodal(last.rate_change),
            before=LoadLevel(
                q.at[:, V].set(last.v), last.traction, last.cap, last.cap, last.cap[0]
            ),
            force=step.gauss_mean(equations.excitation.force),
            ground=ground[0],
            ground_forces=equations.ground_forces(q, ground),
            chain=chain,
        )

    @property
    def guess(self) -> Array:
        """Unknowns (blocks, size) of a motion at constant rates."""
        system = self.equations.system
        change = self.step.h * self.p[:, list(system.plan.active)]
        return in_blocks(change, zero_unknowns(system))

    def end_change(self, change: Array) -> Array:
        """Increment of u(L) from increments (n, m) of the fields."""
        return self.equations.system.end_displacement(self.q + change) - self.end

    def forces(self, unknown: Array) -> StepForces:
        """Forces and contact of a step with unknowns (blocks, size)."""
        equations, system, step = self.equations, self.equations.system, self.step
        change = system.embed(nodal(system, unknown))
        q, rate = step.evaluated(self.q, change, self.last_change), change / step.h
        rate_change = step.increment(rate, self.p, self.last_rate_change)
        inertia = equations.mass.step_forces(self.q, self.p, change, rate_change, q, step.h)
        damping = equations.damping(q, rate)
        forces = system.elastic_forces(q, 1.0) + inertia + damping + self.ground_forces
        end_force = self.force + self.chain.force + self.chain.force_slope * self.end_change(change)
        contact = ContactInput(forces[:, W], q[:, V], q[:, W])
        return StepForces(q, forces, damping, contact, _prescribed(end_force))

    def evaluate(self, unknown: Array) -> tuple[Array, ContactInput]:
        """Residual (blocks, size), and the input of the foundation."""
        system, at = self.equations.system, self.forces(unknown)
        response = system.contact_response(at.contact, self.before, at.prescribed)
        residual = system.balance(at.forces, at.q, response, at.prescribed)[1]
        return residual_in_blocks(residual, unknown, self.step.weight), at.contact

    def tangent(self, contact: ContactInput, stiffness: Stiffness) -> BlockTridiagonal:
        """Matrix of the residual."""
        prescribed = _prescribed(jnp.zeros_like(self.force))
        return matrix(self.equations.system, stiffness, contact, self.before, prescribed)

    def limit(self, old: Array, new: Array) -> Array:
        """Next iterate, with slips limited by the friction law; see `Foundation.limited_slip`."""
        system, step = self.equations.system, self.step
        start = step.evaluated(self.q, jnp.zeros_like(self.q), self.last_change)[:, V]
        start = start - self.before.q[:, V]
        slip, old_slip = (start + step.weight * nodal(system, x)[:, V] for x in (new, old))
        limited = system.foundation.limited_slip(
            old_slip, slip, self.before.traction, self.before.cap
        )
        return with_v(system, new, nodal(system, new)[:, V] + (limited - slip) / step.weight)


def _residual_scales(system: System) -> Array:
    """Residual per force or moment (m,) of every field's balance."""
    return jnp.stack([system.residual_scale(field) for field in range(system.plan.width)])


def _prescribed(force: Array) -> Prescribed:
    """Load step under an end force, with all pressures and with friction."""
    one = jnp.ones_like(force)
    return Prescribed(force, one, jnp.zeros_like(force), one)

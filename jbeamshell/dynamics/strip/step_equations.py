r"""Equations of one time step of `jbeamshell.dynamics.strip.midpoint`, and their tangent."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.dynamics.strip.equations import Equations, MotionState
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
from jbeamshell.mechanics.kinematics import FIELDS
from jbeamshell.numerics import block_tridiagonal
from jbeamshell.numerics.block_tridiagonal import BlockTridiagonal


class StepMemory(NamedTuple):
    """Quantities of a step that the next step needs.

    Attributes
    ----------
    v, traction, cap : (n,) tangential displacement, friction traction and cap at q*
    change, rate_change : (n, a) increments of the active fields and of their rates
    started : 0 before the first step, else 1
    """

    v: Array
    traction: Array
    cap: Array
    change: Array
    rate_change: Array
    started: Array


class TimeStep(NamedTuple):
    """Time step from z_0 to z_1, evaluated at z* = z_0 + c (z_1 - z_0) - g (z_0 - z_-1).

    Attributes
    ----------
    time, h : start and size of the step
    weight : c = g + 1/2
    """

    time: Array
    h: Array
    weight: Array

    @property
    def last_weight(self) -> Array:
        """Weight g of the last increment."""
        return self.weight - 0.5

    def gauss_mean(self, history: Callable[[Array], Any]) -> Any:
        """Mean of an excitation over the step, by three Gauss points, so that no blow is missed."""
        points, weights = np.polynomial.legendre.leggauss(3)
        times = self.time + 0.5 * (1.0 + points) * self.h
        values = jax.vmap(history)(times)
        return jax.tree.map(lambda v: jnp.sum(0.5 * weights * v), values)

    def evaluated(self, start: Array, change: Array, last_change: Array) -> Array:
        """Value z* from z_0, the increment and the last increment."""
        return start + self.weight * change - self.last_weight * last_change

    def increment(self, value: Array, start: Array, last_change: Array) -> Array:
        """Increment z_1 - z_0 that has a value z*; the inverse of `evaluated`."""
        return (value - start + self.last_weight * last_change) / self.weight


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
        scales = jnp.stack([system.residual_scale(field) for field in range(len(FIELDS))])

        def inertia_forces(unknown: Array) -> Array:
            return equations.mass.momentum(q, system.embed(nodal(system, unknown)))

        def rows(unknown: Array) -> Array:
            residual = equations.active(inertia_forces(unknown) * scales)
            return in_blocks(jnp.where(equations.mass.free, residual, 0.0), like)

        self.mass = jnp.stack(block_tridiagonal.jacobian(rows, like))
        probes = jnp.asarray(block_tridiagonal.seeds(like))
        along_w = jax.vmap(jax.vmap(lambda unit: inertia_forces(unit)[:, W]))(probes)
        self.mass_along_w = block_tridiagonal.by_neighbour(along_w, block_of_node(system))

    def stiffness(self, step: TimeStep) -> Stiffness:
        """Part of the tangent without the foundation's response."""
        static, inertia = self.static, self.equations.inertia
        elastic, massive = step.weight, 1.0 / (step.weight * jnp.square(step.h))
        if inertia.damped:
            elastic = elastic + inertia.damping_stiffness / step.h
            massive = massive + inertia.damping_mass / step.h
        contact = ContactInput(
            elastic * static.contact.lift_force + massive * self.mass_along_w,
            step.weight * static.contact.v,
            step.weight * static.contact.w,
        )
        entries = elastic * static.entries + massive * self.mass
        return Stiffness(entries, contact, static.response)


class StepForces(NamedTuple):
    """Forces and contact in a time step, at q*.

    Attributes
    ----------
    q : (n, m) fields q*
    forces, damping : (n, m) all forces but those of the foundation and the end; those of damping
    contact : input of the foundation
    """

    q: Array
    forces: Array
    damping: Array
    contact: ContactInput


class StepEquations(NamedTuple):
    """Equations of one time step, whose unknowns are the increments of the active fields.

    Attributes
    ----------
    equations : equations of motion
    step : time step
    q, p : (n, m) fields and rates at the start of the step
    last_change, last_rate_change : (n, m) increments of fields and rates in the last step
    before : friction at q* of the last step
    force : mean of the end force
    ground_forces : (n, m) inertia forces from the mean acceleration of the foundation
    """

    equations: Equations
    step: TimeStep
    q: Array
    p: Array
    last_change: Array
    last_rate_change: Array
    before: LoadLevel
    force: Array
    ground_forces: Array

    @classmethod
    def of(
        cls, equations: Equations, step: TimeStep, state: MotionState, last: StepMemory
    ) -> StepEquations:
        """Equations of a step from a state, with the memory of the last step."""
        embed, excitation = equations.system.embed, equations.excitation
        q = embed(state.q)
        return cls(
            equations=equations,
            step=step,
            q=q,
            p=embed(state.p),
            last_change=embed(last.change),
            last_rate_change=embed(last.rate_change),
            before=LoadLevel(
                q.at[:, V].set(last.v), last.traction, last.cap, last.cap, last.cap[0]
            ),
            force=step.gauss_mean(excitation.force),
            ground_forces=equations.ground_forces(q, step.gauss_mean(excitation.acceleration)),
        )

    @property
    def system(self) -> System:
        """Equations of equilibrium."""
        return self.equations.system

    @property
    def prescribed(self) -> Prescribed:
        """Load step under the end force, with all pressures and with friction."""
        one = jnp.ones_like(self.force)
        return Prescribed(self.force, one, jnp.zeros_like(self.force), one)

    @property
    def guess(self) -> Array:
        """Unknowns (blocks, size) of a motion at constant rates."""
        return in_blocks(self.step.h * self.equations.active(self.p), zero_unknowns(self.system))

    def forces(self, unknown: Array) -> StepForces:
        """Forces and contact of a step with unknowns (blocks, size)."""
        equations, system, step = self.equations, self.system, self.step
        change = system.embed(nodal(system, unknown))
        q, rate = step.evaluated(self.q, change, self.last_change), change / step.h
        rate_change = step.increment(rate, self.p, self.last_rate_change)
        inertia = equations.mass.step_forces(self.q, self.p, change, rate_change, q, step.h)
        damping = equations.damping(q, rate)
        forces = system.elastic_forces(q, 1.0) + inertia + damping + self.ground_forces
        return StepForces(q, forces, damping, ContactInput(forces[:, W], q[:, V], q[:, W]))

    def evaluate(self, unknown: Array) -> tuple[Array, ContactInput]:
        """Residual (blocks, size), and the input of the foundation."""
        system, at = self.system, self.forces(unknown)
        response = system.contact_response(at.contact, self.before, self.prescribed)
        residual = system.balance(at.forces, at.q, response, self.prescribed)[1]
        return residual_in_blocks(residual, unknown, self.step.weight), at.contact

    def tangent(self, contact: ContactInput, stiffness: Stiffness) -> BlockTridiagonal:
        """Matrix of the residual."""
        return matrix(self.system, stiffness, contact, self.before, self.prescribed)

    def limit(self, old: Array, new: Array) -> Array:
        """Next iterate, with slips limited by the friction law; see `Foundation.limited_slip`."""
        system, step = self.system, self.step
        start = step.evaluated(self.q, jnp.zeros_like(self.q), self.last_change)[:, V]
        start = start - self.before.q[:, V]
        slip, old_slip = (start + step.weight * nodal(system, x)[:, V] for x in (new, old))
        limited = system.foundation.limited_slip(
            old_slip, slip, self.before.traction, self.before.cap
        )
        return with_v(system, new, nodal(system, new)[:, V] + (limited - slip) / step.weight)

r"""Mass matrix of a strip, from the kinetic energy of its sections by automatic differentiation.

A material point at height s of a section moves with the rate of its position (x, y), so the kinetic
energy per length is

    T = (1/2) int rho (x_t^2 + y_t^2) ds,

integrated exactly over the height (the inertia terms of Brink 2015, eqs. 2.30-2.41 and 4.34-4.54,
follow from it).  Its second derivative in the rates is the mass matrix.  With linear kinematics it
is constant, with m = 2 rho H and I = (2/3) rho H^3 about mid-height.

Along X the energy is integrated at the nodes with their tributary lengths, so that the matrix has
one block per node.
"""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.dynamics.strip.inertia import Inertia
from jbeamshell.load_steps.system import System
from jbeamshell.mechanics.kinematics import KINEMATICS
from jbeamshell.scene.scene import Scene


class MassMatrix(eqx.Module):
    """Mass matrix M(q) of a strip and its payload.

    Attributes
    ----------
    system : equilibrium of the strip
    heights, weights : (points,) heights and weights, with rho, of the integral over the height
    payload : mass per width that moves with u(L)
    at_rest : (n, m, m) blocks of the nodes, where they are constant: with linear kinematics
    """

    system: System
    heights: Array
    weights: Array
    payload: Array
    at_rest: Array | None

    def __init__(self, scene: Scene, system: System, inertia: Inertia, payload: Array) -> None:
        self.system, self.payload, self.at_rest = system, payload, None
        self.heights, self.weights = inertia.through_height(scene)
        if scene.plan.kinematics == "linear":
            self.at_rest = self.blocks(system.unloaded().q)

    # --- kinetic energy and its derivatives -----------------------------------------------------

    def section_energy(self, fields: Array, rates: Array) -> Array:
        """Kinetic energy per length of a section with fields and rates (m,)."""

        def position(fields: Array, height: Array) -> Array:
            place = KINEMATICS[self.system.plan.kinematics].position
            return jnp.stack(place(fields, self.system.half_height, height))

        def squared_speed(height: Array) -> Array:
            _, rate = jax.jvp(lambda f: position(f, height), (fields,), (rates,))
            return jnp.sum(rate**2)

        return 0.5 * jnp.sum(self.weights * jax.vmap(squared_speed)(self.heights))

    def payload_energy(self, fields: Array, rates: Array) -> Array:
        """Kinetic energy of the payload, from fields and rates (m,) of the end section."""
        _, speed = jax.jvp(lambda f: self.system.end_displacement(f[None]), (fields,), (rates,))
        return 0.5 * self.payload * speed**2

    def energy(self, q: Array, rate: Array) -> Array:
        """Kinetic energy of strip and payload, from nodal fields and rates (n, m)."""
        if self.at_rest is not None:
            return 0.5 * jnp.sum(rate * self.momentum(q, rate))
        sections = jax.vmap(self.section_energy)(q, rate)
        return self.payload_energy(q[-1], rate[-1]) + jnp.sum(self.system.tributary * sections)

    def momentum(self, q: Array, rate: Array) -> Array:
        """Momentum M q_t (n, m), or M times any nodal fields."""
        if self.at_rest is not None:
            return jnp.sum(self.at_rest * rate[:, None, :], axis=2)
        return jax.grad(self.energy, argnums=1)(q, rate)

    def velocity_forces(self, q: Array, rate: Array) -> Array:
        """Inertia forces (n, m) beside M q_tt while M changes: M_t q_t - dT/dq."""
        if self.at_rest is not None:
            return jnp.zeros_like(q)
        _, change = jax.jvp(lambda q: self.momentum(q, rate), (q,), (rate,))
        return change - jax.grad(self.energy)(q, rate)

    def step_forces(
        self, q: Array, p: Array, change: Array, rate_change: Array, at: Array, h: ArrayLike
    ) -> Array:
        """Inertia forces (n, m) of a time step of size h.

        Parameters
        ----------
        q, p : (n, m) fields and rates at its start
        change, rate_change : (n, m) their increments
        at : (n, m) fields q* at which the forces of the step are evaluated
        """
        if self.at_rest is not None:
            return self.momentum(q, rate_change) / h
        difference = self.momentum(q + change, p + rate_change) - self.momentum(q, p)
        return difference / h - jax.grad(self.energy)(at, change / h)

    def blocks(self, q: Array) -> Array:
        """Blocks (n, m, m) of the nodes at fields q (n, m)."""
        if self.at_rest is not None:
            return self.at_rest
        zero = jnp.zeros_like(q)
        blocks = jax.vmap(jax.hessian(self.section_energy, argnums=1))(q, zero)
        blocks = self.system.tributary[:, None, None] * blocks
        return blocks.at[-1].add(jax.hessian(self.payload_energy, argnums=1)(q[-1], zero[-1]))

    # --- accelerations of the free fields -------------------------------------------------------

    @property
    def free(self) -> np.ndarray:
        """True for the active fields (n, a) that no support holds."""
        active = self.system.plan.active
        free = np.ones((self.system.x.size, len(active)), bool)
        for node, field in self.system.supports(True):
            if field in active:
                free[node, active.index(field)] = False
        return free

    def accelerations(self, q: Array, forces: Array) -> Array:
        """Accelerations (n, m) under forces (n, m); zero for frozen and held fields."""
        columns, free = np.array(self.system.plan.active), self.free
        held = ~free[:, :, None] * np.eye(columns.size)
        blocks = self.blocks(q)[:, columns[:, None], columns]
        blocks = blocks * (free[:, :, None] & free[:, None, :]) + held
        active = jnp.where(free, forces[:, columns], 0.0)
        return self.system.embed(jnp.linalg.solve(blocks, active[..., None])[..., 0])

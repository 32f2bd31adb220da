r"""Mass matrix of a strip, from the kinetic energy of its sections by automatic differentiation.

A material point at height s of a section moves with the rate of its position (x, y), so the kinetic
energy per length is

    T = (1/2) int rho (x_t^2 + y_t^2) ds,

integrated exactly over the height (the inertia terms of Brink 2015, eqs. 2.30-2.41 and 4.34-4.54,
follow from it).  Its second derivative in the rates is the mass matrix.  With linear kinematics it
is constant, with m = 2 rho H and I = (2/3) rho H^3 about mid-height.

Along X the energy is integrated at the nodes with their tributary lengths ("lumped": one block per
node) or exactly for the interpolated fields ("consistent": neighbours are coupled).
"""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.linalg import cho_solve
from jax.typing import ArrayLike
from numpy.polynomial import legendre

from jbeamshell.dynamics.strip.inertia import Inertia
from jbeamshell.load_steps.system import PSI, System
from jbeamshell.mechanics import elements
from jbeamshell.mechanics.kinematics import FIELDS, KINEMATICS
from jbeamshell.numerics import block_tridiagonal
from jbeamshell.scene.scene import Scene


class MassMatrix(eqx.Module):
    """Mass matrix M(q) of a strip and its payload.

    Attributes
    ----------
    system : equilibrium of the strip
    heights, weights : (points,) heights and weights, with rho, of the integral over the height
    extra : addition to the squeeze strain's inertia
    payload : mass per width that moves with u(L)
    linear : True if M is constant
    kind : "lumped" or "consistent"
    blocks_at_rest : (n, m, m) lumped blocks, where they are constant
    factor : (n a, n a) Cholesky factor of a consistent matrix of the active fields
    inverse : (n, a, a) inverse blocks of the active fields, where they are constant
    """

    system: System
    heights: Array
    weights: Array
    extra: Array
    payload: Array
    linear: bool = eqx.field(static=True)
    kind: str = eqx.field(static=True)
    blocks_at_rest: Array | None
    factor: Array | None
    inverse: Array | None

    def __init__(self, scene: Scene, system: System, inertia: Inertia, payload: Array) -> None:
        self.system, self.payload, self.kind = system, payload, inertia.mass
        self.heights, self.weights = inertia.through_height(scene)
        moment = (self.heights**2 * self.weights).sum()
        self.extra = (inertia.squeeze_factor - 1.0) * moment
        self.linear = scene.plan.kinematics == "linear"
        self.blocks_at_rest = self.factor = self.inverse = None
        if self.kind == "consistent":
            self.factor = jnp.linalg.cholesky(self.dense())
        elif self.linear:
            self.blocks_at_rest = self.blocks(system.unloaded().q)
            blocks = self._free_blocks(self.blocks_at_rest)
            unit = jnp.broadcast_to(jnp.eye(blocks.shape[1]), blocks.shape)
            columns = [_solve_blocks(blocks, unit[..., j]) for j in range(blocks.shape[1])]
            self.inverse = jnp.stack(columns, axis=2)

    # --- kinetic energy and its derivatives -----------------------------------------------------

    def section_energy(self, fields: Array, rates: Array) -> Array:
        """Kinetic energy per length of a section with fields and rates (m,)."""

        def position(fields: Array, height: Array) -> Array:
            system = self.system
            if system.section is not None:
                return jnp.stack(system.section.displacement(fields, height))
            place = KINEMATICS[system.plan.kinematics].position
            return jnp.stack(place(fields[: len(FIELDS)], system.half_height, height))

        def squared_speed(height: Array) -> Array:
            _, rate = jax.jvp(lambda f: position(f, height), (fields,), (rates,))
            return jnp.sum(rate**2)

        squares = jax.vmap(squared_speed)(self.heights)
        return 0.5 * (jnp.sum(self.weights * squares) + self.extra * rates[PSI] ** 2)

    def payload_energy(self, fields: Array, rates: Array) -> Array:
        """Kinetic energy of the payload, from fields and rates (m,) of the end section."""
        _, speed = jax.jvp(lambda f: self.system.end_displacement(f[None]), (fields,), (rates,))
        return 0.5 * self.payload * speed**2

    def energy(self, q: Array, rate: Array) -> Array:
        """Kinetic energy of strip and payload, from nodal fields and rates (n, m)."""
        if self.blocks_at_rest is not None:
            return 0.5 * jnp.sum(rate * self.momentum(q, rate))
        payload = self.payload_energy(q[-1], rate[-1])
        if self.kind == "lumped":
            sections = jax.vmap(self.section_energy)(q, rate)
            return payload + jnp.sum(self.system.tributary * sections)
        values, weights = _exact_rule(self.system.grid)
        order = elements.ORDER[self.system.grid]

        def at_points(nodal: Array) -> Array:  # (points, elements, m)
            return jnp.einsum("pk,ekm->pem", values, elements.gather(nodal, order))

        density = jax.vmap(jax.vmap(self.section_energy))(at_points(q), at_points(rate))
        return payload + jnp.sum(weights[:, None] * self.system.lengths * density)

    def momentum(self, q: Array, rate: Array) -> Array:
        """Momentum M q_t (n, m), or M times any nodal fields."""
        if self.blocks_at_rest is not None:
            return jnp.sum(self.blocks_at_rest * rate[:, None, :], axis=2)
        return jax.grad(self.energy, argnums=1)(q, rate)

    def velocity_forces(self, q: Array, rate: Array) -> Array:
        """Inertia forces (n, m) beside M q_tt while M changes: M_t q_t - dT/dq."""
        if self.linear:
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
        if self.linear:
            return self.momentum(q, rate_change) / h
        difference = self.momentum(q + change, p + rate_change) - self.momentum(q, p)
        return difference / h - jax.grad(self.energy)(at, change / h)

    def blocks(self, q: Array) -> Array:
        """Lumped mass matrix (n, m, m) at fields q (n, m)."""
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
        columns = list(self.system.plan.active)
        free = jnp.asarray(self.free)
        active = jnp.where(free, forces[:, columns], 0.0)
        if self.factor is not None:
            solution = cho_solve((self.factor, True), active.ravel()).reshape(active.shape)
        elif self.inverse is not None:
            solution = jnp.sum(self.inverse * active[:, None, :], axis=2)
        else:
            solution = _solve_blocks(self._free_blocks(self.blocks(q)), active)
        return self.system.embed(jnp.where(free, solution, 0.0))

    def dense(self) -> Array:
        """Mass matrix at rest of the active fields (n a, n a); held fields have unit mass."""
        q, columns = self.system.unloaded().q, list(self.system.plan.active)
        free = jnp.asarray(self.free)

        def forces(active: Array) -> Array:
            inertial = self.momentum(q, self.system.embed(jnp.where(free, active, 0.0)))
            return jnp.where(free, inertial[:, columns], active)

        matrix = jax.jacfwd(forces)(jnp.zeros_like(q[:, columns]))
        return matrix.reshape(free.size, free.size)

    def _free_blocks(self, blocks: Array) -> Array:
        """Blocks (n, a, a) of the active fields; held fields have unit mass."""
        columns = np.array(self.system.plan.active)
        free = self.free.astype(float)
        held = (1.0 - free)[:, :, None] * np.eye(columns.size)
        active = blocks[:, columns[:, None], columns]
        return active * (free[:, :, None] * free[:, None, :]) + held


def _solve_blocks(blocks: Array, rhs: Array) -> Array:
    """Solve symmetric positive definite blocks (n, m, m) x = rhs (n, m), all nodes at once."""
    m = rhs.shape[1]
    entries = [[blocks[:, i, j] for j in range(m)] for i in range(m)]
    rows = block_tridiagonal.divided(entries, [[rhs[:, i]] for i in range(m)])
    return jnp.stack([row[0] for row in rows], axis=1)


def _exact_rule(grid: str) -> tuple[np.ndarray, np.ndarray]:
    """Shape functions (points, nodes) and weights (points,) that integrate their products."""
    nodes = elements.element_rule(grid).nodes
    points, weights = legendre.leggauss(elements.ORDER[grid] + 1)
    points = 0.5 * (1.0 + points)
    shapes = [
        np.prod([(points - b) / (a - b) for b in np.delete(nodes, i)], axis=0)
        for i, a in enumerate(nodes)
    ]
    return np.stack(shapes, axis=1), 0.5 * weights

r"""Inertia of the strip: kinetic energy of the sections' positions, masses by autodiff.

A material point at height s of a section moves with the rate of its position (x, y), so the kinetic
energy per length is

    T = (1/2) int rho (x_t^2 + y_t^2) ds,

integrated exactly over the height (Brink 2015, eqs. 2.30-2.41 and 4.34-4.54, whose inertia terms
follow from it).  Its second derivative in the rates is the mass matrix: with linear kinematics it
is constant, with m = 2 rho H and I = (2/3) rho H^3 about mid-height.

Along X the energy is integrated at the nodes with their tributary lengths ("lumped": one block per
node) or exactly for the fields' interpolation ("consistent": neighbours are coupled).
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.polynomial import legendre

from jbeamshell.common.checks import NOT_NEGATIVE, POSITIVE, TINY, as_leaf, require, require_choice
from jbeamshell.common.checks import require_number as number
from jbeamshell.mechanics import elements
from jbeamshell.mechanics.kinematics import FIELDS, KINEMATICS
from jbeamshell.numerics import block_tridiagonal
from jbeamshell.quasistatic.system import PSI, System
from jbeamshell.scene.scene import Scene

THICKNESS_STRETCH = 12.0 / np.pi**2
MASSES = ("lumped", "consistent")
DENSITY = "give one positive number, or one for each of strip.layers from the bottom to the top"


class Inertia(eqx.Module):
    """What the strip's motion costs.

    Attributes
    ----------
    density : rho, mass per volume; with layers one number for all or one for each, (layers,)
    squeeze_factor : multiplies the squeeze strain's inertia (2/3) rho H^3 about mid-height.  With 1
        the first thickness-stretch frequency is sqrt(3)/(pi/2), 10.3 %, above the exact one;
        `THICKNESS_STRETCH` = 12/pi^2 cures that (Mindlin's correction of the thickness mode)
    mass : "lumped" or "consistent"; the second is for linear kinematics
    damping_mass, damping_stiffness : Rayleigh's coefficients, 1/time and time, of material damping
        C = a M + b K; both zero by default
    """

    density: Array
    squeeze_factor: Array
    mass: str = eqx.field(static=True)
    damping_mass: Array
    damping_stiffness: Array
    damped: bool = eqx.field(static=True)

    def __init__(
        self,
        density: Any = 1.0,
        squeeze_factor: Any = 1.0,
        mass: str = "lumped",
        damping_mass: Any = 0.0,
        damping_stiffness: Any = 0.0,
    ) -> None:
        self.density = as_leaf(density, "inertia.density", DENSITY)
        self.squeeze_factor = as_leaf(squeeze_factor, "inertia.squeeze_factor")
        self.mass = mass
        self.damping_mass = as_leaf(damping_mass, "inertia.damping_mass")
        self.damping_stiffness = as_leaf(damping_stiffness, "inertia.damping_stiffness")
        coefficients = (self.damping_mass, self.damping_stiffness)
        traced = any(isinstance(c, jax.core.Tracer) for c in coefficients)
        self.damped = traced or any(bool(np.any(np.asarray(c) != 0.0)) for c in coefficients)

    def __check_init__(self) -> None:
        if not isinstance(self.density, jax.core.Tracer):
            known = np.asarray(self.density)
            sound = known.ndim <= 1 and known.size > 0
            positive = sound and bool(np.all(np.isfinite(known) & (known > 0.0)))
            require("inertia.density", self.density, positive, DENSITY)
        number("inertia.squeeze_factor", self.squeeze_factor, POSITIVE)
        require_choice("inertia.mass", self.mass, MASSES)
        number("inertia.damping_mass", self.damping_mass, NOT_NEGATIVE, low=-TINY)
        number("inertia.damping_stiffness", self.damping_stiffness, NOT_NEGATIVE, low=-TINY)

    def check(self, scene: Scene) -> None:
        """Raise `InputError` where the scene and this inertia do not go together."""
        layers = 1 if scene.strip.layers is None else scene.strip.layers.shape[0]
        fits = self.density.ndim == 0 or self.density.shape == (layers,)
        require("inertia.density", self.density, fits, DENSITY)
        fix = "is constant with linear kinematics only: take model.kinematics = 'linear'"
        constant = self.mass == "lumped" or scene.model.kinematics == "linear"
        require("inertia.mass", self.mass, constant, fix)

    def through_height(self, scene: Scene) -> tuple[Array, Array]:
        """Points s and weights rho ds of the integral over the height, (points,) each."""
        strip, half = scene.strip, scene.strip.half_height
        points, weights = legendre.leggauss(scene.model.order + 3)
        if strip.layers is None:
            return half * jnp.asarray(points), jnp.mean(self.density) * half * jnp.asarray(weights)
        thick = strip.layers[:, 0]
        bottom = jnp.cumsum(thick) - thick - half
        density = jnp.broadcast_to(self.density, thick.shape)
        at = bottom[:, None] + 0.5 * thick[:, None] * (1.0 + points)
        weighing = (0.5 * density * thick)[:, None] * weights
        return at.ravel(), weighing.ravel()

    def mean_density(self, scene: Scene) -> Array:
        """Mass per length and height, mean of rho."""
        return jnp.sum(self.through_height(scene)[1]) / (2.0 * scene.strip.half_height)


class Masses(eqx.Module):
    """Kinetic energy of a system on its grid.

    Attributes
    ----------
    system : of which
    heights, weights : (points,) of the integral over the height, with rho in the weights
    extra : what is added to the squeeze strain's inertia
    payload : mass per width that rides on the loaded end at u(L)
    constant : (n, m, m) lumped masses where they do not change
    mass : "lumped" or "consistent"
    """

    system: System
    heights: Array
    weights: Array
    extra: Array
    payload: Array
    constant: Array | None
    mass: str = eqx.field(static=True)

    def __init__(self, scene: Scene, system: System, inertia: Inertia, payload: Array) -> None:
        self.system, self.payload, self.mass = system, payload, inertia.mass
        self.heights, self.weights = inertia.through_height(scene)
        about = (self.heights**2 * self.weights).sum()
        self.extra = (inertia.squeeze_factor - 1.0) * about
        fixed = scene.model.kinematics == "linear" and inertia.mass == "lumped"
        self.constant = self.blocks(system.unloaded().q) if fixed else None

    def section(self, fields: Array, rates: Array) -> Array:
        """Kinetic energy per length of a section with fields and rates (m,)."""

        def position(fields: Array, height: Array) -> Array:
            system = self.system
            if system.section is not None:
                return jnp.stack(system.section.displacement(fields, height))
            place = KINEMATICS[system.model.kinematics].position
            return jnp.stack(place(fields[: len(FIELDS)], system.half_height, height))

        def square(height: Array) -> Array:
            _, rate = jax.jvp(lambda f: position(f, height), (fields,), (rates,))
            return jnp.sum(rate**2)

        squares = jax.vmap(square)(self.heights)
        return 0.5 * (jnp.sum(self.weights * squares) + self.extra * rates[PSI] ** 2)

    def payload_energy(self, fields: Array, rates: Array) -> Array:
        """Kinetic energy of the payload, from the end section's fields and rates (m,)."""
        _, speed = jax.jvp(lambda f: self.system.end_displacement(f[None]), (fields,), (rates,))
        return 0.5 * self.payload * speed**2

    def kinetic(self, q: Array, rate: Array) -> Array:
        """Kinetic energy of all, from nodal fields and rates (n, m)."""
        if self.constant is not None:
            return 0.5 * jnp.sum(rate * self.momentum(q, rate))
        payload = self.payload_energy(q[-1], rate[-1])
        if self.mass == "lumped":
            return payload + jnp.sum(self.system.tributary * jax.vmap(self.section)(q, rate))
        values, weights = _exact_rule(self.system.model.grid)
        order = elements.ORDER[self.system.model.grid]

        def inside(nodal: Array) -> Array:  # (points, elements, m)
            return jnp.einsum("pk,ekm->pem", values, elements.gather(nodal, order))

        density = jax.vmap(jax.vmap(self.section))(inside(q), inside(rate))
        return payload + jnp.sum(weights[:, None] * self.system.lengths * density)

    def momentum(self, q: Array, rate: Array) -> Array:
        """What the rates carry, M q_t, (n, m)."""
        if self.constant is not None:
            return jnp.sum(self.constant * rate[:, None, :], axis=2)
        return jax.grad(self.kinetic, argnums=1)(q, rate)

    def step_forces(
        self, q: Array, p: Array, change: Array, gain: Array, at: Array, h: ArrayLike
    ) -> Array:
        """Forces of inertia (n, m) in a step h.

        Parameters
        ----------
        q, p, change, gain : (n, m) fields and rates at its start, and their increments
        at : (n, m) fields at which the step's forces are
        """
        if self.system.model.kinematics == "linear":
            return self.momentum(q, gain) / h
        gained = self.momentum(q + change, p + gain) - self.momentum(q, p)
        return gained / h - jax.grad(self.kinetic)(at, change / h)

    def blocks(self, q: Array) -> Array:
        """The lumped mass matrix, (n, m, m), at fields q (n, m)."""
        still = jnp.zeros_like(q)
        blocks = jax.vmap(jax.hessian(self.section, argnums=1))(q, still)
        blocks = self.system.tributary[:, None, None] * blocks
        return blocks.at[-1].add(jax.hessian(self.payload_energy, argnums=1)(q[-1], still[-1]))

    def velocity_forces(self, q: Array, rate: Array) -> Array:
        """What inertia adds to M q_tt while M changes: M_t q_t - dT/dq, (n, m)."""
        if self.system.model.kinematics == "linear":
            return jnp.zeros_like(q)
        _, change = jax.jvp(lambda q: self.momentum(q, rate), (q,), (rate,))
        return change - jax.grad(self.kinetic)(q, rate)


def free(system: System) -> np.ndarray:
    """Which nodal fields (n, m) move: active ones that no support holds."""
    model = system.model
    moves = np.zeros((system.x.size, model.width), bool)
    moves[:, list(model.active)] = True
    moves[0, list(system.supports(True))] = False
    return moves


def solved(blocks: Array, rhs: Array) -> Array:
    """Solve symmetric positive definite blocks (n, m, m) x = rhs (n, m), all nodes at once."""
    m = rhs.shape[1]
    entries = [[blocks[:, i, j] for j in range(m)] for i in range(m)]
    rows = block_tridiagonal.divided(entries, [[rhs[:, i]] for i in range(m)])
    return jnp.stack([row[0] for row in rows], axis=1)


def _exact_rule(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Interpolation (points, nodes) and weights (points,) that integrate the product of two."""
    nodes = elements.element_rule(name).nodes
    points, weights = legendre.leggauss(elements.ORDER[name] + 1)
    points = 0.5 * (1.0 + points)
    shapes = [
        np.prod([(points - b) / (a - b) for b in np.delete(nodes, i)], axis=0)
        for i, a in enumerate(nodes)
    ]
    return np.stack(shapes, axis=1), 0.5 * weights

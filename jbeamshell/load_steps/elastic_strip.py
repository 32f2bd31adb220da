"""Elastic strip on its nodes: positions, strain energy, dead pressures and section forces."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.mechanics import elements
from jbeamshell.mechanics.homogeneous import Energy, contraction, forces
from jbeamshell.mechanics.kinematics import (
    FIELDS,
    KINEMATICS,
    Kinematics,
    Strains,
    rotated,
)
from jbeamshell.scene.plan import Plan
from jbeamshell.scene.scene import Scene

V, W, BETA, PSI = range(len(FIELDS))


class ElasticStrip(eqx.Module):
    """Elastic strip with n nodes, loaded by dead pressures.

    The fields q (n, 4) are v, w, beta and psi.

    Attributes
    ----------
    energy : strain energy Phi of the beamshell, a function of its strains
    x : (n,) node positions
    lengths : (elements,) element lengths
    tributary : (n,) contact length l_i of each node
    load, bottom_load : (n,) nodal forces of the pressures on the top and the bottom face
    half_height : H
    curvature : alpha' before loading; None for a straight strip
    youngs_modulus : E; None for a laminate
    plan : section, kinematics and grid
    grid : "finite-difference" or "collocation"
    contraction : fall of e per psi at constant N, Phi_epsi/Phi_ee of small strains
    quadratic_energy : True if the strain energy is a quadratic form of the strains
    """

    energy: Energy
    x: Array
    lengths: Array
    tributary: Array
    load: Array
    bottom_load: Array
    half_height: Array
    curvature: Array | None
    youngs_modulus: Array | None
    contraction: Array
    plan: Plan = eqx.field(static=True)
    grid: str = eqx.field(static=True)
    quadratic_energy: bool = eqx.field(static=True)

    def __init__(self, scene: Scene) -> None:
        strip, contact, self.plan = scene.strip, scene.contact, scene.plan
        self.grid = scene.model.grid
        self.energy = scene.strain_energy()
        self.contraction = contraction(self.energy, jnp.zeros_like(strip.half_height))
        self.quadratic_energy = scene.energy is None
        ends = elements.vertices(
            (self.plan.nodes - 1) // self.element_order,
            strip.length,
            strip.half_height,
            self.plan.end_size,
            contact.steps(strip.length),
            far_size=self.plan.far_size,
            small_growth=self.plan.small_growth,
        )
        rule = self.element_rule
        self.x, self.lengths = elements.nodes(rule, ends), jnp.diff(ends)
        self.tributary = elements.tributary_lengths(rule, ends)
        self.load = elements.nodal_loads(rule, ends, contact.pressure)
        self.bottom_load = elements.nodal_loads(rule, ends, contact.bottom_pressure)
        self.half_height, self.curvature = strip.half_height, strip.curvature
        self.youngs_modulus = strip.youngs_modulus

    @property
    def element_rule(self) -> elements.Rule:
        """Nodes, points and weights of an element."""
        return elements.element_rule(self.grid)

    @property
    def element_order(self) -> int:
        """Polynomial order p of an element, which has p+1 nodes."""
        return elements.ORDER[self.grid]

    @property
    def middles(self) -> Array:
        """Middle of every element, (elements,)."""
        return self._element_starts + 0.5 * self.lengths

    @property
    def _element_starts(self) -> Array:
        return self.x[: -1 : self.element_order]

    @property
    def _kinematics(self) -> Kinematics:
        return KINEMATICS[self.plan.kinematics]

    def embed(self, active: Array) -> Array:
        """All fields (n, m) of the sections from the active ones; frozen fields are zero."""
        columns = [jnp.zeros_like(self.x)] * len(FIELDS)
        for column, field in enumerate(self.plan.active):
            columns[field] = active[:, column]
        return jnp.stack(columns, axis=1)

    # --- positions ------------------------------------------------------------------------------

    def gap(self, q: Array) -> Array:
        """Height of the bottom face above the foundation, (n,), at fields q (n, m)."""
        return self.gap_from_lift(q[:, W])

    def gap_from_lift(self, lift: Array) -> Array:
        """Height of the bottom face above the foundation, (n,), at the lift w (n,)."""
        if self.curvature is None:
            return lift
        half = 0.5 * self._initial_angle(self.x)
        ratio = jnp.sinc(half / jnp.pi)  # chord over arc; the curvature may go to zero
        rise = 0.5 * self.curvature * self.x**2 * ratio**2
        return lift + rise + 2.0 * self.half_height * jnp.sin(half) ** 2

    def end_displacement(self, q: Array) -> Array:
        """Displacement u(L) of the loaded end at mid-height, the conjugate of F."""
        return self._displacement(q[-1:], self.x[-1:], 0.0)[0][0]

    def _initial_angle(self, x: Array) -> Array:
        """Angle alpha of the undeformed strip at X; its mid-height is an arc, level at X = 0."""
        return jnp.asarray(self.curvature) * x

    def _displacement(self, q: Array, x: Array, height: ArrayLike) -> tuple[Array, Array]:
        """Displacement (x, y) at ``height`` above mid-height of sections q (n, m) at X = x (n,)."""

        def position(*section: Array) -> tuple[Array, Array]:
            return self._kinematics.position(section, self.half_height, height)

        if self.curvature is None:
            return jax.vmap(position)(*q.T)
        angle = self._initial_angle(x)
        local = rotated(q[:, V], q[:, W], angle)
        return rotated(*jax.vmap(position)(*local, q[:, BETA], q[:, PSI]), -angle)

    # --- energy and forces ----------------------------------------------------------------------

    def potential(self, q: Array, pressure: ArrayLike) -> Array:
        """Potential Pi: strain energy plus that of the pressures, whose part ``pressure`` acts."""
        return self.strain_energy(q) + pressure * self.sinking(q)

    def sinking(self, q: Array) -> Array:
        """Nodal loads times displacements, the derivative of Pi by the ``pressure`` that acts."""
        top = self._displacement(q, self.x, self.half_height)[1]
        return jnp.sum(self.load * top) - jnp.sum(self.bottom_load * q[:, W])

    def strain_energy(self, q: Array) -> Array:
        """Strain energy at fields q (n, m), per unit width."""
        density = jax.vmap(jax.vmap(self.energy))(*self._strains(q))
        return jnp.sum(self.element_rule.weights[:, None] * self.lengths * density)

    def elastic_forces(self, q: Array, pressure: ArrayLike) -> Array:
        """Gradient dPi/dq of the potential, (n, m)."""
        return jax.grad(self.potential)(q, pressure)

    def section_forces(self, q: Array) -> Strains:
        """Mean N, Q, M, chi and xi of every element, (elements,) local."""
        strains = self._strains(q)
        local = jax.vmap(jax.vmap(lambda s: forces(self.energy, s)))(strains)
        if self.plan.section == "assumed":
            stretch = 2.0 * self.half_height * jnp.asarray(self.youngs_modulus)
            local = local._replace(psi=stretch * strains.psi)
        weights = self.element_rule.weights
        return jax.tree.map(lambda f: jnp.sum(weights[:, None] * f, axis=0), local)

    def _fields_and_slopes(self, q: Array) -> tuple[list[Array], list[Array]]:
        """Fields and their slopes at all points of all elements, (points, elements) each."""

        def at(shape: np.ndarray, values: Array) -> Array:
            # A sum over whole vectors of elements is faster than a matrix product.
            return jnp.asarray(sum(s[:, None] * v for s, v in zip(shape.T, values.T, strict=True)))

        rule = self.element_rule
        shapes = [rule.values] * len(FIELDS)
        shapes[PSI] = rule.squeeze
        nodal = [elements.gather(column, self.element_order) for column in q.T]
        section = [at(shape, values) for shape, values in zip(shapes, nodal, strict=True)]
        slope = [at(rule.slopes, values) / self.lengths for values in nodal]
        if self.curvature is not None:
            points = rule.values @ rule.nodes
            angle = self._initial_angle(self._element_starts + points[:, None] * self.lengths)
            slope[V], slope[W] = rotated(slope[V], slope[W], angle)
        return section, slope

    def _strains(self, q: Array) -> Strains:
        """Strains of the beamshell at all points of all elements, (points, elements) each."""
        section, slope = self._fields_and_slopes(q)
        strains = self._kinematics.strains(section, slope, self.half_height, self.curvature)
        if self.element_order > 1:
            return strains
        # e varies within an element so that N does not vary with psi, see `mechanics.elements`.
        weights = self.element_rule.weights
        mean = [jnp.sum(weights[:, None] * part, axis=0) for part in (strains.e, strains.psi)]
        return strains._replace(e=mean[0] - self.contraction * (strains.psi - mean[1]))

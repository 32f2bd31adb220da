r"""Equilibrium of a scene at one load level: the one place where everything meets.

Elastic energy and pressure have a potential Pi; friction has none, because its cap depends on the
solution.  With q_i the fields of node i, l_i its tributary length, t its friction traction and F
the end force, conjugate to the mid-height displacement u(L) of the loaded end,

    dPi/dq_i + l_i t_i (in the row of v_i) - F du(L)/dq_i = 0,        R_i = (dPi/dw_i)/l_i.

The normal reaction R follows from taking the contact point's lift w as a field, active or not.
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell import grid
from jbeamshell.contact import complementarity
from jbeamshell.energy import Energy
from jbeamshell.friction import FrictionLaw
from jbeamshell.kinematics import FIELDS, KINEMATICS, Kinematics
from jbeamshell.parts import Model
from jbeamshell.scene import Scene

V, W, BETA, PSI = range(len(FIELDS))
CAP_FLOOR = 1e-6  # of mu F_N: gradients need a cap that is not zero


class Level(NamedTuple):
    """The strip at the end of a load step; all that the next step needs to know.

    Attributes
    ----------
    q : (n, 4) nodal fields v, w, beta, psi
    traction : (n,) friction traction t, positive along v (on the foundation)
    cap : (n,) Coulomb cap mu R
    reaction : (n,) normal reaction R
    force : F at the loaded end
    """

    q: Array
    traction: Array
    cap: Array
    reaction: Array
    force: Array


class Drive(NamedTuple):
    """What a load step prescribes.

    Attributes
    ----------
    target : F, or u(L) from the unloaded end's rest, whichever is controlled
    rest : u(L) after the pressure, from which displacements are counted
    rough : 1 with friction, 0 in the pressure step before it (which ends at F = 0)
    """

    target: Array
    rest: Array
    rough: Array


class System(eqx.Module):
    """A scene on its grid.

    Attributes
    ----------
    x : (n,) node positions
    lengths : (elements,) element lengths
    tributary : (n,) contact length l_i of each node
    pressure : (n,) F_N at the nodes
    half_height : H
    friction : mu
    slip_stiffness : k_t, traction per slip
    stiffness_scale, force_scale : make support rows forces, and residuals dimensionless
    """

    energy: Energy
    law: FrictionLaw
    x: Array
    lengths: Array
    tributary: Array
    pressure: Array
    half_height: Array
    friction: Array
    slip_stiffness: Array
    contact_scale: Array
    stiffness_scale: Array
    force_scale: Array
    model: Model = eqx.field(static=True)
    far_end: str = eqx.field(static=True)
    control: str = eqx.field(static=True)

    def __init__(self, scene: Scene) -> None:
        strip, contact, self.model = scene.strip, scene.contact, scene.model
        order = grid.ORDER[self.model.grid]
        ends = grid.vertices((self.model.nodes - 1) // order, strip.length, strip.half_height)
        self.energy, self.law = scene.strain_energy(), contact.law
        self.x, self.lengths = grid.nodes(self._rule, ends), jnp.diff(ends)
        self.tributary = grid.tributary_lengths(self._rule, ends)
        self.pressure = contact.pressure_at(self.x)
        self.half_height, self.friction = strip.half_height, contact.friction
        self.slip_stiffness = contact.stick_stiffness * strip.shear_modulus / strip.half_height
        self.contact_scale = strip.plane_modulus / strip.half_height
        self.stiffness_scale = strip.axial_stiffness / strip.length
        self.force_scale = self.friction * jnp.sum(self.tributary * self.pressure)
        self.far_end, self.control = strip.far_end, scene.load.control

    @property
    def _rule(self) -> grid.Rule:
        return grid.element_rule(self.model.grid)

    @property
    def _kinematics(self) -> Kinematics:
        return KINEMATICS[self.model.kinematics]

    # --- potential ------------------------------------------------------------------------------

    def potential(self, q: Array) -> Array:
        """Strain energy plus the potential of the dead pressure on the top face, Pi."""
        top = jax.vmap(lambda *s: self._kinematics.position(s, self.half_height, self.half_height))
        return self.strain_energy(q) + jnp.sum(self.tributary * self.pressure * top(*q.T)[1])

    def strain_energy(self, q: Array) -> Array:
        """Elastic energy of the strip with nodal fields q (n, 4), per unit width."""
        order = grid.ORDER[self.model.grid]
        # Fields apart, points last: the compiler then works on whole vectors of elements.
        nodal = tuple(grid.gather(column, order) for column in q.T)
        return jnp.sum(jax.vmap(self._element_energy)(nodal, self.lengths))

    def _element_energy(self, nodal: tuple[Array, ...], length: Array) -> Array:
        """Energy of an element from the nodal values (p+1,) of every field."""

        def at(shape: np.ndarray, values: Array) -> Array:
            return jnp.asarray(sum(float(s) * values[i] for i, s in enumerate(shape) if s != 0.0))

        rule, energy = self._rule, jnp.zeros_like(length)
        for point in range(rule.weights.size):
            shapes = [rule.squeeze if field == PSI else rule.values for field in range(len(FIELDS))]
            section = [
                at(shape[point], values) for shape, values in zip(shapes, nodal, strict=True)
            ]
            slope = [at(rule.slopes[point], values) / length for values in nodal]
            strains = self._kinematics.strains(section, slope, self.half_height)
            energy = energy + float(rule.weights[point]) * length * self.energy(*strains)
        return energy

    def end_displacement(self, q: Array) -> Array:
        """u(L): mid-height displacement of the loaded end, the conjugate of F."""
        return self._kinematics.position(q[-1], self.half_height, 0.0)[0]

    # --- residual -------------------------------------------------------------------------------

    def rest(self) -> Level:
        """The strip before anything acts on it."""
        zero = jnp.zeros_like(self.x)
        return Level(jnp.zeros((self.x.size, len(FIELDS)), zero.dtype), zero, zero, zero, zero[0])

    def embed(self, active: Array) -> Array:
        """Active fields (n, m) to all four (n, 4); frozen ones are zero."""
        columns = [jnp.zeros_like(self.x)] * len(FIELDS)
        for column, field in enumerate(self.model.active):
            columns[field] = active[:, column]
        return jnp.stack(columns, axis=1)

    @eqx.filter_jit  # traced once for its several uses in a solver
    def advance(self, change: Array, before: Level, drive: Drive) -> tuple[Level, Array]:
        """The level after a change of the active fields, and the out-of-balance forces there.

        Parameters
        ----------
        change : (n, m) increments of the active fields
        before : the level at the start of the step
        drive : what the step prescribes

        Returns
        -------
        level : the level after the change
        residual : (n, m) out-of-balance forces over mu F_N L; zero in equilibrium
        """
        increment = self.embed(change)
        q = before.q + increment
        forces = jax.grad(self.potential)(q)
        reaction = forces[:, W] / self.tributary
        floor = CAP_FLOOR * self.force_scale / jnp.sum(self.tributary)
        cap = jnp.maximum(self.friction * reaction, floor)
        slip = jax.vmap(self.law.traction, in_axes=(0, 0, 0, None))
        traction = drive.rough * slip(increment[:, V], before.traction, cap, self.slip_stiffness)
        forces = forces.at[:, V].add(self.tributary * traction)
        contact = complementarity(reaction, q[:, W], self.contact_scale)
        forces = forces.at[:, W].set(self.tributary * contact)

        conjugate = jax.grad(self.end_displacement)(q)[-1]
        prescribed = jnp.asarray(self.control == "displacement") & (drive.rough > 0.0)
        force = jnp.where(prescribed, forces[-1, V], drive.target)
        forces = forces.at[-1].add(-force * conjugate)
        gap = self.end_displacement(q) - drive.rest - drive.target
        forces = forces.at[-1, V].set(
            jnp.where(prescribed, self.stiffness_scale * gap, forces[-1, V])
        )
        forces = self._support(forces, q, drive.rough)
        per_force = jnp.array([1.0, 1.0, 1.0, 1.0]).at[BETA].set(1.0 / self.half_height)
        per_force = per_force.at[PSI].set(1.0 / self.half_height)
        residual = (forces * per_force / self.force_scale)[:, list(self.model.active)]
        return Level(q, traction, cap, reaction, force), residual

    def _support(self, forces: Array, q: Array, rough: Array) -> Array:
        """Replace the balance of held fields at X = 0 by their support condition."""
        held_v = forces.at[0, V].set(self.stiffness_scale * q[0, V])
        if self.far_end == "free":  # held by friction alone, so only once there is friction
            return jnp.where(rough > 0.0, forces, held_v)
        if self.far_end == "pinned":
            return held_v
        return held_v.at[0, BETA].set(self.stiffness_scale * self.half_height**2 * q[0, BETA])

    # --- energies of a step -----------------------------------------------------------------------

    def slip_work(self, before: Level, after: Level) -> Array:
        """Work dissipated by friction in a step, per unit width."""
        work = jax.vmap(self.law.slip_work, in_axes=(0, 0, 0, 0, 0, None))(
            after.q[:, V] - before.q[:, V],
            before.traction,
            after.traction,
            before.cap,
            after.cap,
            self.slip_stiffness,
        )
        return jnp.sum(self.tributary * work)

    def stored_energy(self, level: Level) -> Array:
        """Potential Pi plus the elastic energy of the contact's shear compliance."""
        sliders = level.traction**2 / (2.0 * self.slip_stiffness)
        return self.potential(level.q) + jnp.sum(self.tributary * sliders)

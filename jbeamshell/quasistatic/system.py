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
from jax.typing import ArrayLike

from jbeamshell.mechanics import elements
from jbeamshell.mechanics.friction import FrictionLaw
from jbeamshell.mechanics.hierarchic import Hierarchic
from jbeamshell.mechanics.homogeneous import Energy, forces
from jbeamshell.mechanics.kinematics import FIELDS, KINEMATICS, Kinematics, Strains, rotated
from jbeamshell.mechanics.normal_contact import Absent, Compliance, NormalLaw, Rigid
from jbeamshell.scene.parts import ARC_LENGTH, Contact, Model
from jbeamshell.scene.scene import Scene

V, W, BETA, PSI = range(len(FIELDS))
CAP_FLOOR = 1e-6  # of mu F_N: gradients need a cap that is not zero
CLOSING_RANGE = (
    0.05  # of the approach under the mean pressure, over which a compliant contact closes
)


class Level(NamedTuple):
    """The strip at the end of a load step; all that the next step needs to know.

    Attributes
    ----------
    q : (n, m) nodal fields v, w, beta, psi, and those of a hierarchic section
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
    target : F, or u(L) from the unloaded end's rest, or what `along` says, whichever is controlled
    pressure : part of the pressures that acts
    rest : u(L) after the pressure, from which displacements are counted
    rough : 1 with friction, 0 in the pressure step before it (which ends at F = 0)
    along : (2,) what is controlled but a force: this much of u(L) and this much of F L/(E' 2H)
    """

    target: Array
    pressure: Array
    rest: Array
    rough: Array
    along: Array | tuple[float, float] = (1.0, 0.0)


Seen = tuple[Array, Array, Array]  # what the foundation sees: forces along w, and v and w


class Touch(NamedTuple):
    """What the foundation answers, (n,) each.

    Attributes
    ----------
    traction : of friction
    contact : residual of the normal contact, a pressure
    reaction : R
    """

    traction: Array
    contact: Array
    reaction: Array


class System(eqx.Module):
    """A scene on its grid.

    Attributes
    ----------
    energy : Phi of the beamshell
    section : of order p, in place of the beamshell's; None where that is meant
    x : (n,) node positions
    lengths : (elements,) element lengths
    tributary : (n,) contact length l_i of each node
    load, bottom_load : (n,) nodal forces of the pressures on the top and the bottom face
    half_height : H
    curvature : alpha' before loading, None where the strip is straight
    youngs_modulus : E, None where there are layers
    friction : mu
    slip_stiffness : k_t, traction per slip
    known : whether the energy is ours, a quadratic form of the strains
    stiffness_scale, force_scale : make support rows forces, and residuals dimensionless
    """

    energy: Energy
    section: Hierarchic | None
    law: FrictionLaw
    normal: NormalLaw
    x: Array
    lengths: Array
    tributary: Array
    load: Array
    bottom_load: Array
    half_height: Array
    curvature: Array | None
    youngs_modulus: Array | None
    friction: Array
    slip_stiffness: Array
    stiffness_scale: Array
    force_scale: Array
    model: Model = eqx.field(static=True)
    far_end: str = eqx.field(static=True)
    control: str = eqx.field(static=True)
    known: bool = eqx.field(static=True)

    def __init__(self, scene: Scene) -> None:
        strip, contact, self.model = scene.strip, scene.contact, scene.model
        order = elements.ORDER[self.model.grid]
        ends = elements.vertices(
            (self.model.nodes - 1) // order,
            strip.length,
            strip.half_height,
            self.model.end_size,
            _steps(contact, strip.length),
        )
        self.energy, self.law = scene.strain_energy(), contact.law
        self.section = scene.hierarchic_section()
        self.x, self.lengths = elements.nodes(self.rule, ends), jnp.diff(ends)
        self.tributary = elements.tributary_lengths(self.rule, ends)
        self.load = elements.nodal_loads(self.rule, ends, contact.pressure)
        self.bottom_load = elements.nodal_loads(self.rule, ends, contact.bottom_pressure)
        self.half_height, self.friction = strip.half_height, contact.friction
        self.curvature, self.youngs_modulus = strip.curvature, strip.youngs_modulus
        self.slip_stiffness = scene.slip_stiffness
        self.stiffness_scale = strip.stretching_stiffness / strip.length
        pressing = jnp.sum(self.load)
        self.force_scale = pressing * jnp.where(self.friction > 0.0, self.friction, 1.0)
        stiffness = strip.plane_modulus / strip.half_height
        self.normal = Rigid(stiffness)
        if contact.normal == "none":
            self.normal = Absent()
        elif contact.normal == "compliant":
            stiffness = contact.normal_stiffness * stiffness
            self.normal = Compliance(stiffness, CLOSING_RANGE * pressing / strip.length / stiffness)
        self.far_end, self.control = strip.far_end, scene.load.control
        self.known = scene.energy is None

    @property
    def rule(self) -> elements.Rule:
        """Of an element."""
        return elements.element_rule(self.model.grid)

    @property
    def linear(self) -> bool:
        """Whether all but the foundation's answer is linear in the fields."""
        return self.model.kinematics == "linear" and self.known

    def feels(self, name: str) -> bool:
        """Whether that part of a `Touch` has an effect."""
        fields = {"traction": "v", "contact": "w", "reaction": "psi"}
        felt = name != "reaction" or self.model.squeeze == "assumed"
        return felt and fields[name] in self.model.fields

    @property
    def follows_friction(self) -> bool:
        """Whether the ends are held otherwise before there is friction."""
        return self.control != "force" or self.far_end == "free"

    @property
    def _kinematics(self) -> Kinematics:
        return KINEMATICS[self.model.kinematics]

    # --- geometry -------------------------------------------------------------------------------

    def _angle(self, x: Array) -> Array:
        """Alpha of the undeformed strip at X; its mid-height is an arc that is level at X = 0."""
        return jnp.asarray(self.curvature) * x

    def gap(self, q: Array) -> Array:
        """Height of the bottom face above the foundation, (n,)."""
        return self._gap(q[:, W])

    def _gap(self, lift: Array) -> Array:
        if self.curvature is None:
            return lift
        half = 0.5 * self._angle(self.x)
        ratio = jnp.sinc(half / jnp.pi)  # of chord to arc: curvature may go to zero
        rise = 0.5 * self.curvature * self.x**2 * ratio**2
        return lift + rise + 2.0 * self.half_height * jnp.sin(half) ** 2

    def _moved(self, q: Array, x: Array, height: ArrayLike) -> tuple[Array, Array]:
        """Displacement (x, y) at ``height`` above mid-height of sections q (n, 4) at X = x (n,)."""

        def position(*section: Array) -> tuple[Array, Array]:
            return self._kinematics.position(section, self.half_height, height)

        if self.curvature is None:
            return jax.vmap(position)(*q[:, : len(FIELDS)].T)
        angle = self._angle(x)
        local = rotated(q[:, V], q[:, W], angle)
        return rotated(*jax.vmap(position)(*local, q[:, BETA], q[:, PSI]), -angle)

    # --- potential ------------------------------------------------------------------------------

    def potential(self, q: Array, pressure: ArrayLike) -> Array:
        """Strain energy plus the potential of the dead pressures, of which a part acts, Pi."""
        return self.strain_energy(q) + pressure * self.sinking(q)

    def sinking(self, q: Array) -> Array:
        """Conjugate of the pressures' part that acts: dead loads times their displacement."""
        top = self._moved(q, self.x, self.half_height)[1]
        return jnp.sum(self.load * top) - jnp.sum(self.bottom_load * q[:, W])

    def strain_energy(self, q: Array) -> Array:
        """Elastic energy of the strip with nodal fields q (n, 4), per unit width."""
        if self.section is None:
            density = jax.vmap(jax.vmap(self.energy))(*self._strains(q))
        else:
            density = jax.vmap(jax.vmap(self.section.energy))(*self._sections(q))
        return jnp.sum(self.rule.weights[:, None] * self.lengths * density)

    def section_forces(self, q: Array) -> Strains:
        """Mean N, Q, M, chi and xi of every element, (elements,) each."""
        strains = self._strains(q)
        if self.section is None:
            each = jax.vmap(jax.vmap(lambda s: forces(self.energy, s)))(strains)
        else:
            each = jax.vmap(jax.vmap(self.section.forces))(*self._sections(q))
        if self.model.squeeze == "assumed":
            stretch = 2.0 * self.half_height * jnp.asarray(self.youngs_modulus)
            each = each._replace(psi=stretch * strains.psi)
        return jax.tree.map(lambda f: jnp.sum(self.rule.weights[:, None] * f, axis=0), each)

    @property
    def middles(self) -> Array:
        """Middle of every element, (elements,)."""
        return self._starts + 0.5 * self.lengths

    @property
    def _starts(self) -> Array:
        return self.x[: -1 : elements.ORDER[self.model.grid]]

    def _sections(self, q: Array) -> tuple[list[Array], list[Array]]:
        """Fields and their slopes at all points of all elements, (points, elements) each."""

        def at(shape: np.ndarray, values: Array) -> Array:
            # Elements last, and no matrix product: the compiler works on whole vectors of them.
            return jnp.asarray(sum(s[:, None] * v for s, v in zip(shape.T, values.T, strict=True)))

        rule, order = self.rule, elements.ORDER[self.model.grid]
        nodal = [elements.gather(column, order) for column in q.T]
        section = [at(self.shapes(field), values) for field, values in enumerate(nodal)]
        slope = [at(rule.slopes, values) / self.lengths for values in nodal]
        if self.curvature is not None:
            inside = rule.values @ rule.nodes
            angle = self._angle(self._starts + inside[:, None] * self.lengths)
            slope[V], slope[W] = rotated(slope[V], slope[W], angle)
        return section, slope

    def shapes(self, field: int) -> np.ndarray:
        """Interpolation (points, p+1) of a field from an element's nodes to its strain points."""
        # The beamshell's squeeze strain is integrated at the nodes, lest it oscillate.
        nodal = field == PSI and self.section is None
        return self.rule.squeeze if nodal else self.rule.values

    def section_stiffness(self) -> Array:
        """Hessian (2, m, 2, m) of a section's strain energy at rest, in its fields and slopes."""

        def energy(both: Array) -> Array:
            section, slope = both
            if self.section is not None:
                return self.section.energy(section, slope)
            return self.energy(
                *self._kinematics.strains(section, slope, self.half_height, self.curvature)
            )

        return jax.hessian(energy)(jnp.zeros((2, self.model.width), self.x.dtype))

    def _strains(self, q: Array) -> Strains:
        """The beamshell's strains at all points of all elements, (points, elements) each."""
        section, slope = self._sections(q)
        straight = slice(len(FIELDS))
        return self._kinematics.strains(
            section[straight], slope[straight], self.half_height, self.curvature
        )

    def end_displacement(self, q: Array) -> Array:
        """u(L) of the loaded end, the conjugate of F: the mean over the height, or mid-height."""
        if self.section is not None:
            return self.section.mean_displacement(q[-1])
        return self._moved(q[-1:], self.x[-1:], 0.0)[0][0]

    # --- residual -------------------------------------------------------------------------------

    @property
    def cap_floor(self) -> Array:
        """Cap of a point without reaction."""
        return CAP_FLOOR * self.force_scale / jnp.sum(self.tributary, axis=0)

    def rest(self) -> Level:
        """The strip before anything acts on it."""
        zero = jnp.zeros_like(self.x)
        fields = jnp.zeros((self.x.size, self.model.width), zero.dtype)
        return Level(fields, zero, zero, zero, zero[0])

    def embed(self, active: Array) -> Array:
        """Active fields to all fields of the sections, (n, m); frozen ones are zero."""
        columns = [jnp.zeros_like(self.x)] * self.model.width
        for column, field in enumerate(self.model.active):
            columns[field] = active[:, column]
        return jnp.stack(columns, axis=1)

    @eqx.filter_jit  # traced once for its several uses in a solver
    def advance(self, change: Array, before: Level, drive: Drive) -> tuple[Level, Array, Seen]:
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
        seen : what the foundation sees, the first arguments of `touch`
        """
        q = before.q + self.embed(change)
        forces = self.elastic(q, drive.pressure)
        seen = (forces[:, W], q[:, V], q[:, W])
        touch = self.touch(*seen, before, drive)
        force, residual = self.balance(forces, q, touch, drive)
        cap = self.cap(touch.reaction)
        return Level(q, touch.traction, cap, touch.reaction, force), residual, seen

    def elastic(self, q: Array, pressure: ArrayLike) -> Array:
        """Forces of the potential, (n, m)."""
        return jax.grad(self.potential)(q, pressure)

    def touch(self, balance: Array, v: Array, w: Array, before: Level, drive: Drive) -> Touch:
        """What the foundation answers at the nodes, which do not see each other.

        Parameters
        ----------
        balance : (n,) forces of the potential along w
        v, w : (n,) fields
        before, drive : as of `advance`
        """
        pressed, gap = balance / self.tributary, self._gap(w)
        reaction = jax.vmap(self.normal.reaction)(pressed, gap)
        cap = self.cap(reaction)
        slip = jax.vmap(self.law.traction, in_axes=(0, 0, 0, None))
        rough = jnp.where(self.friction > 0.0, drive.rough, 0.0)
        # No reaction, no traction; not even the floor, whose sign would flip for ever.
        closed = jnp.clip(cap / self.cap_floor - 1.0, 0.0, 1.0)
        traction = slip(v - before.q[:, V], before.traction, cap, self.slip_stiffness)
        contact = jax.vmap(self.normal.residual)(pressed, gap)
        return Touch(rough * closed * traction, contact, reaction)

    def balance(self, forces: Array, q: Array, touch: Touch, drive: Drive) -> tuple[Array, Array]:
        """F at the loaded end, and the residual; but for F's direction linear in the first three.

        Parameters
        ----------
        forces, q : (n, m) elastic forces and fields
        touch : what the foundation answers
        drive : what the step prescribes
        """
        forces = forces.at[:, V].add(self.tributary * touch.traction)
        forces = forces.at[:, W].set(self.tributary * touch.contact)
        if self.model.squeeze == "assumed":
            mean = 0.5 * (drive.pressure * self.load / self.tributary + touch.reaction)
            assumed = jnp.asarray(self.youngs_modulus) * q[:, PSI] + mean
            forces = forces.at[:, PSI].set(2.0 * self.half_height * self.tributary * assumed)

        conjugate = jax.grad(self.end_displacement)(q)[-1]
        prescribed = jnp.asarray(self.control != "force") & (drive.rough > 0.0)
        force = jnp.where(prescribed, forces[-1, V], drive.target)
        forces = forces.at[-1].add(-force * conjugate)
        gap = self.end_displacement(q) - drive.rest
        if self.control == ARC_LENGTH:
            gap = drive.along[0] * gap + drive.along[1] * force / self.stiffness_scale
        gap = gap - drive.target
        forces = forces.at[-1, V].set(
            jnp.where(prescribed, self.stiffness_scale * gap, forces[-1, V])
        )
        forces = self._support(forces, q, drive.rough)
        per_force = jnp.stack([self._per_force(field) for field in range(self.model.width)])
        residual = (forces * per_force / self.force_scale)[:, list(self.model.active)]
        return force, residual

    def residual_scale(self, field: int) -> Array:
        """Residual per force, or per moment, of a field's balance."""
        return self._per_force(field) / self.force_scale

    def _per_force(self, field: int) -> Array:
        return 1.0 / self.half_height if field in (BETA, PSI) else jnp.ones_like(self.half_height)

    def cap(self, reaction: Array) -> Array:
        """Coulomb cap mu R, never less than its floor."""
        return jnp.maximum(self.friction * reaction, self.cap_floor)

    def supports(self, rough: bool) -> dict[int, Array]:
        """Fields that are held at X = 0, with what makes their support condition a force."""
        held = {}
        if isinstance(self.normal, Absent):
            held[W] = self.stiffness_scale
        if self.far_end == "free":  # held by friction alone, so only once there is friction
            return held if rough else held | {V: self.stiffness_scale}
        held[V] = self.stiffness_scale
        if self.far_end == "held":
            held[BETA] = self.stiffness_scale * self.half_height**2
            # Of a hierarchic section: its displacements along X.
            further = range(len(FIELDS), self.model.width, 2)
            held |= dict.fromkeys(further, self.stiffness_scale)
        return held

    def _support(self, forces: Array, q: Array, rough: Array) -> Array:
        """Replace the balance of held fields at X = 0 by their support condition."""

        def held(supports: dict[int, Array]) -> Array:
            found = forces
            for field, scale in supports.items():
                found = found.at[0, field].set(scale * q[0, field])
            return found

        with_friction, without = self.supports(True), self.supports(False)
        if with_friction.keys() == without.keys():
            return held(with_friction)
        return jnp.where(rough > 0.0, held(with_friction), held(without))

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
        rubs = (self.friction > 0.0) & (jnp.maximum(before.cap, after.cap) > 2.0 * self.cap_floor)
        return jnp.sum(self.tributary * jnp.where(rubs, work, 0.0))

    def stored_energy(self, level: Level, pressure: Array) -> Array:
        """Potential Pi plus the elastic energy of the contact's compliance."""
        sliders = level.traction**2 / (2.0 * self.slip_stiffness)
        layer = jax.vmap(self.normal.energy)(self.gap(level.q))
        return self.potential(level.q, pressure) + jnp.sum(self.tributary * (sliders + layer))


def _steps(contact: Contact, length: Array) -> Array | None:
    """Positions at which a pressure jumps; None where both are single numbers."""
    tables = [p for p in (contact.pressure, contact.bottom_pressure) if p.ndim == 2]
    if not tables:
        return None
    return jnp.sort(jnp.concatenate([elements.table_steps(table, length) for table in tables]))

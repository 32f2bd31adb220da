r"""Equilibrium of a scene at one load level: strip, foundation, supports and end load together.

Elastic energy and pressure have a potential Pi; friction has none, because its cap depends on the
solution.  With q_i the fields of node i, l_i its tributary length, t its friction traction and F
the end force, conjugate to the mid-height displacement u(L) of the loaded end,

    dPi/dq_i + l_i t_i (in the row of v_i) - F du(L)/dq_i = 0,        R_i = (dPi/dw_i)/l_i.

The normal reaction R follows because the contact point's lift w is a field, active or frozen.
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array

from jbeamshell.load_steps.elastic_strip import BETA, PSI, ElasticStrip, V, W
from jbeamshell.load_steps.foundation import Foundation
from jbeamshell.mechanics.kinematics import FIELDS
from jbeamshell.scene.keys import ARC_LENGTH, FAR_ENDS
from jbeamshell.scene.scene import Scene

LAST = -1  # node at the loaded end


class LoadLevel(NamedTuple):
    """State of the strip at the end of a load step, all that the next step needs to know.

    Attributes
    ----------
    q : (n, 4) nodal fields v, w, beta and psi
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


class Prescribed(NamedTuple):
    """Quantities that a load step prescribes.

    The controlled quantity is F under force control, else a U + b F L/(E' 2H) with the weights
    (a, b) and U = u(L) - origin.

    Attributes
    ----------
    controlled : value of the controlled quantity
    pressure : part of the pressures that acts
    origin : u(L) after the pressure, from which displacements are counted
    rough : 1 with friction, 0 in the pressure steps before it, which end at F = 0
    weights : (2,) weights (a, b): (1, 0) under displacement control
    """

    controlled: Array
    pressure: Array
    origin: Array
    rough: Array
    weights: Array | tuple[float, float] = (1.0, 0.0)


class ContactInput(NamedTuple):
    """Quantities to which the foundation responds, (n,) each.

    Attributes
    ----------
    lift_force : forces dPi/dw of the potential along w
    v, w : fields
    """

    lift_force: Array
    v: Array
    w: Array


class ContactResponse(NamedTuple):
    """Response of the foundation, (n,) each.

    Attributes
    ----------
    traction : friction traction t
    normal_residual : pressure that is zero where normal contact is in equilibrium
    reaction : normal reaction R
    """

    traction: Array
    normal_residual: Array
    reaction: Array


class System(ElasticStrip):
    """Equations of equilibrium of a scene: an elastic strip, its foundation, supports and end load.

    Attributes
    ----------
    foundation : friction and normal contact
    stiffness_scale : E' 2H/L, which turns support conditions into forces
    force_scale : mu F_N L, or F_N L without friction, which makes residuals dimensionless
    far_end : support at X = 0
    control : controlled quantity at the loaded end
    entry : how the force enters there
    """

    foundation: Foundation
    stiffness_scale: Array
    force_scale: Array
    far_end: str = eqx.field(static=True)
    control: str = eqx.field(static=True)
    entry: str = eqx.field(static=True)

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        strip, friction = scene.strip, scene.contact.friction
        self.stiffness_scale = strip.stretching_stiffness / strip.length
        normal_force = jnp.sum(self.load)
        self.force_scale = normal_force * jnp.where(friction > 0.0, friction, 1.0)
        self.foundation = Foundation(scene, normal_force, self.force_scale, self.tributary)
        self.far_end, self.control = strip.far_end, scene.load.control
        self.entry = scene.load.entry

    @property
    def linear(self) -> bool:
        """True if all but the foundation's response is linear in the fields."""
        return self.plan.kinematics == "linear" and self.quadratic_energy

    @property
    def ends_depend_on_friction(self) -> bool:
        """True if the ends are held differently in the pressure steps, which have no friction."""
        return self.control != "force" or self.supports(True).keys() != self.supports(False).keys()

    def enters_residual(self, part: str) -> bool:
        """True if that part of a `ContactResponse` enters the residual."""
        fields = {"traction": "v", "normal_residual": "w", "reaction": "psi"}
        used = part != "reaction" or self.plan.section == "assumed"
        return used and fields[part] in self.plan.fields

    def unloaded(self) -> LoadLevel:
        """State of the strip before anything acts on it."""
        zero = jnp.zeros_like(self.x)
        fields = jnp.zeros((self.x.size, len(FIELDS)), zero.dtype)
        return LoadLevel(fields, zero, zero, zero, zero[0])

    # --- equilibrium ----------------------------------------------------------------------------

    @eqx.filter_jit  # traced once for its several uses in a solver
    def advance(
        self, change: Array, before: LoadLevel, prescribed: Prescribed
    ) -> tuple[LoadLevel, Array, ContactInput]:
        """Load level after a change of the active fields, and the out-of-balance forces there.

        Parameters
        ----------
        change : (n, active) increments of the active fields
        before : load level at the start of the step
        prescribed : quantities that the step prescribes

        Returns
        -------
        level : load level after the change
        residual : (n, active) out-of-balance forces over mu F_N L, moments over mu F_N L H; zero
            in equilibrium
        contact : input of `contact_response`
        """
        q = before.q + self.embed(change)
        forces = self.elastic_forces(q, prescribed.pressure)
        contact = ContactInput(forces[:, W], q[:, V], q[:, W])
        response = self.contact_response(contact, before, prescribed)
        force, residual = self.balance(forces, q, response, prescribed)
        cap = self.foundation.cap(response.reaction)
        level = LoadLevel(q, response.traction, cap, response.reaction, force)
        return level, residual, contact

    def contact_response(
        self, contact: ContactInput, before: LoadLevel, prescribed: Prescribed
    ) -> ContactResponse:
        """Response of the foundation; nodes do not depend on each other. See `advance`."""
        pressed, gap = contact.lift_force / self.tributary, self.gap_from_lift(contact.w)
        reaction = self.foundation.reaction(pressed, gap)
        slip = contact.v - before.q[:, V]
        traction = self.foundation.traction(slip, before.traction, reaction, prescribed.rough)
        return ContactResponse(traction, self.foundation.normal_residual(pressed, gap), reaction)

    def balance(
        self, forces: Array, q: Array, response: ContactResponse, prescribed: Prescribed
    ) -> tuple[Array, Array]:
        """Force F at the loaded end, and the residual of equilibrium.

        Both are linear in the first three arguments, but for the direction of F.

        Parameters
        ----------
        forces, q : (n, m) elastic forces and fields
        response : response of the foundation
        prescribed : quantities that the step prescribes
        """
        forces = forces.at[:, V].add(self.tributary * response.traction)
        forces = forces.at[:, W].set(self.tributary * response.normal_residual)
        if self.plan.section == "assumed":
            mean = 0.5 * (prescribed.pressure * self.load / self.tributary + response.reaction)
            assumed = jnp.asarray(self.youngs_modulus) * q[:, PSI] + mean
            forces = forces.at[:, PSI].set(2.0 * self.half_height * self.tributary * assumed)
        force, forces = self._end_load(forces, q, prescribed)
        forces = self._hold_ends(forces, q, prescribed.rough)
        per_force = jnp.stack([self._per_force(field) for field in range(len(FIELDS))])
        residual = (forces * per_force / self.force_scale)[:, list(self.plan.active)]
        return force, residual

    def _end_load(self, forces: Array, q: Array, prescribed: Prescribed) -> tuple[Array, Array]:
        """Force F, and the forces (n, m) with F or, in the row of v(L), what controls the end."""
        conjugate = jax.grad(self.end_displacement)(q)[-1]
        no_force = jnp.asarray(self.control != "force") & (prescribed.rough > 0.0)
        force = jnp.where(no_force, forces[-1, V], prescribed.controlled)
        forces = forces.at[-1].add(-force * conjugate)
        reached = self.end_displacement(q) - prescribed.origin
        if self.control == ARC_LENGTH:
            weights = prescribed.weights
            reached = weights[0] * reached + weights[1] * force / self.stiffness_scale
        condition = self.stiffness_scale * (reached - prescribed.controlled)
        return force, forces.at[-1, V].set(jnp.where(no_force, condition, forces[-1, V]))

    def _hold_ends(self, forces: Array, q: Array, rough: Array) -> Array:
        """Replace the balance of the fields held at both ends by their support conditions."""

        def held(supports: dict[tuple[int, int], Array]) -> Array:
            balance = forces
            for place, scale in supports.items():
                balance = balance.at[place].set(scale * q[place])
            return balance

        with_friction, without = self.supports(True), self.supports(False)
        if with_friction.keys() == without.keys():
            return held(with_friction)
        return jnp.where(rough > 0.0, held(with_friction), held(without))

    def supports(self, rough: bool) -> dict[tuple[int, int], Array]:
        """Held fields, by node and number, each with the factor that makes its condition a force.

        Without friction something must hold v at X = 0: a free end is held too until friction acts.
        """
        names = FAR_ENDS[self.far_end]
        scales = {}
        if not self.foundation.present:
            scales[0, W] = self.stiffness_scale
        if "v" in names or not rough:
            scales[0, V] = self.stiffness_scale
        turning = self.stiffness_scale * self.half_height**2
        ends = [0] if "beta" in names else []
        if self.entry == "guided":
            ends.append(LAST)
        return scales | {(node, BETA): turning for node in ends}

    def end_displacement(self, q: Array) -> Array:
        """Displacement u(L) of the loaded end, the conjugate of F; see `ElasticStrip`."""
        fields = [field for node, field in self.supports(True) if node == LAST]
        return super().end_displacement(q.at[LAST, fields].set(0.0) if fields else q)

    def residual_scale(self, field: int) -> Array:
        """Residual per force, or per moment, in a field's balance."""
        return self._per_force(field) / self.force_scale

    def _per_force(self, field: int) -> Array:
        return 1.0 / self.half_height if field in (BETA, PSI) else jnp.ones_like(self.half_height)

    # --- energies of a step ---------------------------------------------------------------------

    def slip_work(self, before: LoadLevel, after: LoadLevel) -> Array:
        """Work dissipated by friction in a step, per unit width."""
        work = self.foundation.slip_work(
            after.q[:, V] - before.q[:, V],
            (before.traction, after.traction),
            (before.cap, after.cap),
        )
        return jnp.sum(self.tributary * work)

    def stored_energy(self, level: LoadLevel, pressure: Array) -> Array:
        """Potential Pi plus the energy stored in sliders and contact layer, per unit width."""
        layer = self.foundation.stored_energy(self.gap(level.q), level.traction)
        return self.potential(level.q, pressure) + jnp.sum(self.tributary * layer)

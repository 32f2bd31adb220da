r"""Equations of motion of a scene: forces of equilibrium and inertia, and energies.

The state holds the free fields q, their rates p and the friction tractions t of all nodes.  With
the potential Pi of `jbeamshell.load_steps.system`, the mass matrix M, the damping matrix C, the
end force F and the acceleration (a_x, a_y) of the foundation,

    M p_t + (M_t p - dT/dq) = F du(L)/dq - dPi/dq - l t - M (e_x a_x + e_y a_y) - C p,
    q_t = p.

The accelerations are explicit in the state.  Elasticity and inertia together give the reaction that
caps the friction,

    R_i = (dPi/dw_i + (M p_t)_i + ...)/l_i,

without iteration (Brink 2015, eqs. 2.30-2.41 and 4.34-4.54, in the fields of the contact point).
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array

from jbeamshell.common.checks import require
from jbeamshell.dynamics.strip.excitation import Excitation
from jbeamshell.dynamics.strip.inertia import Inertia
from jbeamshell.dynamics.strip.mass_matrix import MassMatrix
from jbeamshell.load_steps.system import System, V, W
from jbeamshell.mechanics.friction import ElasticSlip, SharpSlip
from jbeamshell.mechanics.normal_contact import Compliance
from jbeamshell.scene.scene import Scene


class MotionState(NamedTuple):
    """State of a motion at the n nodes.

    Attributes
    ----------
    q, p : (n, a) active fields and their rates
    t : (n,) friction tractions
    work : (3,) external work, and work lost by friction and by damping, per width
    """

    q: Array
    p: Array
    t: Array
    work: Array


class Equations(eqx.Module):
    """Forces, accelerations and energies of a scene in motion.

    Attributes
    ----------
    system : equations of equilibrium
    mass : mass matrix of strip and payload
    inertia : density and damping
    excitation : forces and accelerations of the foundation
    """

    system: System
    mass: MassMatrix
    inertia: Inertia
    excitation: Excitation

    def __init__(
        self, scene: Scene, inertia: Inertia, payload: Array, excitation: Excitation
    ) -> None:
        self.system = System(scene)
        self.mass = MassMatrix(scene, self.system, inertia, payload)
        self.inertia, self.excitation = inertia, excitation

    def active(self, nodal: Array) -> Array:
        """Active fields (n, a) of all fields (n, m)."""
        return nodal[:, list(self.system.plan.active)]

    def initial_state(self, q: Array, traction: Array) -> MotionState:
        """State at rest in fields q (n, m) under tractions (n,), after a blow on the end."""
        impulse = self.excitation.initial_impulse
        blow = jnp.zeros_like(q).at[-1].set(impulse * self.end_conjugate(q))
        rate = self.mass.accelerations(q, blow)
        return MotionState(self.active(q), self.active(rate), traction, jnp.zeros(3, q.dtype))

    def response(self, time: Array, state: MotionState) -> tuple[Array, Array]:
        """Accelerations (n, m) and normal reaction (n,) in a state at a time."""
        system, foundation = self.system, self.system.foundation
        q, p = system.embed(state.q), system.embed(state.p)
        inner = system.elastic_forces(q, 1.0).at[:, V].add(system.tributary * state.t)
        inner = inner + self.damping(q, p) + self.mass.velocity_forces(q, p)
        inner = inner + self.ground_forces(q, self.excitation.acceleration(time))
        forces = (-inner).at[-1].add(self.excitation.force(time) * self.end_conjugate(q))
        if isinstance(foundation.normal_law, Compliance):
            reaction = foundation.reaction(q[:, W], system.gap(q))
            forces = forces.at[:, W].add(system.tributary * reaction)
            return self.mass.accelerations(q, forces), reaction
        acceleration = self.mass.accelerations(q, forces)
        if not foundation.present:
            return acceleration, jnp.zeros_like(system.x)
        balance = self.mass.momentum(q, acceleration)[:, W] - forces[:, W]
        return acceleration, balance / system.tributary

    def energies(self, state: MotionState) -> tuple[Array, Array]:
        """Kinetic energy, and stored energy of strip, contact and pressures, per width."""
        system, q = self.system, self.system.embed(state.q)
        layer = system.foundation.stored_energy(system.gap(q), state.t)
        stored = system.potential(q, 1.0) + jnp.sum(system.tributary * layer)
        return self.mass.energy(q, system.embed(state.p)), stored

    def damping(self, q: Array, p: Array) -> Array:
        """Forces C p (n, m) of Rayleigh damping."""
        if not self.inertia.damped:
            return jnp.zeros_like(q)
        _, elastic = jax.jvp(lambda q: self.system.elastic_forces(q, 1.0), (q,), (p,))
        inertial = self.mass.momentum(q, p)
        return self.inertia.damping_mass * inertial + self.inertia.damping_stiffness * elastic

    def ground_forces(self, q: Array, ground: tuple[Array, Array]) -> Array:
        """Inertia forces M (e_x a_x + e_y a_y) (n, m) from the acceleration of the foundation."""
        fields = jnp.zeros_like(q).at[:, V].set(ground[0]).at[:, W].set(ground[1])
        return self.mass.momentum(q, fields)

    def end_conjugate(self, q: Array) -> Array:
        """Derivatives du(L)/dq (m,) in the fields of the end section."""
        return jax.grad(self.system.end_displacement)(q)[-1]


def movable(scene: Scene, inertia: Inertia) -> Scene:
    """Scene by load steps; raises `InputError` for one that has no equations of motion here.

    A rigid contact that may open is an algebraic constraint, which solvers of ordinary differential
    equations do not accept: the strip is held down, unless ``contact.normal`` is compliant.
    """
    scene = scene.by_load_steps()
    if scene.contact.normal == "rigid":
        scene = scene.replace({"contact.normal": "held"})
    contact, strip = scene.contact, scene.strip
    require("load.control", scene.load.control, scene.load.control == "force", "must be 'force'")
    section = scene.plan.section
    require("model.section", section, section != "assumed", "has no inertia: take 'squeeze'")
    fix = "is not possible in dynamics: take a straight strip"
    require("strip.curvature", strip.curvature, strip.curvature is None, fix)
    steady = isinstance(contact.law, SharpSlip | ElasticSlip)
    fix = "depends on the size of the steps: take 'elastic-slip'"
    require("contact.law", type(contact.law).__name__, steady, fix)
    inertia.check(scene)
    return scene

r"""Equations of motion of a scene: forces of equilibrium, inertia, and the rate law of friction.

The state holds the free fields q, their rates p and the friction tractions t of all nodes.  With
the potential Pi of `jbeamshell.load_steps.system`, the mass matrix M, the damping matrix C, the
end force F and the acceleration (a_x, a_y) of the foundation,

    M p_t + (M_t p - dT/dq) = F du(L)/dq - dPi/dq - l t - M (e_x a_x + e_y a_y) - C p,
    q_t = p,      t_t by the rate law of friction.

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
import numpy as np
from jax import Array

from jbeamshell.common.checks import require
from jbeamshell.dynamics.strip import rate_friction
from jbeamshell.dynamics.strip.attached_masses import AttachedMasses
from jbeamshell.dynamics.strip.chain import chain_energies, chain_response
from jbeamshell.dynamics.strip.excitation import Excitation
from jbeamshell.dynamics.strip.inertia import Inertia
from jbeamshell.dynamics.strip.mass_matrix import MassMatrix
from jbeamshell.load_steps.system import System, V, W
from jbeamshell.mechanics.friction import coulomb_cap
from jbeamshell.mechanics.normal_contact import Compliance
from jbeamshell.scene.scene import Scene

LOOSE = 30.0  # tolerance of rates and tractions over that of fields, relative to their scales


class MotionState(NamedTuple):
    """State of a motion, at the b = n + k nodes and chain masses.

    The masses of the chain follow the nodes, and use the first field only.

    Attributes
    ----------
    q, p : (b, a) active fields and their rates
    t : (b,) friction tractions
    work : (3,) external work, and work lost by friction and by damping, per width
    """

    q: Array
    p: Array
    t: Array
    work: Array


class InstantResponse(NamedTuple):
    """Response of a strip to its state at an instant.

    Attributes
    ----------
    acceleration : (b, a) accelerations of the active fields
    reaction, cap : (n,) normal reaction R and cap mu R
    traction_rate : (n,) rates of the friction tractions
    power : (3,) rates of `MotionState.work`
    """

    acceleration: Array
    reaction: Array
    cap: Array
    traction_rate: Array
    power: Array


class Equations(eqx.Module):
    """Right-hand side of the equations of motion of a scene.

    Attributes
    ----------
    system : equations of equilibrium
    mass : mass matrix
    inertia : inertia constants
    attached : masses at the loaded end
    excitation : forces and accelerations of the foundation
    exponent : m of the rate law
    relaxation_time : time in which a traction follows a falling cap, H over the speed of sound
    scales : scales of the state, by which one tolerance fits all its parts
    time_scale : time scale of the motion
    """

    system: System
    mass: MassMatrix
    inertia: Inertia
    attached: AttachedMasses
    excitation: Excitation
    exponent: Array
    relaxation_time: Array
    scales: MotionState
    time_scale: Array

    def __init__(
        self, scene: Scene, inertia: Inertia, attached: AttachedMasses, excitation: Excitation
    ) -> None:
        self.system = system = System(scene)
        self.mass = MassMatrix(scene, system, inertia, attached.payload)
        self.inertia, self.attached, self.excitation = inertia, attached, excitation
        self.exponent = rate_friction.exponent(scene.contact.law)
        strip = scene.strip
        strip_mass = 2.0 * strip.half_height * inertia.mean_density(scene) * strip.length
        speed = jnp.sqrt(strip.stretching_stiffness * strip.length / strip_mass)
        self.relaxation_time = strip.half_height / speed
        added = attached.payload + jnp.sum(attached.masses)
        self.time_scale = strip.length / speed * jnp.sqrt(1.0 + added / strip_mass)
        self.scales = _scales(scene, system, self.time_scale)

    @property
    def n(self) -> int:
        """Number of nodes."""
        return self.system.x.size

    # --- the state ------------------------------------------------------------------------------

    def nodal(self, active: Array) -> Array:
        """All fields (n, m) of the nodes from active fields (b, a)."""
        return self.system.embed(active[: self.n])

    def with_chain(self, nodal: Array, chain: Array) -> Array:
        """Active fields (b, a) from all fields (n, m) of the nodes and those (k,) of the chain."""
        active = nodal[:, list(self.system.plan.active)]
        rows = jnp.zeros((chain.size, active.shape[1]), active.dtype)
        return jnp.append(active, rows.at[:, 0].set(chain), 0)

    def initial_state(self, q: Array, traction: Array, impulse: Array) -> MotionState:
        """State at rest in fields q (n, m) under tractions (n,), after an impulse on the end."""
        conjugate = jnp.zeros_like(q).at[-1].set(self.end_conjugate(q))
        rate = self.mass.accelerations(q, impulse * conjugate)
        chain = jnp.full(self.attached.count, self.system.end_displacement(q))
        return MotionState(
            self.with_chain(q, chain),
            self.with_chain(rate, jnp.zeros_like(chain)),
            jnp.append(traction, jnp.zeros_like(chain)),
            jnp.zeros(3, q.dtype),
        )

    # --- the right-hand side --------------------------------------------------------------------

    def __call__(self, time: Array, state: MotionState) -> MotionState:
        """Rates of a state."""
        found = self.response(time, state)
        traction_rate = jnp.pad(found.traction_rate, (0, self.attached.count))
        return MotionState(state.p, found.acceleration, traction_rate, found.power)

    def response(self, time: Array, state: MotionState) -> InstantResponse:
        """Accelerations, contact and powers in a state at a time."""
        system, foundation, n = self.system, self.system.foundation, self.n
        q, p, t = self.nodal(state.q), self.nodal(state.p), state.t[:n]
        ground, end_force = self.excitation.acceleration(time), self.excitation.force(time)
        ground_forces, damping = self.ground_forces(q, ground), self.damping(q, p)
        internal = system.elastic_forces(q, 1.0)
        conjugate = self.end_conjugate(q)
        end_rate = jnp.sum(conjugate * p[-1])
        rates = state.p[n:, 0]
        chain = chain_response(
            self.attached, (system.end_displacement(q), end_rate), (state.q[n:, 0], rates)
        )
        internal = internal.at[:, V].add(system.tributary * t).at[-1].add(-chain.force * conjugate)
        forces = -(internal + damping + ground_forces + self.mass.velocity_forces(q, p))
        forces = forces.at[-1].add(end_force * conjugate)
        acceleration, reaction = self._accelerations(q, forces)
        cap = coulomb_cap(foundation.friction, reaction)
        traction_rate = self._traction_rates(t, p[:, V], cap)
        friction = t * p[:, V] - t * traction_rate / foundation.slip_stiffness
        external = end_force * end_rate - jnp.sum(ground_forces * p)
        external = external - ground[0] * jnp.sum(self.attached.masses * rates)
        damped = jnp.sum(damping * p) + chain.damping_power
        return InstantResponse(
            acceleration=self.with_chain(acceleration, chain.accelerations - ground[0]),
            reaction=reaction,
            cap=cap,
            traction_rate=traction_rate,
            power=jnp.stack([external, jnp.sum(system.tributary * friction), damped]),
        )

    def energies(self, state: MotionState) -> tuple[Array, Array]:
        """Kinetic and stored energy per width of strip, contact, pressures and chain."""
        system, n = self.system, self.n
        q, p, t = self.nodal(state.q), self.nodal(state.p), state.t[:n]
        chain = (state.q[n:, 0], state.p[n:, 0])
        kinetic, springs = chain_energies(self.attached, system.end_displacement(q), chain)
        layer = system.foundation.stored_energy(system.gap(q), t)
        stored = system.potential(q, 1.0) + jnp.sum(system.tributary * layer)
        return self.mass.energy(q, p) + kinetic, stored + springs

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

    def _accelerations(self, q: Array, forces: Array) -> tuple[Array, Array]:
        """Accelerations (n, m) and reaction (n,) under forces (n, m) without the reaction."""
        system, foundation = self.system, self.system.foundation
        if isinstance(foundation.normal_law, Compliance):
            reaction = foundation.reaction(q[:, W], system.gap(q))
            forces = forces.at[:, W].add(system.tributary * reaction)
            return self.mass.accelerations(q, forces), reaction
        acceleration = self.mass.accelerations(q, forces)
        if not foundation.present:
            return acceleration, jnp.zeros_like(system.x)
        balance = self.mass.momentum(q, acceleration)[:, W] - forces[:, W]
        return acceleration, balance / system.tributary

    def _traction_rates(self, t: Array, speed: Array, cap: Array) -> Array:
        """Rates of the tractions (n,)."""
        foundation = self.system.foundation
        if not foundation.present:
            return jnp.zeros_like(t)
        rate = rate_friction.traction_rate(
            t, speed, cap, foundation.slip_stiffness, self.exponent, foundation.cap_floor
        )
        rate = jnp.where(foundation.friction > 0.0, rate, 0.0)
        return rate + rate_friction.relaxation_rate(t, cap, self.relaxation_time)


def _scales(scene: Scene, system: System, time: Array) -> MotionState:
    """Scales of a state: a motion at gross slip."""
    strip = scene.strip
    stretch = system.force_scale * strip.length / strip.stretching_stiffness
    traction = system.force_scale / jnp.sum(system.tributary)
    sizes = [stretch] * system.plan.width
    sizes[2], sizes[3] = stretch / strip.half_height, stretch / strip.length
    fields = jnp.stack(sizes)[np.array(system.plan.active)]
    energy = system.force_scale * stretch
    # Vibrations far faster than those of interest need no accuracy in rates and tractions.
    rates = LOOSE * fields / time
    scales = MotionState(fields, rates, LOOSE * traction, energy * jnp.ones(3))
    return jax.tree.map(jax.lax.stop_gradient, scales)


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
    rate_friction.exponent(contact.law)
    inertia.check(scene)
    return scene

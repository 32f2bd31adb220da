r"""Equations of motion of a scene: the forces of equilibrium, inertia, and friction as a rate law.

The state holds the free fields q, their rates p and the friction tractions t of all nodes.  With
the potential Pi of `jbeamshell.quasistatic.system`, the mass matrix M and the end force F,

    M p_t + (M_t p - dT/dq) = F du(L)/dq - dPi/dq - l t - M (e_x a_x + e_y a_y) - C p,
    q_t = p,      t_t by the rate law of elastic slip,

so the accelerations are explicit in the state, and the reaction that caps the friction is

    R_i = (dPi/dw_i + (M p_t)_i + ...)/l_i,

elasticity and inertia alike: no inner iteration (Brink 2015, eqs. 2.30-2.41, 4.34-4.54, in the
fields of the contact point).
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.linalg import cho_solve

from jbeamshell.common.checks import require
from jbeamshell.dynamics.strip import rate_friction
from jbeamshell.dynamics.strip.attached_masses import AttachedMasses
from jbeamshell.dynamics.strip.excitation import Excitation
from jbeamshell.dynamics.strip.inertia import Inertia, Masses, free, solved
from jbeamshell.mechanics.friction import coulomb_cap
from jbeamshell.mechanics.normal_contact import Compliance
from jbeamshell.quasistatic.system import System, V, W
from jbeamshell.scene.scene import Scene

CARELESS = 30.0  # how much larger errors of rates and tractions may be, in their own sizes


class MotionState(NamedTuple):
    """Where a motion stands; chain masses come behind the nodes, in the first field.

    Attributes
    ----------
    q, p : (b, a) free fields of the n nodes and the chain, and their rates
    t : (b,) friction tractions
    work : (3,) work done from outside, by friction, by material damping and dashpots, per width
    """

    q: Array
    p: Array
    t: Array
    work: Array


class InstantResponse(NamedTuple):
    """What follows from a state at an instant.

    Attributes
    ----------
    acceleration : (b, a) of the free fields
    reaction, cap : (n,) R and mu R
    slipping : (n,) rate of the tractions' state
    power : (3,) rates of `State.work`
    """

    acceleration: Array
    reaction: Array
    cap: Array
    slipping: Array
    power: Array


class Equations(eqx.Module):
    """The right-hand side of a scene's motion.

    Attributes
    ----------
    system : the forces of equilibrium
    masses : inertia
    inertia : its constants
    attached : what rides on the loaded end
    excitation : what shakes it
    smoothing : m of the rate law
    relaxation : time in which a traction follows a falling cap, H over the speed of sound
    units : sizes of the state's parts, so that one tolerance does for all
    time_unit : of a motion
    factor : Cholesky's of a consistent mass matrix
    inverse : (n, a, a) of a lumped one that is constant
    """

    system: System
    masses: Masses
    inertia: Inertia
    attached: AttachedMasses
    excitation: Excitation
    smoothing: Array
    relaxation: Array
    units: MotionState
    time_unit: Array
    factor: Array | None
    inverse: Array | None

    def __init__(
        self, scene: Scene, inertia: Inertia, attached: AttachedMasses, excitation: Excitation
    ) -> None:
        self.system = system = System(scene)
        self.masses = Masses(scene, system, inertia, attached.payload)
        self.inertia, self.attached, self.excitation = inertia, attached, excitation
        self.smoothing = rate_friction.exponent(scene.contact.law)
        strip = scene.strip
        weight = 2.0 * strip.half_height * inertia.mean_density(scene) * strip.length
        speed = jnp.sqrt(strip.stretching_stiffness * strip.length / weight)
        self.relaxation = strip.half_height / speed
        carried = attached.payload + jnp.sum(attached.masses)
        self.time_unit = strip.length / speed * jnp.sqrt(1.0 + carried / weight)
        self.units = self._units(scene)
        self.factor = self.inverse = None
        if inertia.mass == "consistent":
            self.factor = jnp.linalg.cholesky(self.dense_mass())
        elif scene.model.kinematics == "linear":
            blocks = self._free_blocks(system.unloaded().q)
            unit = jnp.broadcast_to(jnp.eye(blocks.shape[1]), blocks.shape)
            columns = [solved(blocks, unit[..., j]) for j in range(blocks.shape[1])]
            self.inverse = jnp.stack(columns, axis=2)

    def _units(self, scene: Scene) -> MotionState:
        strip, system = scene.strip, self.system
        stretch = system.force_scale * strip.length / strip.stretching_stiffness
        pressing = system.force_scale / jnp.sum(system.tributary)
        sizes = [stretch] * system.model.width
        sizes[2], sizes[3] = stretch / strip.half_height, stretch / strip.length
        fields = jnp.stack(sizes)[np.array(system.model.active)]
        energy = system.force_scale * stretch
        # Rates and tractions of vibrations far above what is looked for need no such care.
        rates = CARELESS * fields / self.time_unit
        scales = MotionState(fields, rates, CARELESS * pressing, energy * jnp.ones(3))
        return jax.tree.map(jax.lax.stop_gradient, scales)

    @property
    def n(self) -> int:
        """Number of nodes."""
        return self.system.x.size

    @property
    def moves(self) -> np.ndarray:
        """Which of the active fields (n, a) are free."""
        return free(self.system)[:, list(self.system.model.active)]

    @property
    def rubs(self) -> bool:
        """Whether there is a foundation to rub on."""
        return self.system.foundation.present

    # --- the state ------------------------------------------------------------------------------

    def nodal(self, active: Array) -> Array:
        """All fields (n, m) of the nodes from the free ones (b, a)."""
        return self.system.embed(active[: self.n])

    def initial_state(self, q: Array, traction: Array, push: Array) -> MotionState:
        """At rest in fields q (n, m) under tractions (n,), but for a push on the loaded end."""
        conjugate = jnp.zeros_like(q).at[-1].set(self.conjugate(q))
        rate = self._accelerations(q, push * conjugate)
        hung = jnp.full(self.attached.count, self.system.end_displacement(q))
        return MotionState(
            self.joined(q, hung),
            self.joined(rate, jnp.zeros_like(hung)),
            jnp.append(traction, jnp.zeros_like(hung)),
            jnp.zeros(3, q.dtype),
        )

    def end(self, q: Array) -> Array:
        """u(L) of free fields (b, a)."""
        return self.system.end_displacement(self.nodal(q))

    # --- the right-hand side --------------------------------------------------------------------

    def __call__(self, time: Array, state: MotionState) -> MotionState:
        """Rates of a state."""
        answer = self.response(time, state)
        slipping = jnp.pad(answer.slipping, (0, self.attached.count))
        return MotionState(state.p, answer.acceleration, slipping, answer.power)

    def response(self, time: Array, state: MotionState) -> InstantResponse:
        """What follows from a state at an instant."""
        system, n = self.system, self.n
        q, p, t = self.nodal(state.q), self.nodal(state.p), state.t[:n]
        shaken, end_force = self.excitation.acceleration(time), self.excitation.force(time)
        moved = jnp.zeros_like(q).at[:, V].set(shaken[0]).at[:, W].set(shaken[1])
        carried, damping = self.masses.momentum(q, moved), self.damping(q, p)
        pull = system.elastic_forces(q, 1.0)
        conjugate = self.conjugate(q)
        chain = self._chain(state, system.end_displacement(q), jnp.sum(conjugate * p[-1]))
        pull = pull.at[:, V].add(system.tributary * t).at[-1].add(-chain.force * conjugate)
        force = -(pull + damping + carried + self.masses.velocity_forces(q, p))
        force = force.at[-1].add(end_force * conjugate)
        if isinstance(system.foundation.normal_law, Compliance):
            reaction = system.foundation.reaction(q[:, W], system.gap(q))
            force = force.at[:, W].add(system.tributary * reaction)
            acceleration = self._accelerations(q, force)
        else:
            acceleration = self._accelerations(q, force)
            pressed = self.masses.momentum(q, acceleration)[:, W] - force[:, W]
            reaction = pressed / system.tributary if self.rubs else jnp.zeros_like(t)
        cap = coulomb_cap(system.foundation.friction, reaction)
        slipping = self._slipping(t, p[:, V], cap)
        lost = t * p[:, V] - t * slipping / system.foundation.slip_stiffness
        given = end_force * jnp.sum(conjugate * p[-1]) - jnp.sum(carried * p)
        given = given - shaken[0] * jnp.sum(self.attached.masses * chain.rates)
        warmed = jnp.sum(damping * p) + chain.loss
        return InstantResponse(
            acceleration=self.joined(acceleration, chain.accelerations - shaken[0]),
            reaction=reaction,
            cap=cap,
            slipping=slipping,
            power=jnp.stack([given, jnp.sum(system.tributary * lost), warmed]),
        )

    def energies(self, state: MotionState) -> tuple[Array, Array]:
        """Kinetic and stored energy per width, the sliders', the contact's and the chain's too."""
        system, n = self.system, self.n
        q, p, t = self.nodal(state.q), self.nodal(state.p), state.t[:n]
        chain = 0.5 * jnp.sum(self.attached.masses * state.p[n:, 0] ** 2)
        stretch = jnp.diff(jnp.append(system.end_displacement(q), state.q[n:, 0]))
        springs = 0.5 * jnp.sum(self.attached.springs * stretch**2)
        layer = system.foundation.stored_energy(system.gap(q), t)
        stored = system.potential(q, 1.0) + jnp.sum(system.tributary * layer)
        return self.masses.kinetic(q, p) + chain, stored + springs

    # --- its parts ------------------------------------------------------------------------------

    def _slipping(self, t: Array, speed: Array, cap: Array) -> Array:
        """Rates of the tractions (n,)."""
        system = self.system
        if not self.rubs:
            return jnp.zeros_like(t)
        foundation = system.foundation
        slid = rate_friction.traction_rate(
            t, speed, cap, foundation.slip_stiffness, self.smoothing, foundation.cap_floor
        )
        slid = jnp.where(foundation.friction > 0.0, slid, 0.0)
        return slid + rate_friction.relaxation_rate(t, cap, self.relaxation)

    def damping(self, q: Array, p: Array) -> Array:
        """Rayleigh's forces (n, m)."""
        if not self.inertia.damped:
            return jnp.zeros_like(q)
        _, stiff = jax.jvp(lambda q: self.system.elastic_forces(q, 1.0), (q,), (p,))
        inertial = self.masses.momentum(q, p)
        return self.inertia.damping_mass * inertial + self.inertia.damping_stiffness * stiff

    def conjugate(self, q: Array) -> Array:
        """What the end force does to the fields (m,) of the end section."""
        return jax.grad(self.system.end_displacement)(q)[-1]

    def _chain(self, state: MotionState, end: Array, rate: Array) -> _Chain:
        """The chain's forces, from the loaded end's displacement and rate."""
        attached, n = self.attached, self.n
        rates = state.p[n:, 0]
        stretch = jnp.diff(jnp.append(end, state.q[n:, 0]))
        pulling = jnp.diff(jnp.append(rate, rates))
        held = attached.springs * stretch + attached.dampers * pulling
        forces = jnp.append(held[1:], jnp.zeros(min(attached.count, 1))) - held
        return _Chain(
            force=jnp.sum(held[:1]),
            accelerations=forces / attached.masses,
            rates=rates,
            loss=jnp.sum(attached.dampers * pulling**2),
        )

    def _accelerations(self, q: Array, force: Array) -> Array:
        """What forces (n, m) accelerate, (n, m); nothing that is frozen or held."""
        columns = list(self.system.model.active)
        moves = jnp.asarray(self.moves)
        active = jnp.where(moves, force[:, columns], 0.0)
        if self.factor is not None:
            solution = cho_solve((self.factor, True), active.ravel()).reshape(active.shape)
        elif self.inverse is not None:
            solution = jnp.sum(self.inverse * active[:, None, :], axis=2)
        else:
            solution = solved(self._free_blocks(q), active)
        return self.system.embed(jnp.where(moves, solution, 0.0))

    def _free_blocks(self, q: Array) -> Array:
        """Masses of the free fields (n, a, a); ones where nothing moves."""
        columns = np.array(self.system.model.active)
        blocks = self.masses.blocks(q)[:, columns[:, None], columns]
        moves = self.moves.astype(float)
        still = (1.0 - moves)[:, :, None] * np.eye(columns.size)
        return blocks * (moves[:, :, None] * moves[:, None, :]) + still

    def dense_mass(self) -> Array:
        """Masses at rest of the free fields, (n a, n a); ones where nothing moves."""
        q, columns = self.system.unloaded().q, list(self.system.model.active)
        moves = jnp.asarray(self.moves)

        def carried(active: Array) -> Array:
            inertial = self.masses.momentum(q, self.system.embed(jnp.where(moves, active, 0.0)))
            return jnp.where(moves, inertial[:, columns], active)

        matrix = jax.jacfwd(carried)(jnp.zeros_like(q[:, columns]))
        return matrix.reshape(moves.size, moves.size)

    def joined(self, nodal: Array, chain: Array) -> Array:
        """Free fields (b, a) from those of the nodes (n, m) and of the chain (k,)."""
        active = nodal[:, list(self.system.model.active)]
        behind = jnp.zeros((chain.size, active.shape[1]), active.dtype)
        return jnp.append(active, behind.at[:, 0].set(chain), 0)


class _Chain(NamedTuple):
    force: Array
    accelerations: Array
    rates: Array
    loss: Array


def check(scene: Scene, inertia: Inertia) -> None:
    """Raise `InputError` for a scene that cannot be set in motion."""
    contact, model, strip = scene.contact, scene.model, scene.strip
    rigid = contact.normal == "rigid" and "w" in model.fields
    fix = (
        "with w in model.fields the reaction is an algebraic constraint, which no solver of "
        "ordinary differential equations takes: set contact.normal to 'compliant'"
    )
    require("contact.normal", contact.normal, not rigid, fix)
    require("load.control", scene.load.control, scene.load.control == "force", "must be 'force'")
    require("model.squeeze", model.squeeze, model.squeeze == "field", "must be 'field': it moves")
    fix = "is quasi-static: take 'stepwise'"
    require("model.solution", model.solution, model.solution == "stepwise", fix)
    fix = "moves as a straight strip only"
    require("strip.curvature", strip.curvature, strip.curvature is None, fix)
    rate_friction.exponent(contact.law)
    inertia.check(scene)

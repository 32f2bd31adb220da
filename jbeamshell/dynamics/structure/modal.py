r"""Frequency and damping of a structure with joints over amplitude, without a transient.

Quasi-static modal analysis (Festjens, Chevallier & Dion 2013; Allen, Lacayo & Brake 2016) applies
the static forces alpha M phi of a mode phi and finds the modal displacement q = phi^T M x.  With
the backbone alpha(q) of the mode, Masing's rule gives

    omega^2 = alpha/q,      zeta = D/(2 pi alpha q),      D = 8 int_0^q alpha dq - 4 alpha q.

It takes the secant of the loop for its stiffness, and the static shape for the motion.  The
motion itself follows the first harmonic of the loop, and the inertia of all masses bends it.  With
the joints' first harmonics k_1(u) in place of their forces, its shape is x of

    (K + B k_1(B^T x) B^T) x = omega^2 M x,   phi^T M x = q,   zeta = D/(2 pi omega^2 x^T M x),

nearly that of harmonic balance (`jbeamshell.dynamics.nonlinear_mode`).  A curve states as its error
what statics differ from that by, and five times the third harmonic of the joints over the first,
which is large where three times the frequency is that of another mode.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import ArrayLike

from jbeamshell.common.checks import is_staged, is_traced, require
from jbeamshell.common.errors import UnconvergedError, warn_of_doubts
from jbeamshell.common.failed import nan_unless
from jbeamshell.common.precision import in_double
from jbeamshell.common.progress import patience
from jbeamshell.dynamics.frequencies import OverAmplitude
from jbeamshell.dynamics.structure.elements import Elements, elements_of
from jbeamshell.dynamics.structure.matrices import Structure
from jbeamshell.dynamics.vibration.reduction import basis_of, projected

AMPLITUDES = "give rising positive modal displacements"
SHAPE = 1e-4  # change of displacements at which a shape is found
PHASES = 64  # of half a cycle
THIRD = 5.0  # error of the damping over the third harmonic
DOUBTED = 0.02  # error of frequency or damping
MAX_ITERATIONS = 100
SUBSTEPS = 8  # load steps between two amplitudes
ROUNDING = 4e3  # residual over the rounding of a displacement, at which an equilibrium is found
LINEAR = "give a joint: a structure without any is linear, see its modes"


class ModalCurve(OverAmplitude):
    """Frequency and damping of a mode over its amplitude by statics, (k,) each.

    Attributes
    ----------
    amplitude : modal displacement q
    frequency : cycles per time; see `omega`
    damping : damping ratio zeta of joints and structure
    dissipation : energy lost in the joints per cycle
    joints : (k, joints) largest displacements of the joints
    frequency_error, damping_error : estimated errors of statics, relative
    """

    title = "modal curve, by statics"
    label = "quasi-static"

    frequency_error: Any
    damping_error: Any

    @property
    def doubts(self) -> tuple[str, ...]:
        """Sentence that says from where on statics are off, and the fix; none if they hold."""
        errors = np.abs([np.asarray(self.frequency_error), np.asarray(self.damping_error)])
        off = np.max(errors, axis=0) > DOUBTED
        if not np.any(off):
            return ()
        worst = np.max(errors, axis=1)
        return (
            f"from the amplitude {np.asarray(self.amplitude)[np.argmax(off)]:.4g} on, the "
            f"damping may be off by up to {worst[1]:.0%} and the frequency by {worst[0]:.1%}, as "
            "statics know no inertia and no shape of the loop: take nonlinear_mode there",
        )


@patience("following the mode")
def modal_curve(structure: Structure, amplitudes: ArrayLike, mode: int = 0) -> ModalCurve:
    """Frequency and damping of a mode over its amplitude, by quasi-static modal analysis.

    The damping is that of the joints, D/(2 pi alpha q), and that of the structure's damping matrix
    and ratios, 2 zeta_0 omega_0/(2 omega), whose mode is taken as without slip.

    Every number of the structure may be traced by `jax.jit` and `jax.grad`: those of a joint's
    scene, the matrices, the damping ratios.  A traced curve without equilibrium is NaN.

    Parameters
    ----------
    structure : structure with its joints
    amplitudes : (k,) rising modal displacements q
    mode : number of the mode, counted from 0

    Raises
    ------
    InputError
        for amplitudes that are not positive and rising, or that move a joint beyond its `reach`;
        for a structure without joints
    UnconvergedError
        if no static equilibrium is found

    Warns
    -----
    DoubtfulWarning
        if frequency or damping may be off by more than 2 %, see ``curve.doubts``

    Examples
    --------
    >>> joint = Joint(displacements=[1.0, 3.0], forces=[1.0, 2.0])
    >>> structure = Structure([[1.0]], [[0.0]], [Attachment(joint, 0)])
    >>> modal_curve(structure, [0.5, 2.0]).frequency.round(3).tolist()
    [0.159, 0.138]
    """
    curve = by_statics(structure, amplitudes, mode)
    if not (is_traced(curve) or is_staged()):
        warn_of_doubts(curve.doubts)
    return curve


def by_statics(structure: Structure, amplitudes: ArrayLike, mode: int = 0) -> ModalCurve:
    """Curve as `modal_curve` has it, without a warning."""
    amplitude = _checked(amplitudes)
    require("attachments", 0, bool(structure.attachments), LINEAR)
    modes, directions = structure.modes(mode + 1), structure.directions
    shape = modes.shapes[:, mode]
    load = structure.mass @ shape
    stack = jnp.column_stack if structure.traced else np.column_stack
    displacements = structure.static_displacements(stack([load, directions]))
    # Let r be the forces that the joints lose by slip.  Then q = a alpha + b r, u = b alpha + S r.
    statics = _Statics(
        load @ displacements[:, 0],
        directions.T @ displacements[:, 0],
        directions.T @ displacements[:, 1:],
        structure.modal_damping(shape, modes.omega[mode], mode),
    )
    joints, modal = elements_of(structure.joints), _Modes.of(structure, load, mode)
    curve, sound = _curve(joints, statics, modal, jnp.asarray(amplitude))
    if is_traced(curve):
        return nan_unless(sound & structure.knows(curve.joints, ""), curve)
    if not np.all(sound):
        raise UnconvergedError(
            "no equilibrium of the joints at the modal displacement "
            f"{amplitude[int(np.argmin(sound))]:.6g}: give more amplitudes below it"
        )
    structure.knows(curve.joints, f"the modal displacement {amplitude[-1]:.6g}")
    return jax.tree.map(np.asarray, curve)


class _Statics(NamedTuple):
    """Structure as its joints and one mode feel it.

    Attributes
    ----------
    a : compliance of the mode, phi^T M K^-1 M phi
    b : (joints,) displacements of the joints under the mode's load
    compliance : (joints, joints) displacements of the joints under their forces
    damping : 2 zeta_0 omega_0 without slip
    """

    a: Array
    b: Array
    compliance: Array
    damping: Array


class _Modes(NamedTuple):
    """Structure of r coordinates of unit mass.

    Attributes
    ----------
    stiffness : (r, r) with all joints stuck
    directions : (r, joints) of the joints
    momentum : (r,) phi^T M
    """

    stiffness: Array
    directions: Array
    momentum: Array

    @classmethod
    def of(cls, structure: Structure, load: Any, mode: int) -> _Modes:
        """Coordinates of a structure, for the load M phi of a mode."""
        xp: Any = jnp if structure.traced else np
        basis = basis_of(structure, structure.directions, mode, xp)
        mass, stiffness = projected(structure, basis, xp)
        root = xp.linalg.inv(xp.linalg.cholesky(mass))
        turned = root @ basis.T
        stiffness = root @ stiffness @ root.T
        return cls(stiffness, turned @ structure.directions, turned @ load)


@in_double
@eqx.filter_jit
def _curve(
    joints: Elements, statics: _Statics, modes: _Modes, amplitude: Array
) -> tuple[ModalCurve, Array]:
    """Curve, and whether each of its points converged."""
    known, found = lax.stop_gradient((joints, statics))
    levels = _refined(amplitude)

    def reach(start: Array, q: Array) -> tuple[Array, tuple[Array, Array]]:
        u, sound = _equilibrium(known, found, q, start)
        return u, (u, sound)

    _, (path, sound) = lax.scan(reach, jnp.zeros_like(found.b), levels)

    def one(q: Array, u: Array) -> ModalCurve:
        # A step of Newton's method leaves the values and brings the derivatives.
        residual, _ = _residual(joints, statics, q, u)
        _, matrix = _residual(known, found, q, u)
        u = u - jnp.linalg.solve(matrix, residual)
        force = _modal_force(joints, statics, q, u)
        loss = jnp.sum(joints.loss(jnp.abs(u)))
        omega = jnp.sqrt(force / q)
        zeta = loss / (2.0 * jnp.pi * force * q) + 0.5 * statics.damping / omega
        moved, lost, third = lax.stop_gradient(_harmonic(known, modes, q, jnp.abs(u)))
        ratio = lost / (2.0 * jnp.pi) + 0.5 * statics.damping / moved
        damped = jnp.where(zeta > 0.0, zeta, 1.0)
        off = jnp.where(zeta > 0.0, 1.0 - ratio / damped, 0.0)
        off = off + jnp.where(off < 0.0, -1.0, 1.0) * THIRD * third
        return ModalCurve(
            amplitude=q,
            frequency=omega / (2.0 * jnp.pi),
            damping=zeta,
            dissipation=loss,
            joints=jnp.abs(u),
            frequency_error=1.0 - moved / omega,
            damping_error=off,
        )

    curve = jax.vmap(one)(amplitude, lax.stop_gradient(path[SUBSTEPS - 1 :: SUBSTEPS]))
    return curve, jnp.cumprod(sound)[SUBSTEPS - 1 :: SUBSTEPS] > 0


def _harmonic(joints: Elements, modes: _Modes, q: Array, u: Array) -> tuple[Array, Array, Array]:
    """Frequency of the first harmonics at a modal displacement, energy lost and third harmonic.

    The energy is over x^T K x, the third harmonic of the joints' displacements over the first.
    """
    stuck, directions, momentum = modes

    def slipping(u: Array) -> Array:
        softer = joints.harmonic(u) - joints.stiffness
        return stuck + (directions * softer) @ directions.T

    def shape(u: Array) -> tuple[Array, Array]:
        squares, forms = jnp.linalg.eigh(jnp.real(slipping(u)))
        place = jnp.argmax(jnp.abs(momentum @ forms))
        return squares[place], forms[:, place] * q / (momentum @ forms[:, place])

    def left(state: tuple[Array, Array, Array]) -> Array:
        return (state[1] > SHAPE * jnp.max(state[0])) & (state[2] < MAX_ITERATIONS)

    def improved(state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        u, _, count = state
        new = 0.5 * (u + jnp.abs(directions.T @ shape(u)[1]))
        return new, jnp.max(jnp.abs(new - u)), count + 1

    u, _, _ = lax.while_loop(left, improved, (u, jnp.full_like(q, jnp.inf), jnp.zeros((), int)))
    square, x = shape(u)
    lost = jnp.sum(joints.loss(u))
    # Third harmonic of the forces on the half cycle from a turn, and what it moves.
    angle = jnp.pi * jnp.arange(PHASES)[:, None] / PHASES
    branch = joints.line(u) - 2.0 * joints.line(0.5 * u * (1.0 - jnp.cos(angle)))
    forces = 2.0 * jnp.mean(branch * jnp.exp(-3j * angle), axis=0)
    matrix = slipping(u) - 9.0 * square * jnp.eye(x.size)
    moved = directions.T @ jnp.linalg.solve(matrix, directions @ forces)
    part = jnp.max(jnp.abs(moved) / jnp.where(u > 0.0, u, 1.0))
    return jnp.sqrt(square), lost / (square * (x @ x)), jnp.minimum(part, 1.0)


def _lost(joints: Elements, u: Array) -> Array:
    """Forces (joints,) that the joints lose by slip."""
    return joints.stiffness * u - joints.line(u)


def _modal_force(joints: Elements, statics: _Statics, q: Array, u: Array) -> Array:
    """Modal force alpha at a modal displacement."""
    return (q - statics.b @ _lost(joints, u)) / statics.a


def _residual(joints: Elements, statics: _Statics, q: Array, u: Array) -> tuple[Array, Array]:
    """Displacements of the joints less those of their forces, and the derivative."""
    a, b, compliance = statics[:3]
    residual = u - b * _modal_force(joints, statics, q, u) - compliance @ _lost(joints, u)
    softer = joints.stiffness - joints.tangent(u)
    return residual, jnp.eye(u.size) + jnp.outer(b, b * softer) / a - compliance * softer


def _equilibrium(
    joints: Elements, statics: _Statics, q: Array, guess: Array
) -> tuple[Array, Array]:
    """Displacements of the joints at a modal displacement by Newton's method, and if it ended."""
    most = ROUNDING * jnp.finfo(guess.dtype).eps * jnp.max(jnp.abs(statics.b * q / statics.a))

    def left(state: tuple[Array, Array, Array]) -> Array:
        _, size, count = state
        return (size > most) & (count < MAX_ITERATIONS)

    def improved(state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        u, _, count = state
        residual, matrix = _residual(joints, statics, q, u)
        size = jnp.max(jnp.abs(residual))
        step = jnp.linalg.solve(matrix, residual)
        return jnp.where(size > most, u - step, u), size, count + 1

    start = (guess, jnp.inf * jnp.ones_like(q), jnp.zeros((), int))
    u, size, _ = lax.while_loop(left, improved, start)
    return u, size <= most


def _refined(amplitude: Array) -> Array:
    """Amplitudes with equal load steps between them."""
    ends = jnp.append(0.0, amplitude)
    parts = jnp.arange(1, SUBSTEPS + 1) / SUBSTEPS
    return (ends[:-1, None] + jnp.diff(ends)[:, None] * parts).ravel()


def _checked(amplitudes: ArrayLike) -> Any:
    """Amplitudes as an array, of which traced ones are not checked; raises `InputError`."""
    if is_traced(amplitudes):
        return jnp.atleast_1d(jnp.asarray(amplitudes))
    amplitude = np.atleast_1d(np.asarray(amplitudes, float))
    rising = amplitude.ndim == 1 and bool(np.all(np.diff(amplitude, prepend=0.0) > 0.0))
    require("amplitudes", amplitude, rising and bool(np.all(np.isfinite(amplitude))), AMPLITUDES)
    return amplitude

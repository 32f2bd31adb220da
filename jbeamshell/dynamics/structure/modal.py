r"""Frequency and damping of a structure with joints over amplitude, without a transient.

Quasi-static modal analysis (Festjens, Chevallier & Dion 2013; Allen, Lacayo & Brake 2016) applies
the static forces alpha M phi of a mode phi and finds the modal displacement q = phi^T M x.  With
the backbone alpha(q) of the mode, Masing's rule gives

    omega^2 = alpha/q,      zeta = D/(2 pi alpha q),      D = 8 int_0^q alpha dq - 4 alpha q.

`jbeamshell.dynamics.nonlinear_mode` is an independent check, and has the damping of the structure.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import ArrayLike

from jbeamshell.common.checks import is_traced, require
from jbeamshell.common.errors import UnconvergedError
from jbeamshell.common.failed import nan_unless
from jbeamshell.common.precision import in_double
from jbeamshell.dynamics.structure.joint import Joint
from jbeamshell.dynamics.structure.matrices import Structure

SLIDING = "must be joints: take nonlinear_mode for cubic springs"
AMPLITUDES = "give rising positive modal displacements"
MAX_ITERATIONS = 100
SUBSTEPS = 8  # load steps between two amplitudes
ROUNDING = 4e3  # residual over the rounding of a displacement, at which an equilibrium is found
LINEAR = "give a joint: a structure without any is linear, see its modes"


class ModalCurve(NamedTuple):
    """Frequency and damping of a mode over its amplitude, (k,) each.

    Attributes
    ----------
    amplitude : modal displacement q
    frequency : angular frequency
    damping : damping ratio zeta of joints and structure
    dissipation : energy lost in the joints per cycle
    joints : (k, joints) amplitudes of the joints' displacements
    """

    amplitude: Any
    frequency: Any
    damping: Any
    dissipation: Any
    joints: Any

    def plot(self, axes: Any = None) -> Any:
        """Draw frequency and damping over amplitude; see `jbeamshell.plotting.modal_curve`."""
        from jbeamshell import plotting

        return plotting.modal_curve(self, axes=axes)


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

    Examples
    --------
    >>> joint = Joint(displacement=[1.0, 3.0], force=[1.0, 2.0])
    >>> structure = Structure([[1.0]], [[0.0]], [Attachment(joint, 0)])
    >>> modal_curve(structure, [0.5, 2.0]).frequency.round(3).tolist()
    [1.0, 0.866]
    """
    amplitude = _checked(amplitudes)
    require("attachments", 0, bool(structure.attachments), LINEAR)
    omega, shapes = structure.modes(mode + 1)
    shape, directions = shapes[:, mode], structure.directions
    load = structure.mass @ shape
    stack = jnp.column_stack if structure.traced else np.column_stack
    displacements = structure.static_displacements(stack([load, directions]))
    # Let r be the forces that the joints lose by slip.  Then q = a alpha + b r, u = b alpha + S r.
    statics = _Statics(
        load @ displacements[:, 0],
        directions.T @ displacements[:, 0],
        directions.T @ displacements[:, 1:],
        structure.modal_damping(shape, omega[mode], mode),
    )
    joints = [a.joint for a in structure.attachments if isinstance(a.joint, Joint)]
    sliding = len(joints) == len(structure.attachments)
    require("attachments", structure.attachments, sliding, SLIDING)
    backbones = tuple((joint.displacement, joint.force) for joint in joints)
    curve, sound = _curve(backbones, statics, jnp.asarray(amplitude))
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


@in_double
@eqx.filter_jit
def _curve(
    backbones: tuple[tuple[Array, Array], ...], statics: _Statics, amplitude: Array
) -> tuple[ModalCurve, Array]:
    """Curve, and whether each of its points converged."""
    joints = _alike(backbones)
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
        loss = jnp.sum(jax.vmap(Joint.loss)(joints, jnp.abs(u)))
        omega = jnp.sqrt(force / q)
        zeta = loss / (2.0 * jnp.pi * force * q) + 0.5 * statics.damping / omega
        return ModalCurve(q, omega, zeta, loss, jnp.abs(u))

    curve = jax.vmap(one)(amplitude, lax.stop_gradient(path[SUBSTEPS - 1 :: SUBSTEPS]))
    return curve, jnp.cumprod(sound)[SUBSTEPS - 1 :: SUBSTEPS] > 0


def _alike(backbones: tuple[tuple[Array, Array], ...]) -> Joint:
    """Joints of equally many points, stacked; further ones lie on the last straight line."""
    size = max(u.size for u, _ in backbones)
    stacked = []
    for u, f in backbones:
        steps = jnp.arange(1, size + 1 - u.size)
        slope = Joint(u, f).springs[-1]
        further = u[-1] * (1.0 + steps)
        longer = jnp.append(f, f[-1] + slope * (further - u[-1]))
        stacked.append(Joint(jnp.append(u, further), longer))
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *stacked)


def _lost(joints: Joint, u: Array) -> Array:
    """Forces (joints,) that the joints lose by slip."""
    return jax.vmap(lambda joint, x: joint.stiffness * x - joint.line(x))(joints, u)


def _modal_force(joints: Joint, statics: _Statics, q: Array, u: Array) -> Array:
    """Modal force alpha at a modal displacement."""
    return (q - statics.b @ _lost(joints, u)) / statics.a


def _residual(joints: Joint, statics: _Statics, q: Array, u: Array) -> tuple[Array, Array]:
    """Displacements of the joints less those of their forces, and the derivative."""
    a, b, compliance, _ = statics
    residual = u - b * _modal_force(joints, statics, q, u) - compliance @ _lost(joints, u)
    softer = jax.vmap(lambda joint, x: joint.stiffness - joint.tangent(x))(joints, u)
    return residual, jnp.eye(u.size) + jnp.outer(b, b * softer) / a - compliance * softer


def _equilibrium(joints: Joint, statics: _Statics, q: Array, guess: Array) -> tuple[Array, Array]:
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

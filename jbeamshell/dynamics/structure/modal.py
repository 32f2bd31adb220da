r"""Frequency and damping of a structure with joints over amplitude, without a transient.

Quasi-static modal analysis (Festjens, Chevallier & Dion 2013; Allen, Lacayo & Brake 2016): forces
alpha M phi of a mode's own distribution are applied statically, and the modal displacement
q = phi^T M x is read off.  The backbone alpha(q) is that of the mode; by Masing's rule

    omega^2 = alpha/q,      zeta = D/(2 pi alpha q),      D = 8 int_0^q alpha dq - 4 alpha q.

`harmonic_balance` is an independent check: every joint acts by the first harmonic of its loop
(its describing function), and the complex eigenproblem is solved for the amplitude.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from jbeamshell.common.checks import require
from jbeamshell.common.errors import UnconvergedError
from jbeamshell.dynamics.structure.matrices import Structure, dense

LOADS = "give rising positive modal displacements"
MOST = 100  # Newton iterations
SUBSTEPS = 8  # between two amplitudes


class ModalCurve(NamedTuple):
    """A mode over its amplitude, (k,) each.

    Attributes
    ----------
    amplitude : modal displacement q
    frequency : angular
    damping : ratio zeta, of the joints alone
    dissipation : energy per cycle
    joints : (k, joints) amplitudes of the joints' displacements
    """

    amplitude: NDArray[np.float64]
    frequency: NDArray[np.float64]
    damping: NDArray[np.float64]
    dissipation: NDArray[np.float64]
    joints: NDArray[np.float64]

    def plot(self, axes: Any = None) -> Any:
        """Draw frequency and damping over amplitude; see `jbeamshell.plotting.modal_curve`."""
        from jbeamshell import plotting

        return plotting.modal_curve(self, axes=axes)


def modal_curve(structure: Structure, amplitudes: ArrayLike, mode: int = 0) -> ModalCurve:
    """Quasi-static modal analysis.

    Parameters
    ----------
    structure : with its joints
    amplitudes : (k,) rising modal displacements q
    mode : which, counted from 0

    Raises
    ------
    InputError
        for amplitudes that do not rise from above zero
    UnconvergedError
        if no static equilibrium is found
    """
    amplitude = _checked(amplitudes)
    _, shapes = structure.modes(mode + 1)
    shape, along = shapes[:, mode], structure.directions
    load = structure.mass @ shape
    answers = structure.compliance(np.column_stack([load, along]))
    # With what the joints hold less than when they stick, r: q = a alpha + b r, u = b alpha + S r.
    a, b, flexible = load @ answers[:, 0], along.T @ answers[:, 0], along.T @ answers[:, 1:]
    levels = np.unique(np.concatenate([_refined(amplitude), amplitude]))
    u = np.zeros(b.size)
    alphas, slips = [0.0], [u]
    for q in levels:
        u, alpha = _equilibrium(structure, q, a, b, flexible, u)
        alphas.append(alpha)
        slips.append(u)
    forces = np.array(alphas)
    lost: Any = sum(
        np.asarray(attached.joint.dissipation(np.abs(np.array(slips)[:, place])))
        for place, attached in enumerate(structure.attachments)
    )
    pick = 1 + np.searchsorted(levels, amplitude)
    force, loss = forces[pick], np.broadcast_to(lost, forces.shape)[pick]
    return ModalCurve(
        amplitude=amplitude,
        frequency=np.sqrt(force / amplitude),
        damping=loss / (2.0 * np.pi * force * amplitude),
        dissipation=loss,
        joints=np.abs(np.array(slips)[pick]),
    )


def harmonic_balance(structure: Structure, amplitudes: ArrayLike, mode: int = 0) -> ModalCurve:
    """One harmonic: the complex mode at an amplitude, every joint by its describing function.

    See `modal_curve` for the parameters; the damping is the joints' and the structure's own.
    """
    amplitude = _checked(amplitudes)
    omega, shapes = structure.modes(mode + 1)
    matrices = (structure.mass, structure.stiffness, structure.damping)
    mass, stiffness, damping = map(dense, matrices)
    along, shape = structure.directions, shapes[:, mode].astype(complex)
    value, rows = 1j * omega[mode], []
    for q in amplitude:
        for _ in range(MOST):
            u = np.maximum(np.abs(along.T @ shape) * q, 1e-30)
            held = [
                complex(attached.joint.first_harmonic(jnp.asarray(size)))
                for attached, size in zip(structure.attachments, u, strict=True)
            ]
            whole = stiffness + (along * np.array(held)) @ along.T
            new, shape = _nearest(mass, damping, whole, value, shapes[:, mode])
            settled, value = abs(new - value) <= 1e-9 * abs(new), new
            if settled:
                break
        else:
            raise UnconvergedError(f"harmonic balance at q = {q:.6g} settles at no mode")
        loss = sum(np.pi * h.imag * size**2 for h, size in zip(held, u, strict=True))
        rows.append((q, abs(value), -value.real / abs(value), loss, u))
    q, frequency, zeta, loss, joints = zip(*rows, strict=True)
    return ModalCurve(*map(np.array, (q, frequency, zeta, loss, joints)))


def _nearest(
    mass: NDArray[Any], damping: NDArray[Any], stiffness: NDArray[Any], value: complex, like: Any
) -> tuple[complex, NDArray[np.complex128]]:
    """The mode of lambda^2 M + lambda C + K next to an eigenvalue, of unit q."""
    size = mass.shape[0]
    zero, one = np.zeros((size, size)), np.eye(size)
    left = np.block([[zero, one], [-stiffness, -damping]])
    right = np.block([[one, zero], [zero, mass]])
    values, vectors = scipy.linalg.eig(left, right)
    best = int(np.argmin(np.abs(values - value)))
    shape = vectors[:size, best]
    return complex(values[best]), shape / (like @ mass @ shape)


def _equilibrium(
    structure: Structure,
    q: Any,
    a: Any,
    b: NDArray[np.float64],
    flexible: NDArray[np.float64],
    guess: NDArray[np.float64],
) -> tuple[NDArray[np.float64], float]:
    """Joints' displacements and the modal force at a modal displacement, by Newton's method."""
    joints, u = [attached.joint for attached in structure.attachments], guess.copy()
    sticking = np.array([float(joint.stiffness) for joint in joints])
    for _ in range(MOST):
        held = np.array([float(j.backbone(x)) for j, x in zip(joints, u, strict=True)])
        slope = np.array([float(j.tangent(x)) for j, x in zip(joints, u, strict=True)])
        less = sticking * u - held
        alpha = (q - b @ less) / a
        residual = u - b * alpha - flexible @ less
        if np.max(np.abs(residual), initial=0.0) <= 1e-12 * np.max(np.abs(b * q / a), initial=0.0):
            return u, float(alpha)
        change = sticking - slope
        tangent = np.eye(u.size) + np.outer(b, b * change) / a - flexible * change
        u = u - np.linalg.solve(tangent, residual)
    raise UnconvergedError(f"the joints find no equilibrium at the modal displacement {q:.6g}")


def _refined(amplitude: NDArray[np.float64]) -> NDArray[np.float64]:
    ends = np.append(0.0, amplitude)
    parts = np.arange(1, SUBSTEPS + 1) / SUBSTEPS
    return (ends[:-1, None] + np.diff(ends)[:, None] * parts).ravel()


def _checked(amplitudes: ArrayLike) -> NDArray[np.float64]:
    amplitude = np.atleast_1d(np.asarray(amplitudes, float))
    rising = amplitude.ndim == 1 and bool(np.all(np.diff(amplitude, prepend=0.0) > 0.0))
    require("amplitudes", amplitude, rising and bool(np.all(np.isfinite(amplitude))), LOADS)
    return amplitude

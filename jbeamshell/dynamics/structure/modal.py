r"""Frequency and damping of a structure with joints over amplitude, without a transient.

Quasi-static modal analysis (Festjens, Chevallier & Dion 2013; Allen, Lacayo & Brake 2016) applies
the static forces alpha M phi of a mode phi and finds the modal displacement q = phi^T M x.  With
the backbone alpha(q) of the mode, Masing's rule gives

    omega^2 = alpha/q,      zeta = D/(2 pi alpha q),      D = 8 int_0^q alpha dq - 4 alpha q.

`jbeamshell.dynamics.nonlinear_mode` is an independent check, and has the damping of the structure.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jbeamshell.common.checks import require
from jbeamshell.common.errors import UnconvergedError
from jbeamshell.dynamics.structure.matrices import Structure

AMPLITUDES = "give rising positive modal displacements"
MAX_ITERATIONS = 100
SUBSTEPS = 8  # load steps between two amplitudes


class ModalCurve(NamedTuple):
    """Frequency and damping of a mode over its amplitude, (k,) each.

    Attributes
    ----------
    amplitude : modal displacement q
    frequency : angular frequency
    damping : damping ratio zeta
    dissipation : energy lost in the joints per cycle
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
    """Frequency and damping of a mode over its amplitude, by quasi-static modal analysis.

    The damping is that of the joints alone.

    Parameters
    ----------
    structure : structure with its joints
    amplitudes : (k,) rising modal displacements q
    mode : number of the mode, counted from 0

    Raises
    ------
    InputError
        for amplitudes that are not positive and rising
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
    _, shapes = structure.modes(mode + 1)
    shape, directions = shapes[:, mode], structure.directions
    load = structure.mass @ shape
    displacements = structure.static_displacements(np.column_stack([load, directions]))
    # Let r be the forces that the joints lose by slip.  Then q = a alpha + b r, u = b alpha + S r.
    a, b = load @ displacements[:, 0], directions.T @ displacements[:, 0]
    compliance = directions.T @ displacements[:, 1:]
    levels = np.unique(np.concatenate([_refined(amplitude), amplitude]))
    u = np.zeros(b.size)
    alphas, joints = [0.0], [u]
    for q in levels:
        u, alpha = _equilibrium(structure, q, a, b, compliance, u)
        alphas.append(alpha)
        joints.append(u)
    forces = np.array(alphas)
    losses: Any = sum(
        np.asarray(attached.joint.dissipation(np.abs(np.array(joints)[:, place])))
        for place, attached in enumerate(structure.attachments)
    )
    pick = 1 + np.searchsorted(levels, amplitude)
    force, loss = forces[pick], np.broadcast_to(losses, forces.shape)[pick]
    return ModalCurve(
        amplitude=amplitude,
        frequency=np.sqrt(force / amplitude),
        damping=loss / (2.0 * np.pi * force * amplitude),
        dissipation=loss,
        joints=np.abs(np.array(joints)[pick]),
    )


def _equilibrium(
    structure: Structure,
    q: Any,
    a: Any,
    b: NDArray[np.float64],
    compliance: NDArray[np.float64],
    guess: NDArray[np.float64],
) -> tuple[NDArray[np.float64], float]:
    """Displacements of the joints and modal force alpha at a modal displacement, by Newton."""
    joints, u = [attached.joint for attached in structure.attachments], guess.copy()
    stuck = np.array([float(joint.stiffness) for joint in joints])
    for _ in range(MAX_ITERATIONS):
        force = np.array([float(j.backbone(x)) for j, x in zip(joints, u, strict=True)])
        slope = np.array([float(j.tangent(x)) for j, x in zip(joints, u, strict=True)])
        lost = stuck * u - force
        alpha = (q - b @ lost) / a
        residual = u - b * alpha - compliance @ lost
        if np.max(np.abs(residual), initial=0.0) <= 1e-12 * np.max(np.abs(b * q / a), initial=0.0):
            return u, float(alpha)
        change = stuck - slope
        tangent = np.eye(u.size) + np.outer(b, b * change) / a - compliance * change
        u = u - np.linalg.solve(tangent, residual)
    raise UnconvergedError(
        f"no equilibrium of the joints at the modal displacement {q:.6g}: give more amplitudes "
        "below it"
    )


def _refined(amplitude: NDArray[np.float64]) -> NDArray[np.float64]:
    """Amplitudes with equal load steps between them."""
    ends = np.append(0.0, amplitude)
    parts = np.arange(1, SUBSTEPS + 1) / SUBSTEPS
    return (ends[:-1, None] + np.diff(ends)[:, None] * parts).ravel()


def _checked(amplitudes: ArrayLike) -> NDArray[np.float64]:
    """Amplitudes as an array; raises `InputError`."""
    amplitude = np.atleast_1d(np.asarray(amplitudes, float))
    rising = amplitude.ndim == 1 and bool(np.all(np.diff(amplitude, prepend=0.0) > 0.0))
    require("amplitudes", amplitude, rising and bool(np.all(np.isfinite(amplitude))), AMPLITUDES)
    return amplitude

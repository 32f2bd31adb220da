"""Mode of two bodies whose face sticks, and the forces that bend them into it.

Loaded by M phi, a structure moves into its mode phi; with friction it does so along a loop.  The
frequency of the mode is the root of the loop's secant stiffness, the damping half of its loss
factor (quasi-static modal analysis: Festjens, Chevallier and Dion 2013; Allen, Lacayo and Brake
2016).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.linalg import eigsh

from jbeamshell.common.checks import require, require_count
from jbeamshell.common.errors import UnconvergedError, warn_of_doubts
from jbeamshell.common.summary import Summary, ranged
from jbeamshell.contact_face.body import FaceBody
from jbeamshell.contact_face.solve import solve_faces
from jbeamshell.contact_line.stiffness_model import StiffnessModel

RIGID = 1e-7  # eigenvalue over the largest one found, below which a mode is a rigid motion
SHIFT = 1e-9  # of the stiffest node over the lightest one, below zero, where modes are sought


class FacePart(NamedTuple):
    """Finite-element model of a body, and what its face and its bolts are.

    Attributes
    ----------
    model : stiffness and mass
    nodes : (n, 4) node, X, Y and Z of the face's nodes
    press : for each bolt, (k, 3) node, direction and force
    """

    model: StiffnessModel
    nodes: ArrayLike
    press: Sequence[ArrayLike] = ()


class ModalBodies(NamedTuple):
    """Bodies that are pulled into a mode.

    The displacement conjugate to their load is the modal displacement q, for modes of unit modal
    mass.

    Attributes
    ----------
    upper, lower : bodies for `jbeamshell.solve_faces`; lower is None on a rigid base
    omega : angular frequency of the mode while the face sticks
    touching : (n,) True for the pairs that the bolts press together
    """

    upper: FaceBody
    lower: FaceBody | None
    omega: float
    touching: NDArray[np.bool_]


def modal_bodies(
    upper: FacePart,
    lower: FacePart | None = None,
    *,
    mode: int = 0,
    friction: float = 0.1,
    bolts: ArrayLike = 1.0,
    normals: ArrayLike = (0.0, 0.0, 1.0),
    areas: ArrayLike | None = None,
) -> ModalBodies:
    """Bodies on their face, loaded by the inertia of a mode.

    The mode is that of the pressed bodies, whose pairs stick where they touch.

    Parameters
    ----------
    upper, lower : bodies with masses; None is a rigid base
    mode : number of the mode, counted from 0; rigid motions do not count
    friction, bolts : as in `jbeamshell.solve_faces`, for the pressing
    normals, areas : of the face, see `FaceBody.of`

    Raises
    ------
    InputError
        for a model without mass, or a mode that does not exist
    """
    require_count("mode", mode, 0)
    parts = [part for part in (upper, lower) if part is not None]
    for key, part in zip(("upper", "lower"), parts, strict=False):
        fix = "has no mass: read the model with mass="
        require(f"{key}.model", part.model.matrix.shape, part.model.mass is not None, fix)
    pressed = [_body(part, part.press[0] if part.press else None, normals, areas) for part in parts]
    sizes = np.broadcast_to(np.asarray(bolts, float), max(body.bolts for body in pressed))
    history = solve_faces(
        *pressed, friction=friction, bolts=sizes, path=np.append(0.0, sizes)[None]
    )
    touching = np.asarray(history.touching[0])
    omega, forces = _stuck_mode(parts, touching, mode)
    bodies = [_body(part, pull, normals, areas) for part, pull in zip(parts, forces, strict=True)]
    return ModalBodies(bodies[0], bodies[1] if lower is not None else None, omega, touching)


@dataclasses.dataclass(frozen=True, eq=False)
class FaceCurve:
    """Frequency and damping of a mode over its amplitude, (k,) each.

    Attributes
    ----------
    amplitude : modal displacement q
    frequency : cycles per time
    damping : damping ratio zeta of the friction on the face
    dissipation : energy lost per cycle
    doubts : reasons to doubt a point, the amplitude first
    """

    amplitude: NDArray[np.float64]
    frequency: NDArray[np.float64]
    damping: NDArray[np.float64]
    dissipation: NDArray[np.float64]
    doubts: tuple[str, ...]

    def __str__(self) -> str:
        columns = {
            "modal displacement": self.amplitude,
            "frequency": self.frequency,
            "damping ratio": self.damping,
            "lost per cycle": self.dissipation,
        }
        rows = [(name, ranged(np.asarray(column))) for name, column in columns.items()]
        notes = [f"doubtful: {doubt}" for doubt in self.doubts]
        return Summary(f"mode of a face, {len(self.amplitude)} points", rows, notes).as_text()

    def plot(self, axes: Any = None) -> Any:
        """Draw frequency and damping over the amplitude; returns the axes."""
        from jbeamshell import plotting

        return plotting.modal_curve(self, axes=axes)


def face_curve(
    bodies: ModalBodies, amplitudes: ArrayLike, *, throw: bool = True, **options: Any
) -> FaceCurve:
    """Frequency and damping of a mode over its amplitude, from the loops of its contact.

    Parameters
    ----------
    bodies : of `modal_bodies`
    amplitudes : (k,) modal displacements, positive
    throw : as in `jbeamshell.solve_faces`
    options : friction, bolts, gap and the like, as `jbeamshell.solve_faces` takes them

    Raises
    ------
    InputError
        for amplitudes that are not positive, or options that make no sense
    UnconvergedError
        if a loop has no equilibrium
    """
    sizes = np.atleast_1d(np.asarray(amplitudes, float))
    fix = "give positive modal displacements"
    require("amplitudes", sizes, bool(np.all(sizes > 0.0) and sizes.ndim == 1), fix)
    options |= {"control": "displacement", "throw": False}
    loops = []
    for size in sizes:
        loop = solve_faces(bodies.upper, bodies.lower, amplitude=size, **options)
        if throw and not loop.converged:
            raise UnconvergedError(
                f"amplitude {size:.6g}: a step has no equilibrium; take more steps"
            )
        loops.append(loop)
    curve = FaceCurve(
        amplitude=sizes,
        frequency=np.sqrt([float(loop.secant_stiffness) for loop in loops]) / (2.0 * np.pi),
        damping=np.array([0.5 * float(loop.loss_factor) for loop in loops]),
        dissipation=np.array([float(loop.dissipation) for loop in loops]),
        doubts=tuple(
            f"at {size:.4g}: {doubt}"
            for size, loop in zip(sizes, loops, strict=True)
            for doubt in loop.doubts
        ),
    )
    if throw:
        warn_of_doubts(curve.doubts, stacklevel=2)
    return curve


def _body(
    part: FacePart, pull: ArrayLike | None, normals: ArrayLike, areas: ArrayLike | None
) -> FaceBody:
    return FaceBody.of(
        part.model, part.nodes, pull=pull, press=part.press, normals=normals, areas=areas
    )


def _stuck_mode(
    parts: list[FacePart], touching: NDArray[np.bool_], mode: int
) -> tuple[float, list[NDArray[np.float64]]]:
    """Angular frequency, and for each body the rows (node, direction, force) of M phi."""
    ties = _ties(parts, touching)
    stiffness = scipy.sparse.block_diag([part.model.matrix for part in parts], format="csc")
    mass = scipy.sparse.block_diag([part.model.mass for part in parts], format="csc")
    k, m = (scipy.sparse.csc_array(ties.T @ each @ ties) for each in (stiffness, mass))
    count = mode + 7
    fix = f"must be less than {k.shape[0] - 7}, the free displacements"
    require("mode", mode, count < k.shape[0], fix)
    shift = -SHIFT * np.max(k.diagonal()) / np.min(m.diagonal())
    start = np.ones(k.shape[0])  # the same digits in every run
    values, vectors = eigsh(k, count, m, sigma=shift, v0=start)
    order = np.argsort(values)
    elastic = order[values[order] > RIGID * np.max(values)]
    at = elastic[mode]
    shape = ties @ vectors[:, at]
    shape *= np.sign(shape[np.argmax(np.abs(shape))])
    inertia, begin, tables = mass @ shape, 0, []
    for part in parts:
        rows = inertia[begin : begin + len(part.model.dofs)]
        tables.append(np.column_stack([part.model.dofs, rows]))
        begin += len(part.model.dofs)
    return float(np.sqrt(values[at])), tables


def _ties(parts: list[FacePart], touching: NDArray[np.bool_]) -> scipy.sparse.csc_array:
    """Matrix from the free displacements to those of all bodies, pairs that touch moving as one."""
    dofs = [part.model.dofs.tolist() for part in parts]
    names = [(side, node, way) for side, rows in enumerate(dofs) for node, way in rows]
    row = {name: i for i, name in enumerate(names)}
    column = np.arange(len(names))
    faces = [np.asarray(part.nodes, float)[:, 0].astype(int) for part in parts]
    for pair in np.flatnonzero(touching):
        for way in (1, 2, 3):
            ends = [row.get((side, int(face[pair]), way)) for side, face in enumerate(faces)]
            free = [end for end in ends if end is not None]
            held = len(parts) == 1 or len(free) < len(parts)
            for end in free:
                column[end] = -1 if held else min(free)
    kept, place = np.unique(column[column >= 0], return_inverse=True)
    rows = np.flatnonzero(column >= 0)
    shape = (len(names), kept.size)
    return scipy.sparse.csc_array((np.ones(rows.size), (rows, place)), shape=shape)

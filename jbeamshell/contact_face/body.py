"""Body on a face: an elastic body of any origin, condensed to the nodes of its contact face.

With q the displacements of the n contact nodes in their frames (two tangents and the normal, node
by node), P the loads and r the nodal forces of what the body touches,

    r = K q - f P,      d = f' q + c P,

with d the displacements conjugate to the loads.  Load 0 pulls to and fro, the others press.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import scipy.sparse
from jax import Array
from numpy.typing import ArrayLike, NDArray

from jbeamshell.common.checks import (
    as_leaf,
    is_traced,
    require,
    require_choice,
    require_finite,
)
from jbeamshell.contact_face.surface import face_surface, node_table
from jbeamshell.contact_line.stiffness_model import StiffnessModel, condensed_on, nodal_forces
from jbeamshell.contact_line.substructure import check_energy, read_body, write_body

RIGID = 1e-6  # energy of a rigid motion over that of the nodes alone, from which on it is held
LOOSE = 1e-9  # of the largest eigenvalue, below which a motion costs no energy
BENT = 1e-3  # part of a motion without energy that may be no rigid one
LEVEL = 1e-9  # of a normal, within which it lies along an axis
NAMES = ("places", "normals", "areas", "stiffness", "forces", "flexibility", "fixed")


class FaceBody(eqx.Module):
    """Elastic body on its contact face.

    `FaceBody.of` makes one from a matrix of finite elements.  All arrays are numbers of a pytree,
    so that results can be differentiated for them.

    Attributes
    ----------
    places : (n, 3) X, Y, Z of the contact nodes
    normals : (n, 3) unit normals of the face, from the body below to the one above
    stiffness : (3n, 3n) K, in the frames of `frames`
    forces : (3n, m) f, of the pull and of m - 1 pressures
    flexibility : (m, m) c; zero if left out
    areas : (n,) contact areas; 1 if left out, so that pressures are forces, and softness is
        displacement per force
    fixed : (3n,) True for displacements that a support holds; none if left out

    Raises
    ------
    InputError
        for shapes that do not go together, numbers that are not finite, a matrix that is not
        symmetric, a negative mode, or a motion without energy that is not rigid
    """

    places: Array
    normals: Array
    areas: Array
    stiffness: Array
    forces: Array
    flexibility: Array
    fixed: tuple[bool, ...] = eqx.field(static=True)

    def __init__(
        self,
        places: Any,
        stiffness: Any,
        forces: Any,
        flexibility: Any = None,
        *,
        normals: Any = (0.0, 0.0, 1.0),
        areas: Any = None,
        fixed: Sequence[bool] = (),
    ) -> None:
        self.places, self.stiffness = as_leaf(places, "places"), as_leaf(stiffness, "stiffness")
        self.forces = as_leaf(forces, "forces")
        n, loads = self.places.shape[0], self.forces.shape[-1:]
        normal = as_leaf(normals, "normals")
        fix = f"give one normal, or one for each of {n} nodes"
        require("normals", normal.shape, normal.shape in ((3,), (n, 3)), fix)
        self.normals = jnp.broadcast_to(normal, (n, 3))
        none = jnp.zeros((*loads, *loads))
        self.flexibility = none if flexibility is None else as_leaf(flexibility, "flexibility")
        self.areas = jnp.ones(n) if areas is None else as_leaf(areas, "areas")
        for i, truth in enumerate(fixed):
            require_choice(f"fixed[{i}]", truth, (False, True))
        self.fixed = tuple(map(bool, fixed)) or (False,) * (3 * n)

    def __check_init__(self) -> None:
        n, m = self.places.shape[0], self.forces.shape[-1] if self.forces.ndim == 2 else 0
        shapes = {
            "places": (self.places, (n, 3)),
            "normals": (self.normals, (n, 3)),
            "areas": (self.areas, (n,)),
            "stiffness": (self.stiffness, (3 * n, 3 * n)),
            "forces": (self.forces, (3 * n, m)),
            "flexibility": (self.flexibility, (m, m)),
        }
        for key, (value, shape) in shapes.items():
            require(f"{key}.shape", value.shape, value.shape == shape and m > 0, f"must be {shape}")
        require("fixed", len(self.fixed), len(self.fixed) == 3 * n, f"must be {3 * n} truths")
        fix = "need double precision: write jax.config.update('jax_enable_x64', True)"
        require("stiffness", "numbers of 32 bits", self.stiffness.dtype == jnp.float64, fix)
        if is_traced(*(value for value, _ in shapes.values())):
            return
        for key, (value, _) in shapes.items():
            require_finite(key, value)
        areas, lengths = np.asarray(self.areas), np.linalg.norm(self.normals, axis=1)
        fix = "must be positive: give the contact area of each node"
        require("areas", areas, bool(np.all(areas > 0.0)), fix)
        unit = bool(np.all(np.abs(lengths - 1.0) < 1e-6))
        require("normals", lengths, unit, "must have the length 1")
        free = ~np.array(self.fixed)
        fix = "has a negative mode: check the supports and the sign of the matrix"
        check_energy("stiffness", np.asarray(self.stiffness), free, 1e-9, fix)
        loads = np.full(self.flexibility.shape[:1], True)
        fix = "has a negative mode: give displacements per load, positive along each load"
        check_energy("flexibility", np.asarray(self.flexibility), loads, 1e-8, fix)
        self._check_loose(free)

    def _check_loose(self, free: NDArray[np.bool_]) -> None:
        """Refuse a body that moves without energy and not as a rigid body does."""
        values, vectors = np.linalg.eigh(np.asarray(self.stiffness)[np.ix_(free, free)])
        loose = vectors[:, values < LOOSE * values[-1]]
        rigid = np.linalg.qr(self.rigid_motions()[:, free].T)[0]
        bent = loose - rigid @ (rigid.T @ loose)
        most = float(np.max(np.linalg.norm(bent, axis=0), initial=0.0))
        fix = "its rows do not go with these places and normals, or the bolts hold a loose part"
        require("stiffness", f"a motion without energy, {most:.2g} not rigid", most < BENT, fix)

    @classmethod
    def of(
        cls,
        model: StiffnessModel,
        nodes: ArrayLike,
        *,
        pull: ArrayLike | None = None,
        press: Sequence[ArrayLike] = (),
        held: ArrayLike | None = None,
        normals: ArrayLike = (0.0, 0.0, 1.0),
        areas: ArrayLike | None = None,
        elements: Iterable[ArrayLike] | None = None,
    ) -> FaceBody:
        """Body on its face from the matrix of a finite-element program.

        Parameters
        ----------
        model : matrix, with the node and direction (1, 2, 3) of each row
        nodes : (n, 4) node, X, Y and Z of the face's nodes
        pull : (k, 3) node, direction and force of a unit of the load that is cycled; None for a
            body that is not pulled
        press : for each bolt or pressure, (k, 3) node, direction and force
        held : (k, 2) node and direction of supports that the matrix still has
        normals : (3,) or (n, 3), from the body below to the one above; with elements, roughly
        areas : (n,) contact areas; 1 if left out
        elements : (k, 3 or 4) nodes of each element of the face, which give areas and normals by
            their shape functions, see `jbeamshell.face_surface`

        Raises
        ------
        InputError
            for a node or a direction that the model does not have, a support at the face that does
            not lie along a frame, or elements that are no mesh of the nodes
        """
        model = model if held is None else model.without(held)
        numbers, places = node_table(nodes)
        if elements is not None:
            require("areas", areas, areas is None, "are those of the elements: leave one out")
            areas, normals = face_surface(nodes, elements, normals)
        row = {(int(a), int(b)): i for i, (a, b) in enumerate(model.dofs)}
        n = len(numbers)
        normal = np.broadcast_to(np.asarray(normals, float), (n, 3))
        frames = frames_of(normal)
        place, fixed = np.full(len(row), -1), np.zeros((n, 3), bool)
        for g, node in enumerate(numbers):
            rows = [row.get((node, way)) for way in (1, 2, 3)]
            fix = "has no row in the matrix: give nodes of the model's contact face"
            require("nodes", f"node {node}", any(at is not None for at in rows), fix)
            for way, at in enumerate(rows):
                if at is not None:
                    place[at] = 3 * g + way
                    continue
                along = np.abs(frames[g][:, way]) > 1.0 - LEVEL
                fix = f"is held along direction {way + 1}, which is no axis of its frame: free it"
                require("nodes", f"node {node}", bool(along.any()), fix)
                fixed[g, int(np.argmax(along))] = True
        forces = np.column_stack(
            [nodal_forces("pull", [] if pull is None else pull, row)]
            + [nodal_forces(f"press[{i}]", rows, row) for i, rows in enumerate(press)]
        )
        stiffness, loads, flexibility = condensed_on(model.matrix, forces, place, 3 * n)
        turn = scipy.sparse.block_diag(list(frames)).tocsr()
        return cls(
            places,
            turn @ (turn @ stiffness).T,
            turn @ loads,
            flexibility,
            normals=normal,
            areas=areas,
            fixed=fixed.ravel().tolist(),
        )

    @property
    def frames(self) -> NDArray[np.float64]:
        """Frames (n, 3, 3) of the nodes: two tangents and the normal, by rows."""
        return frames_of(np.asarray(self.normals))

    @property
    def bolts(self) -> int:
        """Number of loads that press."""
        return int(self.forces.shape[1]) - 1

    def rigid_motions(self) -> NDArray[np.float64]:
        """Rigid motions (6, 3n) in the frames: along X, Y, Z, and turns about the middle."""
        places = np.asarray(self.places)
        middle, n = places - np.mean(places, axis=0), len(places)
        ways = np.broadcast_to(np.eye(3)[:, None], (3, n, 3))
        turns = np.cross(ways, middle[None])
        both = np.concatenate([ways, turns])
        return np.einsum("nij,knj->kni", self.frames, both).reshape(6, 3 * n)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write to an .npz file; see `read`."""
        write_body(path, {name: np.asarray(getattr(self, name)) for name in NAMES})

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> FaceBody:
        """Body in an .npz file of its arrays by name.

        Raises
        ------
        InputError
            if the file cannot be read, or holds no body on a face
        """
        arrays = read_body(path, ("places", "stiffness", "forces"))
        return cls(
            arrays["places"],
            arrays["stiffness"],
            arrays["forces"],
            arrays.get("flexibility"),
            normals=arrays.get("normals", (0.0, 0.0, 1.0)),
            areas=arrays.get("areas"),
            fixed=np.ravel(arrays.get("fixed", ())).tolist(),
        )


def frames_of(normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Frames (n, 3, 3) of normals (n, 3): the tangent nearest to X (to Y, if X is normal) first."""
    along = np.where(np.abs(normals[:, :1]) < 0.9, np.eye(3)[0], np.eye(3)[1])
    first = along - np.sum(along * normals, axis=1, keepdims=True) * normals
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(normals, first), normals], axis=1)

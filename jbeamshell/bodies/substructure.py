"""Substructure: an elastic body of any origin, condensed to the nodes of its contact.

Finite-element programs call it a substructure or a superelement.  It touches what is below on a
line or on a face.  With q the displacements of its n contact nodes in their frames, one or two
tangential ones and the normal one, node by node, P its loads and r the nodal forces of what it
touches,

    r = K q - f P,      d = f' q + c P,

with d the displacements conjugate to the loads.  Load 0 pulls to and fro, the others press.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray
from scipy.linalg import lapack

from jbeamshell.bodies.face_elements import CORNERS
from jbeamshell.common.arrays import read_arrays, write_arrays
from jbeamshell.common.checks import (
    as_leaf,
    is_traced,
    require,
    require_choice,
    require_finite,
    whole_numbers,
)
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import as_path, check_regular

NEGATIVE = 1e-9  # of the largest eigenvalue: further below zero a mode is negative
LOOSE = {1: 1e-11, 2: 1e-9}  # of the largest eigenvalue: below it a mode costs no energy
BENT = 1e-3  # part of a motion without energy that may be no rigid one
LARGE = 400  # displacements, from which on not all eigenvalues are found
LOOSE_AT_MOST, ITERATIONS = 12, 8  # motions that are sought among so many, and their iterations
CLEAR = 10.0  # times the bound, further than which from it an eigenvalue is told
MODES = ("moves along X", "moves along the normal", "turns")
NAMES = ("places", "normals", "tributary", "stiffness", "forces", "flexibility")
NONE = -1  # in place of a node, in rows of elements with fewer nodes than others
FORMER = {"x": "places", "areas": "tributary"}  # names that files may have instead


class Substructure(eqx.Module):
    """Elastic body on its contact.

    `jbeamshell.StiffnessModel` makes one from a matrix of finite elements.  All arrays are numbers
    of a pytree, so that results can be differentiated for them.

    Attributes
    ----------
    places : (n,) X of the nodes of a contact line, rising; or (n, 3) X, Y, Z of those of a face
    stiffness : (k n, k n) K, tangential and normal in turn, k = 2; on a face in the frames of
        `frames`, two tangents and the normal, k = 3
    forces : (k n, m) f, of the pull and of m - 1 pressures
    flexibility : (m, m) c; zero if left out
    normals : (n, 3) unit normals of a face, from the body below to the one above, or one (3,) for
        all; along Z if left out.  None on a line
    tributary : (n,) contact length of each node, or area on a face.  If left out, half the way to
        the neighbours, and None on a face, whose areas are then not known
    elements : of a face, the places of their nodes in ``places``, in turn around the normals, see
        `jbeamshell.face_surface`; without them nodes are contact points
    fixed : (k n,) True for displacements that a support holds; none if left out

    Raises
    ------
    InputError
        for shapes that do not go together, numbers that are not finite, lengths or areas that are
        not positive, a matrix that is not symmetric, a negative mode, or a motion of a face without
        energy that is not rigid

    Examples
    --------
    ::

        body.save("upper.npz")
        body = jb.Substructure.read("upper.npz")
    """

    places: Array
    stiffness: Array
    forces: Array
    flexibility: Array
    normals: Array | None
    tributary: Array | None
    elements: tuple[tuple[int, ...], ...] = eqx.field(static=True)
    fixed: tuple[bool, ...] = eqx.field(static=True)

    def __init__(
        self,
        places: Any,
        stiffness: Any,
        forces: Any,
        flexibility: Any = None,
        *,
        normals: Any = None,
        tributary: Any = None,
        elements: Sequence[Sequence[int]] = (),
        fixed: Sequence[bool] = (),
    ) -> None:
        self.places, self.stiffness = as_leaf(places, "places"), as_leaf(stiffness, "stiffness")
        self.forces = as_leaf(forces, "forces")
        fix = "give X of each node of a line, or X, Y and Z of each node of a face"
        known = self.places.ndim == 1 or self.places.shape[1:] == (3,)
        require("places.shape", self.places.shape, known, fix)
        n, loads = self.places.shape[0], self.forces.shape[-1:]
        none = jnp.zeros((*loads, *loads))
        self.flexibility = none if flexibility is None else as_leaf(flexibility, "flexibility")
        self.tributary = None if tributary is None else as_leaf(tributary, "tributary")
        self.normals = None
        if self.on_face:
            normal = as_leaf((0.0, 0.0, 1.0) if normals is None else normals, "normals")
            fix = f"give one normal, or one for each of {n} nodes"
            require("normals", normal.shape, normal.shape in ((3,), (n, 3)), fix)
            self.normals = jnp.broadcast_to(normal, (n, 3))
        else:
            require("normals", normals, normals is None, "are those of a face: leave them out")
            if tributary is None:
                half = 0.5 * jnp.diff(self.places)
                self.tributary = jnp.append(half, 0.0) + jnp.append(0.0, half)
        fix = "are those of a face: leave them out"
        require("elements", len(elements), self.on_face or not elements, fix)
        for i, row in enumerate(elements):
            fits = len(row) in CORNERS and len(set(row)) == len(row)
            fits = fits and all(isinstance(k, int | np.integer) and 0 <= k < n for k in row)
            fix = f"give the places 0 to {n - 1} of 3, 4, 6, 8 or 9 nodes"
            require(f"elements[{i}]", row, fits, fix)
        self.elements = tuple(tuple(map(int, row)) for row in elements)
        for i, truth in enumerate(fixed):
            require_choice(f"fixed[{i}]", truth, (False, True))
        self.fixed = tuple(map(bool, fixed)) or (False,) * (self.ways * n)

    def __check_init__(self) -> None:
        n, m = self.places.shape[0], self.forces.shape[-1] if self.forces.ndim == 2 else 0
        size = self.ways * n
        shapes = {
            "places": self.places.shape,
            "tributary": (n,),
            "normals": (n, 3),
            "stiffness": (size, size),
            "forces": (size, m),
            "flexibility": (m, m),
        }
        given = {key: value for key in shapes if (value := getattr(self, key)) is not None}
        for key, value in given.items():
            fits = value.shape == shapes[key] and m > 0
            require(f"{key}.shape", value.shape, fits, f"must be {shapes[key]}")
        require("fixed", len(self.fixed), len(self.fixed) == size, f"must be {size} truths")
        fix = "need double precision: write jax.config.update('jax_enable_x64', True)"
        require("stiffness", "numbers of 32 bits", self.stiffness.dtype == jnp.float64, fix)
        if is_traced(list(given.values())):
            return
        for key, value in given.items():
            require_finite(key, value)
        if self.tributary is not None:
            share, word = np.asarray(self.tributary), "area" if self.on_face else "length"
            fix = f"must be positive: give the contact {word} of each node"
            require("tributary", share, bool(np.all(share > 0.0)), fix)
        fix = "has a negative mode: check the supports and the sign of the matrix"
        free = ~np.array(self.fixed)
        _check_energy("stiffness", np.asarray(self.stiffness), free, NEGATIVE, fix)
        fix = "has a negative mode: give displacements per load, positive along each load"
        loads = np.full(m, True)
        _check_energy("flexibility", np.asarray(self.flexibility), loads, 1e-8, fix)
        if self.on_face:
            lengths = np.linalg.norm(np.asarray(self.normals), axis=1)
            unit = bool(np.all(np.abs(lengths - 1.0) < 1e-6))
            require("normals", lengths, unit, "must have the length 1")
            self._check_loose(free)
        else:
            x = np.asarray(self.places)
            require("places", x, bool(np.all(np.diff(x) > 0.0)), "must rise from node to node")

    def _check_loose(self, free: NDArray[np.bool_]) -> None:
        """Refuse a body that moves without energy and not as a rigid body does."""
        loose = loose_motions(np.asarray(self.stiffness)[np.ix_(free, free)], LOOSE[2])
        rigid = np.linalg.qr(self.rigid_motions()[:, free].T)[0]
        bent = loose - rigid @ (rigid.T @ loose)
        most = float(np.max(np.linalg.norm(bent, axis=0), initial=0.0))
        fix = "its rows do not go with these places and normals, or the bolts hold a loose part"
        require("stiffness", f"a motion without energy, {most:.2g} not rigid", most < BENT, fix)

    @property
    def on_face(self) -> bool:
        """True for a body that touches on a face, False on a line."""
        return self.places.ndim == 2

    @property
    def ways(self) -> int:
        """Displacements of each node: 2 on a line, 3 on a face."""
        return 3 if self.on_face else 2

    @property
    def bolts(self) -> int:
        """Number of loads that press."""
        return int(self.forces.shape[1]) - 1

    @property
    def frames(self) -> NDArray[np.float64]:
        """Frames (n, 3, 3) of the nodes of a face: two tangents and the normal, by rows."""
        return frames_of(np.asarray(self.normals))

    def rigid_motions(self, about: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Rigid motions (k, nodes' displacements): along each axis, and turns.

        Three on a line (along X, along the normal, a turn), six on a face.

        Parameters
        ----------
        about : place about which it turns, the middle of the nodes if left out
        """
        places = np.asarray(self.places)
        n, middle = len(places), places - (np.mean(places, axis=0) if about is None else about)
        if not self.on_face:
            moves = np.zeros((3, n, 2))
            moves[0, :, 0] = moves[1, :, 1] = 1.0
            moves[2, :, 1] = middle
            return moves.reshape(3, -1)
        axes = np.broadcast_to(np.eye(3)[:, None], (3, n, 3))
        both = np.concatenate([axes, np.cross(axes, middle[None])])
        return np.einsum("nij,knj->kni", self.frames, both).reshape(6, -1)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write to an .npz file with a check sum; see `read`."""
        target = as_path(path)
        require("path", str(path), target.suffix == ".npz", "end the name in .npz")
        known = {name: value for name in NAMES if (value := getattr(self, name)) is not None}
        arrays = {name: np.asarray(value) for name, value in known.items()}
        if self.elements:
            rows = np.full((len(self.elements), max(map(len, self.elements))), NONE)
            for table, row in zip(rows, self.elements, strict=True):
                table[: len(row)] = row
            arrays["elements"] = rows
        write_arrays(target, arrays | {"fixed": np.array(self.fixed)})

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Substructure:
        """Substructure in an .npz file of its arrays by name.

        Only ``places`` (or ``x``, on a line), ``stiffness`` and ``forces`` are needed.  A file of
        `save` carries a check sum, by which changed numbers are noticed.

        Raises
        ------
        InputError
            if the file cannot be read, or holds no substructure
        """
        check_regular(path)
        try:
            arrays = read_arrays(as_path(path), signed=False)
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
        except Exception as error:  # NumPy may raise anything for a broken file
            reason = " ".join(f"{type(error).__name__}: {error}".split())[:120]
            raise InputError(f"{path}: is no .npz file of numbers ({reason})") from None
        arrays = {FORMER.get(name, name): value for name, value in arrays.items()}
        missing = [name for name in ("places", "stiffness", "forces") if name not in arrays]
        fix = "give numpy.savez places=, stiffness=, forces=, or read a jbeamshell.StiffnessModel"
        require(str(path), f"without {', '.join(missing)}", not missing, fix)
        given = {name: arrays[name] for name in NAMES if name in arrays}
        rows = np.asarray(arrays.get("elements", np.zeros((0, 0))))
        fix = "give one row for each element, its shorter rows filled with -1"
        require("elements.shape", rows.shape, rows.ndim == 2, fix)
        elements = [row[row != NONE].tolist() for row in whole_numbers("elements", rows)]
        fixed = np.ravel(arrays.get("fixed", ())).tolist()
        return cls(**given, elements=elements, fixed=fixed)


def frames_of(normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Frames (n, 3, 3) of normals (n, 3): the tangent nearest to X (to Y, if X is normal) first."""
    along = np.where(np.abs(normals[:, :1]) < 0.9, np.eye(3)[0], np.eye(3)[1])
    first = along - np.sum(along * normals, axis=1, keepdims=True) * normals
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(normals, first), normals], axis=1)


def loose_motions(stiffness: NDArray[np.float64], least: float) -> NDArray[np.float64]:
    """Eigenvectors (size, count) whose energy is below the least part of the largest one."""
    found = _few_loose(stiffness, least) if len(stiffness) >= LARGE else None
    if found is not None:
        return found
    values, vectors = np.linalg.eigh(stiffness)
    loose: NDArray[np.float64] = vectors[:, values < least * values[-1]]
    return loose


def _few_loose(stiffness: NDArray[np.float64], least: float) -> NDArray[np.float64] | None:
    """The same by inverse iterations of few vectors; None where they do not tell it clearly."""
    size = len(stiffness)
    start = np.random.default_rng(0).normal(size=(size, LOOSE_AT_MOST))
    wave = start[:, 0]
    for _ in range(ITERATIONS):
        wave = stiffness @ (wave / np.linalg.norm(wave))
    largest = float(np.linalg.norm(wave))  # a little less than the largest eigenvalue
    shifted = stiffness + least * largest * np.eye(size)
    lower, failed = lapack.dpotrf(shifted, lower=1, overwrite_a=1)
    if failed:
        return None
    for _ in range(ITERATIONS):
        start = np.linalg.qr(lapack.dpotrs(lower, start, lower=1)[0])[0]
    values, turns = np.linalg.eigh(start.T @ stiffness @ start)
    over = values / (least * largest)
    unclear = np.any((over > 1.0 / CLEAR) & (over < CLEAR)) or over[-1] < 1.0
    return None if unclear else start @ turns[:, over < 1.0]


def loose_mode(body: Substructure, stiffness: NDArray[np.float64]) -> str:
    """Name of the motion of a contact line that costs no energy; empty if there is none.

    Parameters
    ----------
    body : whose line it is
    stiffness : (2n, 2n), zero for what is fixed
    """
    loose = loose_motions(stiffness, LOOSE[1])
    if not loose.size:
        return ""
    modes = body.rigid_motions()
    share = np.linalg.norm(modes @ loose, axis=1) / np.linalg.norm(modes, axis=1)
    return MODES[int(np.argmax(share))] if np.max(share) > 0.5 else "deforms without energy"


def _check_energy(key: str, matrix: np.ndarray, free: np.ndarray, least: float, fix: str) -> None:
    """Refuse a matrix that is not symmetric, or whose free part has a negative eigenvalue."""
    apart, size = (float(np.max(np.abs(part))) for part in (matrix - matrix.T, matrix))
    same = apart <= 1e-8 * size
    require(key, f"max|K - K'| {apart:.3g}", same, "is not symmetric: mirror it")
    part = matrix[np.ix_(free, free)]
    # Above zero after so small a shift: that is quickly seen.
    shifted = part + least * np.max(np.diag(part), initial=0.0) * np.eye(len(part))
    if len(part) >= LARGE and not lapack.dpotrf(shifted, lower=1, overwrite_a=1)[1]:
        return
    values = np.linalg.eigvalsh(part)
    require(key, f"least eigenvalue {values[0]:.3g}", values[0] >= -least * values[-1], fix)

"""Substructure: an elastic body of any origin, condensed to the nodes of its contact line.

Finite-element programs call it a substructure or a superelement.  With q the tangential
displacements and heights of its n contact nodes, node by node, P its loads and r the nodal forces
of what it touches,

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

from jbeamshell.common.arrays import read_arrays, write_arrays
from jbeamshell.common.checks import as_leaf, is_traced, require, require_choice, require_finite
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import as_path, check_regular

LOOSE = 1e-11  # of the largest eigenvalue: below it a mode costs no energy
MODES = ("moves along X", "moves along the normal", "turns")


class Substructure(eqx.Module):
    """Elastic body on its contact line.

    `jbeamshell.StiffnessModel` makes one from a matrix of finite elements.  All arrays are numbers
    of a pytree, so that results can be differentiated for them.

    Attributes
    ----------
    x : (n,) places X of the contact nodes, rising
    stiffness : (2n, 2n) K, tangential and normal in turn
    forces : (2n, m) f, of the pull and of m - 1 pressures
    flexibility : (m, m) c; zero if left out
    tributary : (n,) contact lengths; half the way to the neighbours if left out
    fixed : (2n,) True for displacements that a support holds; none if left out

    Raises
    ------
    InputError
        for shapes that do not go together, numbers that are not finite, a contact length that is
        not positive, a matrix that is not symmetric, or a negative mode

    Examples
    --------
    ::

        body.save("upper.npz")
        body = jb.Substructure.read("upper.npz")
    """

    x: Array
    stiffness: Array
    forces: Array
    flexibility: Array
    tributary: Array
    fixed: tuple[bool, ...] = eqx.field(static=True)

    def __init__(
        self,
        x: Any,
        stiffness: Any,
        forces: Any,
        flexibility: Any = None,
        *,
        tributary: Any = None,
        fixed: Sequence[bool] = (),
    ) -> None:
        self.x, self.stiffness = as_leaf(x, "x"), as_leaf(stiffness, "stiffness")
        self.forces = as_leaf(forces, "forces")
        loads, half = self.forces.shape[-1:], 0.5 * jnp.diff(self.x)
        none = jnp.zeros((*loads, *loads))
        self.flexibility = none if flexibility is None else as_leaf(flexibility, "flexibility")
        lengths = jnp.append(half, 0.0) + jnp.append(0.0, half)
        self.tributary = lengths if tributary is None else as_leaf(tributary, "tributary")
        for i, truth in enumerate(fixed):
            require_choice(f"fixed[{i}]", truth, (False, True))
        self.fixed = tuple(map(bool, fixed)) or (False,) * (2 * self.x.size)

    def __check_init__(self) -> None:
        n, m = self.x.size, self.forces.shape[-1] if self.forces.ndim == 2 else 0
        shapes = {
            "x": (self.x, (n,)),
            "tributary": (self.tributary, (n,)),
            "stiffness": (self.stiffness, (2 * n, 2 * n)),
            "forces": (self.forces, (2 * n, m)),
            "flexibility": (self.flexibility, (m, m)),
        }
        for key, (value, shape) in shapes.items():
            require(f"{key}.shape", value.shape, value.shape == shape and m > 0, f"must be {shape}")
        require("fixed", len(self.fixed), len(self.fixed) == 2 * n, f"must be {2 * n} truths")
        fix = "need double precision: write jax.config.update('jax_enable_x64', True)"
        require("stiffness", "numbers of 32 bits", self.stiffness.dtype == jnp.float64, fix)
        if is_traced(self.x, self.tributary, self.stiffness, self.forces, self.flexibility):
            return
        for key, (value, _) in shapes.items():
            require_finite(key, value)
        x, tributary = np.asarray(self.x), np.asarray(self.tributary)
        require("x", x, bool(np.all(np.diff(x) > 0.0)), "must rise from node to node")
        fix = "must be positive: give the contact length of each node"
        require("tributary", tributary, bool(np.all(tributary > 0.0)), fix)
        free = ~np.array(self.fixed)
        fix = "has a negative mode: check the supports and the sign of the matrix"
        check_energy("stiffness", np.asarray(self.stiffness), free, LOOSE, fix)
        fix = "has a negative mode: give displacements per load, positive along each load"
        loads = np.full(self.flexibility.shape[:1], True)
        check_energy("flexibility", np.asarray(self.flexibility), loads, 1e-8, fix)

    @property
    def bolts(self) -> int:
        """Number of loads that press."""
        return int(self.forces.shape[1]) - 1

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write to an .npz file; see `read`."""
        names = ("x", "tributary", "stiffness", "forces", "flexibility", "fixed")
        write_body(path, {name: np.asarray(getattr(self, name)) for name in names})

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Substructure:
        """Substructure in an .npz file of its arrays by name.

        ``flexibility``, ``tributary`` and ``fixed`` may be left out.  A file of `save` carries a
        check sum, by which changed numbers are noticed.

        Raises
        ------
        InputError
            if the file cannot be read, or holds no substructure
        """
        arrays = read_body(path, ("x", "stiffness", "forces"))
        return cls(
            arrays["x"],
            arrays["stiffness"],
            arrays["forces"],
            arrays.get("flexibility"),
            tributary=arrays.get("tributary"),
            fixed=np.ravel(arrays.get("fixed", ())).tolist(),
        )


def write_body(path: str | os.PathLike[str], arrays: dict[str, np.ndarray]) -> None:
    """Write arrays of a condensed body to an .npz file with a check sum."""
    target = as_path(path)
    require("path", str(path), target.suffix == ".npz", "end the name in .npz")
    write_arrays(target, arrays)


def read_body(path: str | os.PathLike[str], needed: Sequence[str]) -> dict[str, np.ndarray]:
    """Arrays of a condensed body in an .npz file.

    Raises
    ------
    InputError
        if the file cannot be read, or lacks an array that is needed
    """
    check_regular(path)
    try:
        arrays = read_arrays(as_path(path), signed=False)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except Exception as error:  # NumPy may raise anything for a broken file
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:120]
        raise InputError(f"{path}: is no .npz file of numbers ({reason})") from None
    missing = [name for name in needed if name not in arrays]
    fix = f"give numpy.savez {'=, '.join(needed)}=, or read a jbeamshell.StiffnessModel"
    require(str(path), f"without {', '.join(missing)}", not missing, fix)
    return arrays


def check_energy(key: str, matrix: np.ndarray, free: np.ndarray, least: float, fix: str) -> None:
    """Refuse a matrix that is not symmetric, or whose free part has a negative eigenvalue."""
    apart, size = (float(np.max(np.abs(part))) for part in (matrix - matrix.T, matrix))
    same = apart <= 1e-8 * size
    require(key, f"max|K - K'| {apart:.3g}", same, "is not symmetric: mirror it")
    values = np.linalg.eigvalsh(matrix[np.ix_(free, free)])
    require(key, f"least eigenvalue {values[0]:.3g}", values[0] >= -least * values[-1], fix)


def potential(body: Substructure, bolts: Array) -> Array:
    """Second derivatives (2n + 2, 2n + 2) of a body's potential in q, the pull and the pressing.

    Parameters
    ----------
    body : substructure with m - 1 pressures
    bolts : (m - 1,) their sizes when the pressing is 1
    """
    mixed = jnp.eye(1, 2)  # of a body that no bolt presses
    if body.bolts:
        mixed = jnp.concatenate([jnp.eye(1, body.bolts + 1), jnp.append(0.0, bolts)[None]]).T
    forces = -body.forces @ mixed
    return jnp.block([[body.stiffness, forces], [forces.T, -mixed.T @ body.flexibility @ mixed]])


def loose_mode(stiffness: np.ndarray, x: np.ndarray) -> str:
    """Name of the movement that costs no energy; empty if there is none.

    Parameters
    ----------
    stiffness : (2n, 2n) tangential and normal in turn, zero for what is fixed
    x : (n,) places of the nodes
    """
    values, vectors = np.linalg.eigh(stiffness)
    loose = vectors[:, values < LOOSE * values[-1]]
    if not loose.size:
        return ""
    middle = x - np.mean(x)
    rigid = np.zeros((3, x.size, 2))
    rigid[0, :, 0] = rigid[1, :, 1] = 1.0
    rigid[2, :, 1] = middle
    modes = rigid.reshape(3, -1)
    share = np.linalg.norm(modes @ loose, axis=1) / np.linalg.norm(modes, axis=1)
    return MODES[int(np.argmax(share))] if np.max(share) > 0.5 else "deforms without energy"

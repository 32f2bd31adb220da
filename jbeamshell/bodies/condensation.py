"""Condensation of a matrix on the nodes of a contact, on a line or on a face (Guyan 1965)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.linalg import SuperLU, splu

from jbeamshell.bodies.substructure import frames_of
from jbeamshell.bodies.surface import Elements, face_mesh
from jbeamshell.bodies.tables import node_table, table_of
from jbeamshell.common.checks import require, whole_numbers
from jbeamshell.common.errors import InputError

SAME_PLACE = 1e-9  # of the contact's length, within which nodes lie at one X
LOST = 1e-12  # pivot over its diagonal entry, from which on nothing is left of the stiffness
LEVEL = 1e-9  # of a normal, within which it lies along an axis
TABLE = "give rows of node and X, or of node, X, Y and Z for a face"
FORCES = "give rows of node, direction and force"

Given = dict[str, Any]  # arguments of `jbeamshell.Substructure` but for its matrices


def line_rows(
    dofs: NDArray[np.int64],
    known: NDArray[np.int64],
    contact: ArrayLike,
    directions: tuple[int, int],
) -> tuple[NDArray[np.int64], Given]:
    """Place of each row (N,) on a contact line, and the body's ``places`` and ``fixed``.

    Parameters
    ----------
    dofs, known : node and direction of the model's rows, without and with those that are held
    contact : (k, 2) node and X
    directions : tangential and normal one
    """
    row = {(int(a), int(b)): i for i, (a, b) in enumerate(dofs)}
    nodes, x, group = _groups(contact)
    known_nodes = set(known[:, 0].tolist())
    for node in nodes:
        fix = "is no node of the model: give nodes that have rows in the matrix"
        require("contact", node, node in known_nodes, fix)
    for key, direction in zip(("tangential", "normal"), directions, strict=True):
        fix = "is a direction that no node of the contact has: name another, or free a node"
        require(key, direction, any((node, direction) in row for node in nodes), fix)
    place, fixed = _places(row, nodes, group, directions)
    return place, {"places": x, "fixed": fixed.ravel().tolist()}


def face_rows(
    dofs: NDArray[np.int64],
    nodes: ArrayLike,
    normals: ArrayLike | None,
    elements: Iterable[ArrayLike] | None,
    areas: ArrayLike | None,
) -> tuple[NDArray[np.int64], scipy.sparse.csr_array, Given]:
    """Place of each row (N,) on a face, the turn (3n, 3n) into its frames, and what a body needs.

    Parameters
    ----------
    dofs : node and direction of the model's rows
    nodes : (n, 4) node, X, Y and Z
    normals, elements, areas : of the face, see `jbeamshell.StiffnessModel.condensed`
    """
    numbers, places = node_table(nodes)
    towards = (0.0, 0.0, 1.0) if normals is None else normals
    mesh: Elements = ()
    if elements is not None:
        require("tributary", areas, areas is None, "is that of the elements: leave one out")
        (shares, towards), mesh = face_mesh(nodes, elements, towards)
        areas = shares if np.min(shares) > LEVEL * np.max(shares) else None
    row = {(int(a), int(b)): i for i, (a, b) in enumerate(dofs)}
    n = len(numbers)
    normal = np.broadcast_to(np.asarray(towards, float), (n, 3))
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
    turn = scipy.sparse.csr_array(scipy.sparse.block_diag(list(frames)))
    given = {"places": places, "normals": normal, "tributary": areas}
    return place, turn, given | {"elements": mesh, "fixed": fixed.ravel().tolist()}


def condensed_on(
    matrix: scipy.sparse.csc_array, forces: NDArray[Any], place: NDArray[np.int64], size: int
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Stiffness, forces and flexibility of the contact's displacements, ``size`` of them."""
    on_line, inside = np.flatnonzero(place >= 0), np.flatnonzero(place == -1)
    ties = scipy.sparse.csc_array(
        (np.ones(on_line.size), (np.arange(on_line.size), place[on_line])),
        shape=(on_line.size, size),
    )
    stiffness = (ties.T @ matrix[on_line][:, on_line] @ ties).toarray()
    across = (matrix[inside][:, on_line] @ ties).toarray()
    loads, forces = forces[inside], ties.T @ forces[on_line]
    flexibility = np.zeros((forces.shape[1],) * 2)
    if inside.size:
        fields = factors_of(matrix[inside][:, inside]).solve(np.hstack([across, loads]))
        by_contact, by_loads = np.split(fields, [across.shape[1]], axis=1)
        stiffness = stiffness - across.T @ by_contact
        forces = forces - across.T @ by_loads
        flexibility = loads.T @ by_loads
    return 0.5 * (stiffness + stiffness.T), forces, 0.5 * (flexibility + flexibility.T)


def nodal_forces(
    key: str, table: ArrayLike, row: dict[tuple[int, int], int]
) -> NDArray[np.float64]:
    """Nodal forces (N,) of a table of node, direction and force."""
    values = table_of(key, table, 3, FORCES)
    forces = np.zeros(len(row))
    places = whole_numbers(key, values[:, :2]).tolist()
    for (node, direction), force in zip(places, values[:, 2], strict=True):
        where = row.get((node, direction))
        if where is None:
            fix = "is not in the model: leave it out where a support holds it"
            raise InputError(f"{key} = node {node}, direction {direction}: {fix}")
        forces[where] += force
    return forces


def factors_of(matrix: scipy.sparse.csc_array) -> SuperLU:
    """Factors of what is eliminated, which must be positive definite."""
    try:
        factors = splu(
            scipy.sparse.csc_matrix(matrix),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:  # exactly singular
        pivot = 0.0
    else:
        pivot = float(np.min(factors.U.diagonal()[factors.perm_c] / matrix.diagonal()))
    fix = "a part moves freely or has a negative mode with the contact clamped: check the supports"
    require("matrix", f"pivot {pivot:.3g} of its diagonal", pivot > LOST, fix)
    return factors


def _groups(contact: ArrayLike) -> tuple[list[int], NDArray[np.float64], NDArray[np.int64]]:
    """Nodes of the contact, the rising places X, and the place of each node."""
    table = table_of("contact", contact, 2, TABLE)
    nodes = whole_numbers("contact", table[:, 0]).tolist()
    require("contact", len(nodes), len(set(nodes)) == len(nodes), "names a node twice")
    order = np.argsort(table[:, 1], kind="stable")
    rising = table[order, 1]
    begins = np.diff(rising, prepend=-np.inf) > SAME_PLACE * np.ptp(rising)
    group = np.empty(len(nodes), int)
    group[order] = np.cumsum(begins) - 1
    x = rising[begins]
    require("contact", x.size, x.size > 1, "needs nodes at two or more places X")
    return nodes, x, group


def _places(
    row: dict[tuple[int, int], int],
    nodes: list[int],
    group: NDArray[np.int64],
    directions: tuple[int, int],
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Place of each row (N,) on the contact, and True for the contact's fixed displacements (n, 2).

    A place is -1 inside the body, and -2 where a support holds another node at the same X.
    """
    place, fixed = np.full(len(row), -1), np.zeros((np.max(group) + 1, 2), bool)
    for side, direction in enumerate(directions):
        for node, g in zip(nodes, group, strict=True):
            fixed[g, side] |= (node, direction) not in row
        for node, g in zip(nodes, group, strict=True):
            if (node, direction) in row:
                place[row[node, direction]] = -2 if fixed[g, side] else 2 * g + side
    return place, fixed

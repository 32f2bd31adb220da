"""Areas and normals of the nodes of a face, from its elements by their shape functions.

With N_i the shape function of node i, and x(u, v) the place on an element,

    A_i = int N_i |x_u x x_v| du dv,    n_i ~ int N_i x_u x x_v du dv,

so that an even pressure p has the nodal forces p A_i (Zienkiewicz and Taylor 2000, chapter 8).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from jbeamshell.bodies.tables import node_table
from jbeamshell.common.checks import require, whole_numbers
from jbeamshell.common.errors import InputError

ELEMENTS = "give rows of the 3 or 4 nodes of each element, in turn around it"
QUADRATIC = (
    "has nodes on its edges, whose corners bear nothing or pull under an even pressure: "
    "mesh the face with linear elements"
)
MATCH = 1e-6  # of the face's extent, within which nodes match
SIDE = 0.1  # cosine to the direction that is given, from which on a side of an element is meant
FLAT = 1e-9  # of the largest element, below which one has no area
# Corners of the square, and where its area is summed up: 2 x 2 points of Gauss, of weight 1.
CORNERS = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
POINTS = CORNERS / np.sqrt(3.0)


class Surface(NamedTuple):
    """Areas (n,) and unit normals (n, 3) of the nodes of a face."""

    areas: NDArray[np.float64]
    normals: NDArray[np.float64]


def face_surface(
    nodes: ArrayLike, elements: Iterable[ArrayLike], towards: ArrayLike | None = None
) -> Surface:
    """Areas and normals of the nodes of a face.

    Parameters
    ----------
    nodes : (n, 4) node, X, Y and Z
    elements : the nodes of each triangle or quadrilateral, in turn around it; both may be mixed
    towards : (3,) or (n, 3) direction of the side to which the normals point, roughly; None is
        the side from which the nodes of an element turn counter-clockwise

    Raises
    ------
    InputError
        for a node that no element has, an element with another node, without area, with more than
        4 nodes, or whose side is not clear
    """
    numbers, places = node_table(nodes)
    index = {node: i for i, node in enumerate(numbers)}
    n = len(numbers)
    sides = None if towards is None else np.broadcast_to(np.asarray(towards, float), (n, 3))
    areas, normals = np.zeros(n), np.zeros((n, 3))
    names = _rows(elements)
    parts = [_shares(places[[_place(index, k, node) for node in row]]) for k, row in names]
    whole = np.array([np.linalg.norm(np.sum(part, axis=0)) for part in parts])
    for (k, row), part, size in zip(names, parts, whole, strict=True):
        at = [index[node] for node in row]
        turn = np.sign(part @ np.sum(part, axis=0))
        clear = bool(size > FLAT * np.max(whole) and np.all(turn > 0.0))
        fix = "has no area, or crosses itself: name its nodes in turn around it"
        require(f"elements[{k}]", row, clear, fix)
        along = np.sum(part, axis=0) / size
        if sides is not None:
            way = np.mean(sides[at], axis=0)
            cosine = float(along @ way) / max(float(np.linalg.norm(way)), np.finfo(float).tiny)
            fix = "lies along the normals that are given: say to which side it faces"
            require(f"elements[{k}]", row, abs(cosine) > SIDE, fix)
            part = part * np.sign(cosine)
        np.add.at(areas, at, np.linalg.norm(part, axis=1))
        np.add.at(normals, at, part)
    lost = [node for node, area in zip(numbers, areas, strict=True) if area == 0.0]
    require("nodes", lost[:1], not lost, "is in no element of the face: leave it out")
    lengths = np.linalg.norm(normals, axis=1)
    for node, area, length in zip(numbers, areas, lengths, strict=True):
        fix = "has elements that face to opposite sides: order their nodes alike, or say normals"
        require("nodes", f"node {node}", length > SIDE * area, fix)
    return Surface(areas, normals / lengths[:, None])


def spread(
    made: Surface, numbers: Sequence[int], direction: int | None = None
) -> NDArray[np.float64]:
    """Rows (k, 3) of node, direction and force of an even load on a face.

    Parameters
    ----------
    made : its areas and normals
    numbers : of its nodes
    direction : of a load of size 1, 1 to 3; None is a pressure whose resultant has the size 1
    """
    share = made.areas / np.sum(made.areas)
    nodes = np.asarray(numbers)
    if direction is not None:
        return np.column_stack([nodes, np.full(nodes.size, direction), share])
    forces = -share[:, None] * made.normals
    forces /= np.linalg.norm(np.sum(forces, axis=0))
    rows = [np.column_stack([nodes, np.full(nodes.size, k + 1), forces[:, k]]) for k in range(3)]
    table = np.concatenate(rows)
    return table[np.abs(table[:, 2]) > 1e-12 * np.max(np.abs(table[:, 2]))]


def matched(upper: ArrayLike, lower: ArrayLike) -> NDArray[np.float64]:
    """Rows of a lower face in the order of the upper one, node on node.

    Parameters
    ----------
    upper, lower : (n, 4) node, X, Y and Z

    Raises
    ------
    InputError
        naming a node of the upper face that has none below
    """
    (numbers, places), (_, below) = node_table(upper), node_table(lower)
    table = np.asarray(lower, float)
    away, at = cKDTree(below).query(places)
    far = int(np.argmax(away))
    near = away[far] <= MATCH * np.max(np.ptp(places, axis=0))
    fix = f"is {away[far]:.3g} away from the next node of the lower face: mesh both faces alike"
    require("upper.face", f"node {numbers[far]}", bool(near), fix)
    fix = f"must have the {len(numbers)} nodes of the upper face: name the part that touches"
    same = len(below) == len(numbers) == np.unique(at).size
    require("lower.face", f"{len(below)} nodes", same, fix)
    return table[at]


def _rows(elements: Iterable[ArrayLike]) -> list[tuple[int, list[int]]]:
    """Number and nodes of each element; a node that follows itself counts once."""
    found, known = [], dict[tuple[int, ...], int]()
    for k, given in enumerate(elements):
        key = f"elements[{k}]"
        row = whole_numbers(key, np.ravel(np.asarray(given))).tolist()
        row = [node for i, node in enumerate(row) if node != row[i - 1]]
        require(key, row, len(row) not in (6, 8, 9), QUADRATIC)
        require(key, row, len(set(row)) == len(row) in (3, 4), ELEMENTS)
        first = known.setdefault(tuple(sorted(row)), k)
        require(key, row, first == k, f"is elements[{first}] again: name each once")
        found.append((k, row))
    require("elements", len(found), bool(found), ELEMENTS)
    return found


def _place(index: dict[int, int], k: int, node: int) -> int:
    """Place of a node of element k in the table."""
    if node not in index:
        raise InputError(f"elements[{k}] = node {node}: is not in nodes: give its X, Y and Z")
    return index[node]


def _shares(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normals (k, 3) of an element's nodes, as long as the nodes' areas."""
    if len(corners) == 3:
        normal = 0.5 * np.cross(corners[1] - corners[0], corners[2] - corners[0])
        return np.tile(normal / 3.0, (3, 1))
    total = np.zeros((4, 3))
    for u, v in POINTS:
        a, b = 1.0 + CORNERS[:, 0] * u, 1.0 + CORNERS[:, 1] * v
        along, across = 0.25 * CORNERS[:, 0] * b, 0.25 * CORNERS[:, 1] * a
        normal = np.cross(along @ corners, across @ corners)
        total += 0.25 * np.outer(a * b, normal)
    return total

"""Areas and normals of the nodes of a face, from its elements by their shape functions.

With N_i the shape function of node i, and x(u, v) the place on an element,

    A_i = int N_i |x_u x x_v| du dv,    n_i ~ int N_i^2 x_u x x_v du dv,

so that an even pressure p has the nodal forces p A_i (Zienkiewicz and Taylor 2000, chapter 8).
Those of quadratic elements are zero or negative at their corners.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from jbeamshell.bodies.face_elements import CORNERS as COUNTS
from jbeamshell.bodies.face_elements import RULES, Spots, spots
from jbeamshell.bodies.tables import node_table
from jbeamshell.common.checks import require, whole_numbers
from jbeamshell.common.errors import InputError

ELEMENTS = "give rows of the 3, 4, 6, 8 or 9 nodes of each element, corners in turn around it first"
Elements = tuple[tuple[int, ...], ...]
MATCH = 1e-6  # of the face's extent, within which nodes match
SIDE = 0.1  # cosine to the direction that is given, from which on a side of an element is meant
FLAT = 1e-9  # of the largest element, below which one has no area


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
    elements : the nodes of each triangle or quadrilateral: its corners in turn around it, then the
        middles of its edges in turn, then its middle; 3, 4, 6, 8 or 9 nodes, which may be mixed
    towards : (3,) or (n, 3) direction of the side to which the normals point, roughly; None is
        the side from which the nodes of an element turn counter-clockwise

    Raises
    ------
    InputError
        for a node that no element has, an element with another node, without area, with another
        number of nodes, or whose side is not clear
    """
    return face_mesh(nodes, elements, towards)[0]


def face_mesh(
    nodes: ArrayLike, elements: Iterable[ArrayLike], towards: ArrayLike | None = None
) -> tuple[Surface, Elements]:
    """Areas and normals of `face_surface`, and the elements.

    The elements are the places of their nodes in the table of nodes, in turn around the normals.
    """
    numbers, places = node_table(nodes)
    index = {node: i for i, node in enumerate(numbers)}
    n = len(numbers)
    sides = None if towards is None else np.broadcast_to(np.asarray(towards, float), (n, 3))
    areas, sizes, normals = np.zeros(n), np.zeros(n), np.zeros((n, 3))
    names, rows = _rows(elements), []
    parts = [_parts(places[[_place(index, k, node) for node in row]]) for k, row in names]
    whole = np.array([np.linalg.norm(np.sum(part.normals, axis=0)) for part in parts])
    for (k, row), part, size in zip(names, parts, whole, strict=True):
        at = [index[node] for node in row]
        total = np.sum(part.normals, axis=0)
        clear = bool(size > FLAT * np.max(whole) and np.all(part.normals @ total > 0.0))
        fix = "has no area, or crosses itself: name its nodes in turn around it"
        require(f"elements[{k}]", row, clear, fix)
        sign = 1.0
        if sides is not None:
            way = np.mean(sides[at], axis=0)
            length = max(float(np.linalg.norm(way)), np.finfo(float).tiny)
            cosine = float(total @ way) / size / length
            fix = "lies along the normals that are given: say to which side it faces"
            require(f"elements[{k}]", row, abs(cosine) > SIDE, fix)
            sign = float(np.sign(cosine))
        rows.append(tuple(at) if sign > 0.0 else _turned(at))
        lengths = np.linalg.norm(part.normals, axis=1)
        np.add.at(areas, at, part.values.T @ lengths)
        np.add.at(sizes, at, (part.values**2).T @ lengths)
        np.add.at(normals, at, sign * (part.values**2).T @ part.normals)
    lost = [node for node, size in zip(numbers, sizes, strict=True) if size == 0.0]
    require("nodes", lost[:1], not lost, "is in no element of the face: leave it out")
    lengths = np.linalg.norm(normals, axis=1)
    for node, size, length in zip(numbers, sizes, lengths, strict=True):
        fix = "has elements that face to opposite sides: order their nodes alike, or say normals"
        require("nodes", f"node {node}", length > SIDE * size, fix)
    return Surface(areas, normals / lengths[:, None]), tuple(rows)


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
        require(key, row, len(set(row)) == len(row) in COUNTS, ELEMENTS)
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


def _parts(corners: NDArray[np.float64]) -> Spots:
    """Quadrature points of an element, the normals as long as the areas of the points."""
    rule = RULES[len(corners)]
    found = spots(corners, rule.points)
    return found._replace(normals=found.normals * rule.weights[:, None])


def _turned(row: list[int]) -> tuple[int, ...]:
    """Nodes of an element in turn around it the other way."""
    count = COUNTS[len(row)]
    corners, edges = row[:count], row[count : 2 * count]
    return (*corners[::-1], *edges[-2::-1], *edges[-1:], *row[2 * count :])

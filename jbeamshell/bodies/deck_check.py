"""Checks of a deck against its matrices: whether both speak of the same nodes, in the same units.

A body that turns costs no energy, so that K u vanishes for a turn u on every node that no support
is near; places of other nodes give forces.  The own stiffness of a node sums up to
(lambda + 4 mu) int |grad N|^2 dV over its three directions, and its mass to the density times
int N dV, which other units miss by powers of ten (Zienkiewicz and Taylor 2000, chapters 6 and 8).
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from jbeamshell.bodies.deck import Deck
from jbeamshell.bodies.stiffness_model import StiffnessModel
from jbeamshell.common.checks import require

TURNS = 1e-6  # force under a turn over the sum of its parts, from which on nodes are others
STIFF = 4.0  # own stiffness over that of the places, from which on units are others: incompatible
# modes and reduced integration lower it by less than half
HEAVY = 1.1  # the same of the mass
CUBE = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))[[0, 4, 6, 2, 1, 5, 7, 3]]

Vector = NDArray[np.float64]


def check_deck(key: str, deck: Deck, model: StiffnessModel) -> None:
    """Refuse a deck that is not that of the matrices.

    Parameters
    ----------
    key : name of the body in messages
    deck, model : mesh and matrices

    Raises
    ------
    InputError
        naming a node, for other nodes or units
    """
    rows: dict[int, list[int]] = {}
    for i, (node, way) in enumerate(model.dofs.tolist()):
        if way > 0:
            rows.setdefault(node, []).append(i)
    for node in rows:
        fix = "has rows in the matrix, but no *NODE line in the deck: give the deck of this matrix"
        require(f"{key}.deck", f"node {node}", node in deck.places, fix)
    whole = {node for node, own in rows.items() if len(own) == 3}
    near = {n for row in deck.elements.values() if not whole.issuperset(row) for n in row}
    used = {node for row in deck.elements.values() for node in row}
    clear = sorted((whole & used) - near)
    if not clear:
        return
    _check_turns(key, deck, model, np.concatenate([rows[node] for node in clear]))
    _check_units(key, deck, model, {node: rows[node] for node in clear})


def _check_turns(key: str, deck: Deck, model: StiffnessModel, rows: NDArray[np.int64]) -> None:
    """Refuse nodes whose places are not those of the matrix."""
    places = np.array([deck.places.get(node, [0.0] * 3) for node in model.dofs[:, 0].tolist()])
    places = places - np.mean(places, axis=0)
    ways = model.dofs[:, 1]
    for axis in np.eye(3):
        turn = np.cross(axis, places)
        u = np.where(ways > 0, turn[np.arange(len(ways)), np.maximum(ways, 1) - 1], 0.0)
        force, size = np.abs(model.matrix @ u)[rows], (abs(model.matrix) @ np.abs(u))[rows]
        worst = int(np.argmax(force / np.maximum(size, np.finfo(float).tiny)))
        node = int(model.dofs[rows[worst], 0])
        fix = (
            "resists a turn of the whole body: its place is not that of the matrix; write deck and "
            "matrix from one mesh, with the same node numbers"
        )
        fine = force[worst] <= TURNS * size[worst]
        require(f"{key}.deck", f"node {node}", bool(fine), fix)


def _check_units(key: str, deck: Deck, model: StiffnessModel, rows: dict[int, list[int]]) -> None:
    """Refuse a deck whose units are not those of the matrices, as far as it says its material."""
    volumes, slopes = _integrals(deck)
    nodes = [node for node in rows if node in volumes]
    if not nodes:
        return
    fix = "write deck and matrix in the same units"
    if len(set(deck.elastic)) == 1:
        modulus, ratio = deck.elastic[0]
        shear = 0.5 * modulus / (1.0 + ratio)
        lame = modulus * ratio / ((1.0 + ratio) * (1.0 - 2.0 * ratio))
        diagonal = model.matrix.diagonal()
        there = sum(float(np.sum(diagonal[rows[node]])) for node in nodes)
        here = (lame + 4.0 * shear) * sum(slopes[node] for node in nodes)
        fine = 1.0 / STIFF < there / here < STIFF
        words = f"is {there / here:.2g} times as stiff in the matrix as by its places and *ELASTIC"
        require(f"{key}.deck", "stiffness", fine, f"{words}: {fix}")
    if len(set(deck.densities)) == 1 and model.mass is not None:
        along = (model.mass @ (model.dofs[:, 1] == 1).astype(float)).ravel()
        first = [row for node in nodes for row in rows[node] if model.dofs[row, 1] == 1]
        there = float(np.sum(along[first]))
        here = deck.densities[0] * sum(volumes[node] for node in nodes)
        fine = 1.0 / HEAVY < there / here < HEAVY
        words = f"is {there / here:.2g} times as heavy in the matrix as by its places and *DENSITY"
        require(f"{key}.deck", "mass", fine, f"{words}: {fix}")


def _integrals(deck: Deck) -> tuple[dict[int, float], dict[int, float]]:
    """Integrals of N and of |grad N|^2 by node, over bricks and tetrahedra of linear functions.

    Nodes of other elements have none.
    """
    volumes, slopes, lost = dict[int, float](), dict[int, float](), set[int]()
    for row in deck.elements.values():
        if len(row) not in (4, 8) or not all(node in deck.places for node in row):
            lost.update(row)
            continue
        corners = np.array([deck.places[node] for node in row])
        for shape, by_place, weight in _points(len(row)):
            jacobian = by_place.T @ corners
            size = weight * abs(float(np.linalg.det(jacobian)))
            if size == 0.0:
                lost.update(row)
                continue
            gradient = np.linalg.solve(jacobian, by_place.T).T
            squares = np.sum(gradient**2, axis=1)
            for node, part, square in zip(row, shape, squares, strict=True):
                volumes[node] = volumes.get(node, 0.0) + size * float(part)
                slopes[node] = slopes.get(node, 0.0) + size * float(square)
    for node in lost:
        volumes.pop(node, None)
    return volumes, slopes


def _points(nodes: int) -> list[tuple[Vector, Vector, float]]:
    """Shape functions, their slopes and the weight at each point of a linear element."""
    if nodes == 4:
        slopes = np.concatenate([-np.ones((1, 3)), np.eye(3)])
        return [(np.full(4, 0.25), slopes, 1.0 / 6.0)]
    found = []
    for point in CUBE / np.sqrt(3.0):
        factors = 0.5 * (1.0 + CUBE * point)
        others = [np.prod(np.delete(factors, way, axis=1), axis=1) for way in range(3)]
        slopes = 0.5 * CUBE * np.stack(others, axis=1)
        found.append((np.prod(factors, axis=1), slopes, 1.0))
    return found

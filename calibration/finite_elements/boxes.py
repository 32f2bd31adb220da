"""Bricks of a box, of 8 or 20 nodes: stiffness and mass, by points of Gauss."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import scipy.sparse

import jbeamshell as jb

Places = Callable[[np.ndarray], np.ndarray]
Model = tuple[jb.StiffnessModel, np.ndarray]

CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
POWERS = np.array(list(itertools.product((0, 1), repeat=3)))
EVERY = list(itertools.product((-1.0, 0.0, 1.0), repeat=3))
EDGES = np.array([place for place in EVERY if place.count(0.0) < 2])
SERENDIPITY = np.array(
    [row for row in itertools.product(range(3), repeat=3) if sum(k for k in row if k > 1) <= 2]
)


def box(
    counts: Sequence[int],
    sizes: Sequence[float],
    at: Sequence[float] = (0.0, 0.0, 0.0),
    modulus: float = 210e3,
    poisson: float = 0.3,
    density: float = 7.85e-9,
    held: Places | None = None,
    quadratic: bool = False,
) -> Model:
    """Model of a box of equal bricks, and the places of its nodes, see `on_grid`."""
    lines = [a + np.linspace(0.0, s, n + 1) for a, s, n in zip(at, sizes, counts, strict=True)]
    return on_grid(lines, modulus, poisson, density, held, quadratic)


def on_grid(
    lines: Sequence[Any],
    modulus: float = 210e3,
    poisson: float = 0.3,
    density: float = 7.85e-9,
    held: Places | None = None,
    quadratic: bool = False,
) -> Model:
    """Model of bricks between lines along X, Y and Z, and the places (N, 3) of its nodes.

    Nodes are numbered from 1.  ``held`` is True for the places that do not move.
    """
    step = 2 if quadratic else 1
    axes = [np.interp(np.arange(step * (len(a) - 1) + 1) / step, range(len(a)), a) for a in lines]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(places)).reshape([len(a) for a in axes])
    counts = [len(a) - 1 for a in lines]
    nodes = EDGES if quadratic else CORNERS
    away = ((1.0 + nodes) * step / 2).astype(int)
    first = [step * np.array(place) for place in itertools.product(*map(range, counts))]
    bricks = np.array([number[tuple((place + away).T)] for place in first])
    used, bricks = np.unique(bricks, return_inverse=True)
    places, bricks = places[used], bricks.reshape(len(first), len(nodes))
    edges = np.stack(np.meshgrid(*map(np.diff, lines), indexing="ij"), axis=-1).reshape(-1, 3)
    kinds, kind = np.unique(np.round(edges, 12), axis=0, return_inverse=True)
    made = [brick(each, modulus, poisson, density, quadratic) for each in kinds]
    size = 3 * len(nodes)
    dofs = (3 * bricks[:, :, None] + np.arange(3)).reshape(len(bricks), size)
    where = np.repeat(dofs, size, axis=1).ravel(), np.tile(dofs, (1, size)).ravel()
    stiffness, mass = (
        scipy.sparse.csc_array(scipy.sparse.coo_array((np.array(e)[kind.ravel()].ravel(), where)))
        for e in zip(*made, strict=True)
    )
    rows = np.column_stack(
        [np.repeat(np.arange(1, len(places) + 1), 3), np.tile([1, 2, 3], len(places))]
    )
    free = np.ones(len(rows), bool) if held is None else ~np.repeat(held(places), 3)
    stay = np.flatnonzero(free)
    return jb.StiffnessModel(stiffness[stay][:, stay], rows[stay], mass[stay][:, stay]), places


def brick(
    edges: np.ndarray, modulus: float, poisson: float, density: float, quadratic: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and mass (24, 24) of a brick, or (60, 60) with nodes on its edges."""
    shear = modulus / (2.0 * (1.0 + poisson))
    lame = modulus * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    law = np.diag([2.0 * shear] * 3 + [shear] * 3)
    law[:3, :3] += lame
    nodes, powers = (EDGES, SERENDIPITY) if quadratic else (CORNERS, POWERS)
    inverse = np.linalg.inv(np.prod(nodes[:, None] ** powers, axis=2))
    at, weights = np.polynomial.legendre.leggauss(3 if quadratic else 2)
    size = 3 * len(nodes)
    stiffness, mass = np.zeros((size, size)), np.zeros((size, size))
    for which in itertools.product(range(len(at)), repeat=3):
        point, volume = at[list(which)], np.prod(weights[list(which)] * edges / 2.0)
        shape = np.prod(point**powers, axis=1) @ inverse
        slopes = np.zeros((len(nodes), 3))
        for d in range(3):
            lower = np.maximum(powers - np.eye(3, dtype=int)[d], 0)
            slopes[:, d] = 2.0 / edges[d] * (powers[:, d] * np.prod(point**lower, axis=1)) @ inverse
        strain = np.zeros((6, len(nodes), 3))
        for d in range(3):
            strain[d, :, d] = slopes[:, d]
        for row, (a, b) in enumerate(((0, 1), (1, 2), (0, 2)), start=3):
            strain[row, :, a], strain[row, :, b] = slopes[:, b], slopes[:, a]
        b_matrix = strain.reshape(6, size)
        stiffness += volume * b_matrix.T @ law @ b_matrix
        n_matrix = np.kron(shape, np.eye(3))
        mass += density * volume * n_matrix.T @ n_matrix
    return stiffness, mass


def side(
    places: np.ndarray, axis: int, value: float, quadratic: bool = False
) -> tuple[np.ndarray, list[list[int]]]:
    """Nodes (k, 4) and elements of the side of a box, corners in turn and then edges."""
    on_side = np.flatnonzero(np.isclose(places[:, axis], value))
    ranks, counts = [], []
    for way in (way for way in range(3) if way != axis):
        line, rank = np.unique(np.round(places[on_side, way], 9), return_inverse=True)
        ranks.append(rank if quadratic else 2 * rank)
        counts.append((len(line) - 1) // (2 if quadratic else 1))
    tree = dict(zip(zip(*map(np.ravel, ranks), strict=True), on_side, strict=True))
    around = [(0, 0), (2, 0), (2, 2), (0, 2)]
    around += [(1, 0), (2, 1), (1, 2), (0, 1)] if quadratic else []
    first = itertools.product(*map(range, counts))
    elements = [[1 + tree[2 * i + a, 2 * j + b] for a, b in around] for i, j in first]
    return np.column_stack([on_side + 1, places[on_side]]), elements


SIZES = (60.0, 30.0, 15.0)


def two_blocks(
    upper: Sequence[int],
    lower: Sequence[int] | None = None,
    quadratic: bool = False,
    sizes: Sequence[float] = SIZES,
    way: int = 1,
    patch: float = np.inf,
) -> tuple[jb.Substructure, jb.Substructure]:
    """Block on another one that is held below, pressed by 1 over its top and pulled at its end.

    ``upper`` and ``lower`` are bricks along, across and through each; the lower ones are the upper
    ones if left out.  The pull is along X (1) or Y (2).  A patch, its radius over the sizes, is
    pressed by a paraboloid, instead of all of the top evenly.
    """
    lower = upper if lower is None else lower
    height = sizes[2]
    model, places = box(upper, sizes, quadratic=quadratic)
    on = {"quadratic": quadratic}
    top, tops = side(places, 2, height, **on)
    end, ends = side(places, 0, sizes[0], **on)
    face, elements = side(places, 2, 0.0, **on)
    press, pull = (jb.face_surface(*a).areas for a in ((top, tops), (end, ends)))
    away = (top[:, 1:3] / sizes[:2] - 0.5) / patch
    press = press * np.maximum(1.0 - np.sum(away**2, axis=1), 0.0)
    above = model.condensed(
        face,
        elements=elements,
        press=[np.column_stack([top[:, 0], np.full(len(top), 3), -press / np.sum(press)])],
        pull=np.column_stack([end[:, 0], np.full(len(end), way), pull / np.sum(pull)]),
    )
    model, places = box(
        lower,
        sizes,
        at=(0.0, 0.0, -height),
        held=lambda places: places[:, 2] == -height,
        quadratic=quadratic,
    )
    face, elements = side(places, 2, 0.0, **on)
    nothing = [[int(face[0, 0]), 3, 0.0]]
    return above, model.condensed(face, elements=elements, press=[nothing])

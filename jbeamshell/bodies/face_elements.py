"""Elements of a face: triangles and quadrilaterals, linear and quadratic.

The nodes of an element are its corners in turn, then the middles of its edges in turn, the first
between corners 1 and 2, then the middle of a quadrilateral of 9 nodes.  On a quadrilateral u and v
go from -1 to 1, on a triangle from 0 to 1 (Zienkiewicz and Taylor 2000, chapter 8).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

CORNERS = {3: 3, 4: 4, 6: 3, 8: 4, 9: 4}  # by the number of nodes
SQUARE = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (0, 1), (-1, 0), (0, 0)])
TRIANGLE = np.array([(0, 0), (1, 0), (0, 1), (0.5, 0), (0.5, 0.5), (0, 0.5)])
PLACES = {n: (TRIANGLE if corners == 3 else SQUARE)[:n] for n, corners in CORNERS.items()}
# Powers of u and v whose sums the shape functions are.
POWERS = {
    3: [(0, 0), (1, 0), (0, 1)],
    4: [(0, 0), (1, 0), (0, 1), (1, 1)],
    6: [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)],
    8: [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (2, 1), (1, 2)],
    9: [(a, b) for a in range(3) for b in range(3)],
}


def _coefficients(nodes: int) -> Vector:
    powers = np.array(POWERS[nodes])
    return np.linalg.inv(np.prod(PLACES[nodes][:, None, :] ** powers, axis=2))


COEFFICIENTS = {nodes: _coefficients(nodes) for nodes in CORNERS}


def shapes(nodes: int, at: Vector) -> tuple[Vector, Vector]:
    """Shape functions (k, nodes) at places u, v (k, 2), and their slopes (k, nodes, 2)."""
    powers = np.array(POWERS[nodes])
    values = np.prod(at[:, None, :] ** powers, axis=2)
    slopes = []
    for way in (0, 1):
        lower = np.maximum(powers - np.eye(2, dtype=int)[way], 0)
        slopes.append(powers[:, way] * np.prod(at[:, None, :] ** lower, axis=2))
    every = np.stack(slopes, axis=2)
    coefficients = COEFFICIENTS[nodes]
    return values @ coefficients, np.einsum("kpw,pn->knw", every, coefficients)


class Rule(NamedTuple):
    """Points u, v (k, 2) of an element's quadrature, and their weights (k,)."""

    points: Vector
    weights: Vector


def _square(count: int) -> Rule:
    at, weights = np.polynomial.legendre.leggauss(count)
    u, v = np.meshgrid(at, at, indexing="ij")
    return Rule(np.column_stack([u.ravel(), v.ravel()]), np.outer(weights, weights).ravel())


def _triangle(orbits: list[tuple[float, float]]) -> Rule:
    """Rule of orbits of three points: their barycentric coordinate and the weight of each."""
    points, weights = [], []
    for near, weight in orbits:
        far = 1.0 - 2.0 * near
        points += [(near, near), (far, near), (near, far)]
        weights += [0.5 * weight] * 3
    return Rule(np.array(points), np.array(weights))


# Exact for polynomials of the degrees 2 and 4 on a triangle (Dunavant 1985), 3 and 5 on a square.
THREE = _triangle([(1.0 / 6.0, 1.0 / 3.0)])
SIX = _triangle([(0.445948490915965, 0.223381589678011), (0.091576213509771, 0.109951743655322)])
RULES = {3: THREE, 4: _square(2), 6: SIX, 8: _square(3), 9: _square(3)}


class Spots(NamedTuple):
    """Places on one element.

    Attributes
    ----------
    values : (k, nodes) shape functions
    places : (k, 3)
    normals : (k, 3) normals, as long as the element is large per u and v
    """

    values: Vector
    places: Vector
    normals: Vector


def spots(corners: Vector, at: Vector) -> Spots:
    """Places on an element with nodes at (nodes, 3)."""
    values, slopes = shapes(len(corners), at)
    along, across = (slopes[:, :, way] @ corners for way in (0, 1))
    return Spots(values, values @ corners, np.cross(along, across))

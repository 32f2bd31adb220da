"""Coarser meshes of faces, which show what a mesh is worth.

About every second node in both directions stays.  The displacements of the others follow by linear
interpolation on the triangles of those that stay, so that the bodies are held to what a mesh of
twice the size could do.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, Delaunay, QhullError, cKDTree

from jbeamshell.bodies.contact_input import Problem
from jbeamshell.bodies.substructure import Substructure, frames_of
from jbeamshell.common.checks import is_traced

APART = 1.5  # of the way to a node's next neighbour, within which no other one stays
FEW = 9  # nodes, below which a mesh has no coarser one
ROUND = 0.5  # length of the mean normal, below which a face has no plane to draw it in

Vector = NDArray[np.float64]


def coarser(problem: Problem) -> tuple[Vector, ...] | None:
    """For each body, displacements (3n, 3n) of its nodes from those that stay, else zero.

    None where a mesh has too few nodes, or is too round to be drawn in a plane.
    """
    upper, lower, face = problem.upper, problem.lower, problem.face
    bodies = [upper, upper if face is not None and face.pairs else lower]
    if is_traced([(body.places, body.normals) for body in bodies if body is not None]):
        return None
    found = [_interpolation(body) for body in bodies if body is not None]
    kept = [part for part in found if part is not None]
    if len(kept) < len(found):
        return None
    wholes = [body for body in (upper, lower) if body is not None]
    return tuple(
        np.where(np.array(body.fixed)[:, None], 0.0, part)
        for body, part in zip(wholes, kept, strict=False)
    )


def _interpolation(body: Substructure) -> Vector | None:
    """Displacements (3n, 3n) of the nodes from those that stay, in their frames."""
    places, normals = np.asarray(body.places), np.asarray(body.normals)
    mean = np.mean(normals, axis=0)
    length = float(np.linalg.norm(mean))
    if len(places) < FEW or length < ROUND:
        return None
    flat = places @ frames_of(mean[None] / length)[0][:2].T
    try:
        kept = _kept(flat)
        triangles = Delaunay(flat[kept])
    except QhullError:  # all on a line
        return None
    shares, frames = np.zeros((len(places), len(places))), body.frames
    shares[:, kept] = _linear(triangles, flat)
    turned = np.einsum("nix,kjx->nikj", frames, frames)
    return (shares[:, None, :, None] * turned).reshape(3 * len(places), 3 * len(places))


def _kept(flat: Vector) -> NDArray[np.int64]:
    """Nodes that stay, those on the rim first."""
    tree, hull = cKDTree(flat), ConvexHull(flat)
    spacing = tree.query(flat, 2)[0][:, 1]
    inside = np.min(-(flat @ hull.equations[:, :2].T + hull.equations[:, 2]), axis=1)
    rim = inside < 0.5 * np.min(spacing)
    middle = np.mean(flat, axis=0)
    angle = np.arctan2(*(flat - middle).T)
    order = [*hull.vertices, *np.flatnonzero(rim)[np.argsort(angle[rim])]]
    order += np.flatnonzero(~rim)[np.argsort(inside[~rim], kind="stable")].tolist()
    stays, gone = [], np.zeros(len(flat), bool)
    for node in dict.fromkeys(order):
        if not gone[node]:
            stays.append(node)
            gone[tree.query_ball_point(flat[node], APART * spacing[node])] = True
    return np.array(sorted(stays))


def _linear(triangles: Delaunay, flat: Vector) -> Vector:
    """Shares (n, k) of the corners in places (n, 2), by linear functions on triangles."""
    at = triangles.find_simplex(flat, tol=1e-6)
    middles = np.mean(triangles.points[triangles.simplices], axis=1)
    outside = at < 0
    at[outside] = cKDTree(middles).query(flat[outside])[1]
    turn = triangles.transform[at]
    first = np.einsum("nij,nj->ni", turn[:, :2], flat - turn[:, 2])
    shares = np.zeros((len(flat), len(triangles.points)))
    rows = np.arange(len(flat))[:, None]
    shares[rows, triangles.simplices[at]] = np.column_stack([first, 1.0 - np.sum(first, axis=1)])
    return shares

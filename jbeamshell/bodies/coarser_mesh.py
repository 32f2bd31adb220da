"""Coarser meshes of faces, which show what a mesh is worth.

About every second node in both directions stays.  The displacements of the others follow by linear
interpolation on the triangles of those that stay, so that the bodies are held to what a mesh of
twice the size could do.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, Delaunay, QhullError, cKDTree

from jbeamshell.bodies.contact_input import Problem
from jbeamshell.bodies.contact_points import in_order
from jbeamshell.bodies.substructure import Substructure, frames_of

APART = 1.5  # of the way to a node's next neighbour, within which no other one stays
FEW = 9  # nodes, below which a mesh has no coarser one
ROUND = 0.5  # length of the mean normal, below which a face has no plane to draw it in

Vector = NDArray[np.float64]


class Coarser(NamedTuple):
    """Coarser mesh of a body's face.

    Attributes
    ----------
    kept : (c,) nodes that stay
    near : (n, 3) places of such nodes in ``kept``, whose displacements each node follows
    parts : (n, 3, 3, 3) its displacements from theirs, in the frames of both
    """

    kept: NDArray[np.int64]
    near: NDArray[np.int64]
    parts: Vector

    @property
    def moves(self) -> Vector:
        """Displacements (3n, 3c) of all nodes from those of the nodes that stay."""
        n, c = len(self.near), len(self.kept)
        found = np.zeros((n, c, 3, 3))
        np.add.at(found, (np.arange(n)[:, None], self.near), self.parts)
        return found.swapaxes(1, 2).reshape(3 * n, 3 * c)

    def shares(self, nodes: NDArray[np.int64], shares: Vector) -> tuple[NDArray[np.int64], Vector]:
        """Nodes (q, r) that stay, and shares (q, r, 3, 3) of points, from (q, k) and (q, k, 3, 3).

        A row with fewer nodes than others repeats one, with no share.
        """
        rows, same = np.unique(nodes, axis=0, return_inverse=True)
        sets = [np.unique(self.near[row]) for row in rows]
        most = max(map(len, sets))
        wide = np.array([np.pad(each, (0, most - len(each)), "edge") for each in sets])
        near = self.near[nodes]  # (q, k, 3)
        wide = wide[same.ravel()]
        place = np.argmax(near[..., None] == wide[:, None, None, :], axis=-1)
        found = np.zeros((*wide.shape, 3, 3))
        each = shares[:, :, None] @ self.parts[nodes]
        np.add.at(found, (np.arange(len(nodes))[:, None, None], place), each)
        return wide, found


def coarser(problem: Problem) -> tuple[Coarser, ...] | None:
    """Coarser mesh of each body; None where one has too few nodes, or is too round for a plane.

    Nodes that supports hold stay.
    """
    upper, lower, face = problem.upper, problem.lower, problem.face
    bodies = [body for body in (upper, lower) if body is not None]
    held: list[Any] = [np.any(np.reshape(body.fixed, (-1, 3)), axis=1) for body in bodies]
    if face is not None and face.pairs and lower is not None:  # of one mesh, which the upper one is
        order = in_order(lower, face)
        held = [held[0] | held[1][order]] * 2
        bodies = [upper, upper]
    found = [coarser_of_body(body, stays) for body, stays in zip(bodies, held, strict=True)]
    kept = tuple(mesh for mesh in found if mesh is not None)
    return None if len(kept) < len(found) else kept


def coarser_of_body(body: Substructure, held: NDArray[np.bool_]) -> Coarser | None:
    """Coarser mesh of a body whose held nodes (n,) stay."""
    places, normals = np.asarray(body.places), np.asarray(body.normals)
    mean = np.mean(normals, axis=0)
    length = float(np.linalg.norm(mean))
    if len(places) < FEW or length < ROUND:
        return None
    flat = places @ frames_of(mean[None] / length)[0][:2].T
    try:
        kept = _kept(flat, held)
        triangles = Delaunay(flat[kept])
    except QhullError:  # all on a line
        return None
    near, shares = _linear(triangles, flat)
    frames = body.frames
    turned = np.einsum("nix,nkjx->nkij", frames, frames[kept[near]])
    return Coarser(kept, near, shares[:, :, None, None] * turned)


def _kept(flat: Vector, held: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Nodes that stay: those that are held, then those on the rim, then others."""
    tree, hull = cKDTree(flat), ConvexHull(flat)
    spacing = tree.query(flat, 2)[0][:, 1]
    inside = np.min(-(flat @ hull.equations[:, :2].T + hull.equations[:, 2]), axis=1)
    rim = inside < 0.5 * np.min(spacing)
    middle = np.mean(flat, axis=0)
    angle = np.arctan2(*(flat - middle).T)
    order = [*hull.vertices, *np.flatnonzero(rim)[np.argsort(angle[rim])]]
    order += np.flatnonzero(~rim)[np.argsort(inside[~rim], kind="stable")].tolist()
    stays, gone = [], np.zeros(len(flat), bool)
    for node in dict.fromkeys([*np.flatnonzero(held), *order]):
        if held[node] or not gone[node]:
            stays.append(node)
            gone[tree.query_ball_point(flat[node], APART * spacing[node])] = True
    return np.array(sorted(stays))


def _linear(triangles: Delaunay, flat: Vector) -> tuple[NDArray[np.int64], Vector]:
    """Corners (n, 3) around places (n, 2), and their linear shape functions (n, 3) there."""
    at = triangles.find_simplex(flat, tol=1e-6)
    middles = np.mean(triangles.points[triangles.simplices], axis=1)
    outside = at < 0
    at[outside] = cKDTree(middles).query(flat[outside])[1]
    turn = triangles.transform[at]
    first = np.einsum("nij,nj->ni", turn[:, :2], flat - turn[:, 2])
    shares = np.column_stack([first, 1.0 - np.sum(first, axis=1)])
    return triangles.simplices[at].astype(np.int64), shares

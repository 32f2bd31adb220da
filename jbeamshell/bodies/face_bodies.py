"""Bodies on the contact points of their face."""

from __future__ import annotations

import functools
from typing import NamedTuple

import jax
import numpy as np
from jax import Array
from numpy.typing import NDArray

from jbeamshell.bodies.coarser_mesh import Coarser
from jbeamshell.bodies.contact_input import Problem
from jbeamshell.bodies.contact_points import ContactPoints, in_order
from jbeamshell.bodies.face import Face
from jbeamshell.bodies.face_law import Points
from jbeamshell.bodies.face_springs import Side, Sprung, sprung
from jbeamshell.bodies.joined import grounded, potential_of
from jbeamshell.bodies.substructure import Substructure, frames_of
from jbeamshell.common.checks import is_traced, require
from jbeamshell.common.numbers_of import numbers_of
from jbeamshell.common.small import Small, always
from jbeamshell.contact_line.pair import together


class Bodies(NamedTuple):
    """Bodies on their face.

    Attributes
    ----------
    face : their face
    softness : (q,) normal displacement per force of the springs that stand for the bodies
    held : (q, 3) True for displacements of points that supports on both sides hold
    """

    face: Face
    softness: Array
    held: Array


class Part(NamedTuple):
    """One of the bodies on a face.

    Attributes
    ----------
    potential : (3n + m, 3n + m) second derivatives of its potential, in nodes and loads
    side : its contact points
    coarse : (3n, 3c) displacements of its nodes from those of a coarser mesh; None has all nodes
    seen : its points on the nodes that it has
    """

    potential: Array
    side: Side
    coarse: NDArray[np.float64] | None
    seen: Side


def bodies_of(problem: Problem, coarse: tuple[Coarser, ...] | None = None) -> Bodies:
    """Bodies of a problem, joined.

    Parameters
    ----------
    problem : contact of bodies on a face
    coarse : of each body, the coarser mesh that it has instead
    """
    upper, lower, made = problem.upper, problem.lower, problem.face
    assert made is not None
    if lower is not None and not is_traced(upper, lower):
        lower = grounded(upper, lower)
    bodies = [body for body in (upper, lower) if body is not None]
    count = max(body.forces.shape[1] for body in bodies)
    parts, fixed, held = [], [], []
    for i, body in enumerate(bodies):
        potential, frames, stays = potential_of(body, count), body.frames, np.array(body.fixed)
        if made.pairs and i:
            order = in_order(body, made)
            rows = (3 * order[:, None] + np.arange(3)).ravel()
            frames, stays = frames[order], stays[rows]
            rows = np.append(rows, np.arange(rows.size, len(potential)))
            potential = potential[rows[:, None], rows]
        side = side_of(made, frames, bool(i))
        part = Part(potential, side, None, side)
        fixed.append(tuple(stays.tolist()))
        if coarse is not None:
            moves = np.where(stays[:, None], 0.0, coarse[i].moves)
            nodes, shares = coarse[i].shares(side.nodes, side.shares)
            part = part._replace(coarse=moves, seen=side._replace(nodes=nodes, shares=shares))
            stays = stays.reshape(-1, 3)[coarse[i].kept].ravel()
        parts.append(part)
        held.append(tuple(stays.tolist()))
    numbers = problem.friction, problem.gap, problem.roughness, problem.softness
    group = _group([part.seen.nodes for part in parts])
    found: Bodies = _assembled((parts, numbers), (tuple(fixed), tuple(held)), made.pairs, group)
    if problem.control == "displacement":
        soft = found.face.flexibility[0, 0]
        fix = "the pulled nodes are in the contact: take control='force'"
        require("control", "displacement", is_traced(soft) or bool(soft > 0.0), fix)
    return found


class Stiffer(NamedTuple):
    """Springs of contact points, and the stiffness that they add to the bodies between them.

    Attributes
    ----------
    bodies : for each body, (3n, 3n) stiffness on the nodes of its face, by which it is stiffer
    shares : for each body, (q, k, 3, 3) and the nodes (q, k) of its points
    springs : (q, 3) stiffness of the points
    """

    bodies: list[NDArray[np.float64]]
    shares: list[tuple[NDArray[np.int64], NDArray[np.float64]]]
    springs: NDArray[np.float64]


def stiffer(upper: Substructure, lower: Substructure | None, made: ContactPoints) -> Stiffer:
    """Springs of contact points between bodies, and these without what the springs give way by."""
    bodies = [body for body in (upper, lower) if body is not None]
    count = max(body.forces.shape[1] for body in bodies)
    sides, more = [], []
    soft = np.zeros((made.areas.size, 2))
    for body, shares in zip(bodies, (made.upper, made.lower), strict=False):
        assert shares is not None
        side = side_of(made._replace(upper=shares, pairs=True), body.frames, False)
        size, potential = 3 * body.places.shape[0], jax.device_get(potential_of(body, count))
        part = sprung(potential, side, np.array(body.fixed))
        added = np.asarray(part.hessian[:size, :size]) - np.asarray(body.stiffness)
        held = np.array(body.fixed)
        more.append(np.where(held | held[:, None], 0.0, added))
        sides.append((np.asarray(side.nodes), np.asarray(side.shares)))
        soft = soft + np.asarray(part.softness)
    return Stiffer(more, sides, 1.0 / np.asarray(soft)[:, [0, 0, 1]])


@functools.partial(Small, level=0, by_numpy=always)
def _assembled(
    inputs: tuple[list[Part], tuple[Array, ...]],
    supports: tuple[tuple[tuple[bool, ...], ...], ...],
    pairs: bool,
    group: int,
) -> Bodies:
    """Bodies and the law of their points.

    Parameters
    ----------
    inputs : bodies; friction, gap, roughness and softness
    supports : displacements of each body that a support holds, of all its nodes and of those that
        it has
    pairs : True if the nodes match one by one
    group : number of points that share their nodes, one after the other
    """
    parts, (friction, gap, roughness, softness) = inputs
    xp = numbers_of(inputs)
    fixed, held = ([np.array(each) for each in both] for both in supports)
    found = [
        sprung(part.potential, part.side, stays, part.coarse)
        for part, stays in zip(parts, fixed, strict=True)
    ]
    hessian, nodes, shares, stays = _joined(found, [part.seen for part in parts], held, pairs)
    size = stays.size
    stiffness = xp.where(stays | stays[:, None], 0.0, hessian[:size, :size])
    stiffness += xp.diag(xp.where(stays, xp.max(stiffness), 0.0))
    loads = xp.where(stays[:, None], 0.0, -hessian[:size, size:])
    shares = xp.where(xp.asarray(stays.reshape(-1, 3))[nodes][:, :, None], 0.0, shares)
    soft = functools.reduce(xp.add, (part.softness for part in found))
    points = Points(
        friction=xp.broadcast_to(friction, gap.shape),
        gap=gap,
        roughness=roughness,
        springs=1.0 / (soft + softness),
    )
    shares = shares.reshape(-1, group, *shares.shape[1:])
    face = Face(
        stiffness=stiffness,
        loads=loads,
        flexibility=-hessian[size:, size:],
        places=(3 * nodes[::group, :, None] + np.arange(3)).reshape(len(shares), -1),
        shares=shares.transpose(0, 1, 3, 2, 4).reshape(len(shares), 3 * group, -1),
        points=points,
    )
    return Bodies(face, soft[:, 1], xp.all(face.shares == 0.0, axis=2).reshape(-1, 3))


def _group(sides: list[NDArray[np.int64]]) -> int:
    """Number of points that share their nodes (q, k), one after the other, all over the face."""
    nodes = np.concatenate(sides, axis=1)
    begins = np.flatnonzero(np.append(True, np.any(np.diff(nodes, axis=0) != 0, axis=1)))
    return int(np.gcd.reduce(np.diff(np.append(begins, len(nodes)))))


def _joined(
    parts: list[Sprung], sides: list[Side], fixed: list[np.ndarray], pairs: bool
) -> tuple[Array, Array, Array, np.ndarray]:
    """Potential of all bodies, nodes of the points, their shares, and what supports hold."""
    first, hessian = sides[0], parts[0].hessian
    if len(parts) == 1:
        return hessian, first.nodes, first.shares, fixed[0]
    xp, second, other = numbers_of(parts, sides), sides[1], parts[1].hessian
    if pairs:  # the relative displacement is that of the upper nodes
        hessian = together(hessian, other, *fixed)[0]
        return hessian, first.nodes, first.shares, fixed[0] & fixed[1]
    a, b = (each.size for each in fixed)
    loads = xp.concatenate([hessian[:a, a:], other[:b, b:]])
    none = np.zeros((a, b))
    hessian = xp.concatenate(
        [
            xp.concatenate([hessian[:a, :a], none, hessian[:a, a:]], axis=1),
            xp.concatenate([none.T, other[:b, :b], other[:b, b:]], axis=1),
            xp.concatenate([loads.T, hessian[a:, a:] + other[b:, b:]], axis=1),
        ]
    )
    nodes = xp.concatenate([first.nodes, a // 3 + second.nodes], axis=1)
    shares = xp.concatenate([first.shares, -second.shares], axis=1)
    return hessian, nodes, shares, np.concatenate(fixed)


def side_of(made: ContactPoints, frames: NDArray[np.float64], below: bool) -> Side:
    """Contact points on one body, the frames (n, 3, 3) of whose nodes are given."""
    shares = made.lower if below and not made.pairs else made.upper
    assert shares is not None
    if made.elements is None:  # node by node, in the nodes' own frames
        turned = np.broadcast_to(np.eye(3), (*shares.values.shape, 3, 3))
    else:
        turned = np.einsum("qix,qkjx->qkij", frames_of(made.normals), frames[shares.nodes])
    return Side(
        nodes=shares.nodes,
        values=shares.values,
        shares=shares.values[:, :, None, None] * turned,
        areas=made.areas,
    )

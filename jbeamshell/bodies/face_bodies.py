"""Bodies on the contact points of their face."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from jbeamshell.bodies.contact_input import Problem
from jbeamshell.bodies.contact_points import ContactPoints
from jbeamshell.bodies.face_law import Points
from jbeamshell.bodies.face_springs import Side, Sprung, sprung
from jbeamshell.bodies.face_step import Face
from jbeamshell.bodies.joined import grounded, potential_of
from jbeamshell.bodies.substructure import Substructure, frames_of
from jbeamshell.common.checks import is_traced, require
from jbeamshell.common.small import Small
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


def bodies_of(problem: Problem, coarse: tuple[NDArray[np.float64], ...] | None = None) -> Bodies:
    """Bodies of a problem, joined.

    Parameters
    ----------
    problem : contact of bodies on a face
    coarse : for each body, displacements of its nodes from those of a coarser mesh
    """
    upper, lower, made = problem.upper, problem.lower, problem.face
    assert made is not None
    if lower is not None:
        if made.pairs:
            lower = _in_order(lower, made)
        if not is_traced(upper, lower):
            lower = grounded(upper, lower)
    bodies = [body for body in (upper, lower) if body is not None]
    sides = [side_of(made, body, below) for body, below in zip(bodies, (False, True), strict=False)]
    free = [np.eye(3 * body.places.shape[0]) for body in bodies]
    given = bodies, sides, free if coarse is None else list(coarse)
    count = max(body.forces.shape[1] for body in bodies)
    numbers = problem.friction, problem.gap, problem.roughness, problem.softness
    found = _assembled((given, numbers), count, made.pairs, _group(made))
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
        side = side_of(made._replace(upper=shares, pairs=True), body, False)
        size = 3 * body.places.shape[0]
        part = _sprung((body, side, np.eye(size)), count)
        added = np.asarray(part.hessian[:size, :size]) - np.asarray(body.stiffness)
        held = np.array(body.fixed)
        more.append(np.where(held | held[:, None], 0.0, added))
        sides.append((np.asarray(side.nodes), np.asarray(side.shares)))
        soft = soft + np.asarray(part.softness)
    return Stiffer(more, sides, 1.0 / np.asarray(soft)[:, [0, 0, 1]])


@functools.partial(Small, level=0)
def _sprung(inputs: tuple[Substructure, Side, Array], count: int) -> Sprung:
    body, side, free = inputs
    return sprung(potential_of(body, count), side, np.array(body.fixed), free)


def _group(made: ContactPoints) -> int:
    """Number of points that share their nodes, one after the other, the same all over the face."""
    sides = [made.upper] if made.lower is None else [made.upper, made.lower]
    rows = np.concatenate([side.nodes for side in sides], axis=1)
    begins = np.flatnonzero(np.append(True, np.any(np.diff(rows, axis=0) != 0, axis=1)))
    sizes = np.diff(np.append(begins, len(rows)))
    return int(np.gcd.reduce(sizes))


@functools.partial(Small, level=0)
def _assembled(
    inputs: tuple[tuple[list[Substructure], list[Side], list[Any]], tuple[Array, ...]],
    count: int,
    pairs: bool,
    group: int,
) -> Bodies:
    """Bodies and the law of their points."""
    (bodies, sides, coarse), numbers = inputs
    friction, gap, roughness, softness = numbers
    fixed = [np.array(body.fixed) for body in bodies]
    parts = [
        sprung(potential_of(body, count), side, stays, onto)
        for body, side, stays, onto in zip(bodies, sides, fixed, coarse, strict=False)
    ]
    hessian, nodes, shares, held = _joined(parts, sides, fixed, pairs)
    size = held.size
    stiffness = jnp.where(held | held[:, None], 0.0, hessian[:size, :size])
    stiffness += jnp.diag(jnp.where(held, jnp.max(stiffness), 0.0))
    loads = jnp.where(held[:, None], 0.0, -hessian[:size, size:])
    shares = jnp.where(jnp.asarray(held.reshape(-1, 3))[nodes][:, :, None], 0.0, shares)
    soft = functools.reduce(jnp.add, (part.softness for part in parts))
    q = soft.shape[0]
    stays = jnp.all(jnp.abs(shares) == 0.0, axis=(1, 3))
    points = Points(
        friction=jnp.broadcast_to(friction, (q,)),
        gap=gap,
        roughness=roughness,
        springs=1.0 / (soft + softness),
    )
    nodes = nodes.reshape(-1, group, nodes.shape[1])[:, 0]
    face = Face(stiffness, loads, -hessian[size:, size:], nodes, shares, points)
    return Bodies(face, soft[:, 1], stays)


def _joined(
    parts: list[Sprung], sides: list[Side], fixed: list[np.ndarray], pairs: bool
) -> tuple[Array, Array, Array, np.ndarray]:
    """Potential of all bodies, nodes of the points, their shares, and what supports hold."""
    first = sides[0]
    if len(parts) == 1:
        return parts[0].hessian, first.nodes, first.shares, fixed[0]
    second = sides[1]
    if pairs:  # the relative displacement is that of the upper nodes
        hessian = together(parts[0].hessian, parts[1].hessian, *fixed)[0]
        return hessian, first.nodes, first.shares, fixed[0] & fixed[1]
    a, b = (each.size for each in fixed)
    one, other = parts[0].hessian, parts[1].hessian
    loads = jnp.concatenate([one[:a, a:], other[:b, b:]])
    stiffness = jax.scipy.linalg.block_diag(one[:a, :a], other[:b, :b])
    hessian = jnp.block([[stiffness, loads], [loads.T, one[a:, a:] + other[b:, b:]]])
    nodes = jnp.concatenate([first.nodes, a // 3 + second.nodes], axis=1)
    shares = jnp.concatenate([first.shares, -second.shares], axis=1)
    return hessian, nodes, shares, np.concatenate(fixed)


def side_of(made: ContactPoints, body: Substructure, below: bool) -> Side:
    """Nodes of the points on one body."""
    shares = made.lower if below and not made.pairs else made.upper
    assert shares is not None
    if made.elements is None:  # node by node, in the nodes' own frames
        turned = np.broadcast_to(np.eye(3), (*shares.values.shape, 3, 3))
    else:
        own = body.frames[shares.nodes]
        turned = np.einsum("qix,qkjx->qkij", frames_of(made.normals), own)
    return Side(
        nodes=shares.nodes,
        values=shares.values,
        shares=shares.values[:, :, None, None] * turned,
        areas=made.areas,
    )


def _in_order(lower: Substructure, made: ContactPoints) -> Substructure:
    """Lower body with its nodes in the order of the upper ones."""
    assert made.lower is not None
    order = np.arange(lower.places.shape[0])
    order[made.upper.nodes] = made.lower.nodes
    if np.array_equal(order, np.arange(len(order))):
        return lower
    rows = (3 * order[:, None] + np.arange(3)).ravel()
    return Substructure(
        lower.places[order],
        lower.stiffness[rows][:, rows],
        lower.forces[rows],
        lower.flexibility,
        normals=None if lower.normals is None else lower.normals[order],
        fixed=np.array(lower.fixed)[rows].tolist(),
    )

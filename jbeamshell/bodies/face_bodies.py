"""Bodies on the contact points of their face."""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
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


def bodies_of(
    problem: Problem, coarse: tuple[NDArray[np.float64], ...] | None = None
) -> Bodies:
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
    sides = [_side(made, body, below) for body, below in zip(bodies, (False, True), strict=False)]
    given = bodies, sides, coarse or (None, None)
    count = max(body.forces.shape[1] for body in bodies)
    numbers = problem.friction, problem.gap, problem.roughness, problem.softness
    found = _assembled(given, numbers, count, made.pairs)
    if problem.control == "displacement":
        soft = found.face.flexibility[0, 0]
        fix = "the pulled nodes are in the contact: take control='force'"
        require("control", "displacement", is_traced(soft) or bool(soft > 0.0), fix)
    return found


@eqx.filter_jit
def _assembled(
    given: tuple[list[Substructure], list[Side], tuple[Array | None, ...]],
    numbers: tuple[Array, ...],
    count: int,
    pairs: bool,
) -> Bodies:
    """Bodies and the law of their points."""
    bodies, sides, coarse = given
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
    soft = sum(part.softness for part in parts)
    q = soft.shape[0]
    stays = jnp.all(jnp.abs(shares) == 0.0, axis=(1, 3))
    points = Points(
        friction=jnp.broadcast_to(friction, (q,)),
        gap=gap,
        roughness=roughness,
        springs=1.0 / (soft + softness),
    )
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


def _side(made: ContactPoints, body: Substructure, below: bool) -> Side:
    """Nodes of the points on one body."""
    shares = made.lower if below and not made.pairs else made.upper
    assert shares is not None
    if made.elements is None:  # node by node, in the nodes' own frames
        turned = np.broadcast_to(np.eye(3), (*shares.values.shape, 3, 3))
    else:
        own = body.frames[shares.nodes]
        turned = np.einsum("qix,qkjx->qkij", frames_of(made.normals), own)
    return Side(
        nodes=np.asarray(shares.nodes),
        values=np.asarray(shares.values),
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

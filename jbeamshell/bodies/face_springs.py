"""Springs of contact points, and bodies without what these springs give way by.

A mesh has more contact points than nodes, and on rigid points friction and contact would not be
solvable.  The points therefore lie on springs with the displacement S per traction.  Bodies on
nodes with a flexibility F and shape functions B at the points become

    B F B' + S - B G B',    G = (B' S^-1 B)^-1,

so that tractions that the shape functions can follow meet the body's own flexibility alone: an even
pressure and stuck points give way as they do in the mesh.  What is left of S is the flexibility of
tractions that change within an element, of which the mesh knows nothing.  With S a half of what the
nodes' shortest wave has, it is about that of a half-space under such tractions.  Where the points
are the nodes, nothing is left of S, and the contact is rigid.  The bodies that this takes are

    K~ = (F - G)^-1 = K + K (G^-1 - K)^-1 K,    f~ = f + K (G^-1 - K)^-1 f.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.numerics.factors import inverse_cholesky, solve

PART = 0.5  # of the flexibility of the nodes' shortest wave, that lies in the springs
WAVES = 40  # iterations for the shortest wave; `PART` leaves room for what they miss
EVEN = 0.05  # least spring over the largest one, below which all points have the same
HELD = 1e2  # stiffness of what a coarser mesh cannot do, over the largest of the body


class Side(NamedTuple):
    """Nodes of the contact points on one body.

    Attributes
    ----------
    nodes, values : (q, k) nodes of each point, and their shape functions
    shares : (q, k, 3, 3) the same in the frames of nodes and points
    areas : (q,)
    """

    nodes: Any
    values: Any
    shares: Any
    areas: Any


class Sprung(NamedTuple):
    """Body on the springs of its points.

    Attributes
    ----------
    hessian : (3n + m, 3n + m) second derivatives of the body's potential, without the springs
    softness : (q, 2) displacement per force of the springs, tangential and normal
    """

    hessian: Array
    softness: Array


def sprung(hessian: Array, side: Side, fixed: np.ndarray, coarse: Array) -> Sprung:
    """Body on springs.

    Parameters
    ----------
    hessian : (3n + m, 3n + m) second derivatives of the body's potential, in nodes and loads
    side : its contact points
    fixed : (3n,) True for displacements that a support holds
    coarse : (3n, 3n) displacements of the nodes from those that stay in a coarser mesh, to which
        the body is held, its other columns zero; of a body that is free, the unit matrix
    """
    size, crossed = fixed.size, fixed | fixed[:, None]
    k = jnp.where(crossed, 0.0, hessian[:size, :size])
    f = jnp.where(fixed[:, None], 0.0, -hessian[:size, size:])
    per_area = _shape(k, side)
    springs = (side.areas[:, None] / per_area)[:, np.array([0, 0, 1])]
    each = jnp.einsum("qkia,qi,qlib->qkalb", side.shares, springs, side.shares)
    places = 3 * side.nodes[:, :, None] + np.arange(3)
    rows = jnp.broadcast_to(places[:, :, :, None, None], each.shape)
    columns = jnp.broadcast_to(places[:, None, None], each.shape)
    h = jnp.zeros((size, size)).at[rows, columns].add(each)
    alone = np.diag(fixed.astype(float)) * jnp.max(h)
    h = jnp.where(crossed, 0.0, h) + alone
    lost = jnp.diag(jnp.all(coarse == 0.0, axis=0).astype(float))
    k, f = coarse.T @ k @ coarse, coarse.T @ f
    h = coarse.T @ h @ coarse
    h += lost * jnp.max(h)
    longest = _shortest_wave(k, h)
    h = h * longest / PART
    inverse = inverse_cholesky(h - k)
    both = inverse @ jnp.column_stack([k, f])
    on_k, on_f = both[:, : len(k)], both[:, len(k) :]
    k, f = k + on_k.T @ on_k, f + on_k.T @ on_f
    c = -hessian[size:, size:] - on_f.T @ on_f
    onto = solve(coarse.T @ coarse + lost, coarse.T)
    rest = np.eye(size) - coarse @ onto
    k = onto.T @ k @ onto + HELD * jnp.max(k) * rest.T @ rest
    f = onto.T @ f
    found = jnp.block([[k, -f], [-f.T, -c]])
    return Sprung(found, per_area * PART / longest / side.areas[:, None])


def _shape(k: Array, side: Side) -> Array:
    """Displacement per traction (q, 2) of the points, from the nodes' stiffness; up to a factor."""
    own = jnp.diag(k).reshape(-1, 3)
    own = jnp.stack([jnp.max(own[:, :2], axis=1), own[:, 2]], axis=1)
    own = jnp.where(own > 0.0, own, jnp.max(own))
    squares = side.values**2
    share = jnp.zeros(len(own)).at[side.nodes].add(squares * side.areas[:, None])
    share = share * jnp.sum(side.areas) / jnp.sum(share)
    soft = share[:, None] / own
    # Shape functions can follow what the springs give way by under an even pressure.
    found = jnp.einsum("qk,qkw->qw", side.values, soft[side.nodes])
    even = jnp.min(found, axis=0) > EVEN * jnp.max(found, axis=0)
    return jnp.where(even, found, jnp.min(soft, axis=0))


def _shortest_wave(k: Array, h: Array) -> Array:
    """Largest eigenvalue of k over h."""
    inverse = inverse_cholesky(h)
    start = jnp.asarray(np.random.default_rng(0).normal(size=len(k)))

    def step(wave: Array, _: None) -> tuple[Array, None]:
        found = inverse @ (k @ (inverse.T @ wave))
        return found / jnp.linalg.norm(found), None

    wave, _ = lax.scan(step, start, None, length=WAVES)
    wave = inverse.T @ wave
    return (wave @ k @ wave) / (wave @ h @ wave)

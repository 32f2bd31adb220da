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

import numpy as np
import scipy.sparse
from jax import Array

from jbeamshell.common.numbers_of import numbers_of, scan, summed
from jbeamshell.numerics.factors import half_solved, solver

PART = 0.5  # of the flexibility of the nodes' shortest wave, that lies in the springs
WAVES = 40  # iterations for the shortest wave; `PART` leaves room for what they miss
EVEN = 0.05  # least spring over the largest one, below which all points have the same


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
    hessian : (3n + m, 3n + m) second derivatives of the body's potential, without the springs; on a
        coarser mesh (3c + m, 3c + m)
    softness : (q, 2) displacement per force of the springs, tangential and normal
    """

    hessian: Array
    softness: Array


def sprung(
    hessian: Array, side: Side, fixed: np.ndarray, coarse: np.ndarray | None = None
) -> Sprung:
    """Body on springs.

    Parameters
    ----------
    hessian : (3n + m, 3n + m) second derivatives of the body's potential, in nodes and loads
    side : its contact points
    fixed : (3n,) True for displacements that a support holds
    coarse : (3n, 3c) displacements of the nodes from those that stay in a coarser mesh, which the
        body then has alone; None where all stay
    """
    xp = numbers_of(hessian, side)
    size, crossed = fixed.size, fixed | fixed[:, None]
    k = xp.where(crossed, 0.0, hessian[:size, :size])
    f = xp.where(fixed[:, None], 0.0, -hessian[:size, size:])
    per_area = _shape(k, side)
    springs = (side.areas[:, None] / per_area)[:, np.array([0, 0, 1])]
    shares = side.shares.swapaxes(1, 2).reshape(len(springs), 3, -1)
    each = shares.swapaxes(1, 2) @ (springs[:, :, None] * shares)
    places = (3 * side.nodes[:, :, None] + np.arange(3)).reshape(len(springs), -1)
    flat = places[:, :, None] * size + places[:, None, :]
    h = summed(each, flat, size**2).reshape(size, size)
    h = xp.where(crossed, 0.0, h)
    if coarse is not None:
        few = scipy.sparse.csr_array(coarse)  # three nodes' displacements in each row
        k, f, h = few.T @ (k @ few), few.T @ f, few.T @ (h @ few)
    alone = xp.diag(h) == 0.0
    h += xp.diag(alone * xp.max(h))
    longest = _shortest_wave(k, h)
    both = xp.column_stack([k, f])
    on_k, on_f = xp.split(half_solved(h * (longest / PART) - k, both), [len(k)], axis=1)
    k, f = k + on_k.T @ on_k, f + on_k.T @ on_f
    c = -hessian[size:, size:] - on_f.T @ on_f
    found = xp.concatenate([xp.column_stack([k, -f]), xp.column_stack([-f.T, -c])])
    return Sprung(found, per_area * (PART / longest) / side.areas[:, None])


def _shape(k: Array, side: Side) -> Array:
    """Displacement per traction (q, 2) of the points, from the nodes' stiffness; up to a factor."""
    xp = numbers_of(k, side)
    own = xp.diag(k).reshape(-1, 3)
    own = xp.stack([xp.max(own[:, :2], axis=1), own[:, 2]], axis=1)
    own = xp.where(own > 0.0, own, xp.max(own))
    share = summed(side.values**2 * side.areas[:, None], side.nodes, len(own))
    share = share * xp.sum(side.areas) / xp.sum(share)
    soft = share[:, None] / own
    # Shape functions can follow what the springs give way by under an even pressure.
    found = xp.sum(side.values[:, :, None] * soft[side.nodes], axis=1)
    even = xp.min(found, axis=0) > EVEN * xp.max(found, axis=0)
    return xp.where(even, found, xp.min(soft, axis=0))


def _shortest_wave(k: Array, h: Array) -> Array:
    """Largest eigenvalue of k over h."""
    xp, solved = numbers_of(k, h), solver(h)
    wave = xp.asarray(np.random.default_rng(0).normal(size=len(k)))

    def step(wave: Array, _: Any) -> tuple[Array, None]:
        found = solved(k @ wave)
        return found / xp.linalg.norm(found), None

    wave = scan(step, wave, xp.arange(WAVES))[0]
    return (wave @ k @ wave) / (wave @ h @ wave)

"""Tangent stiffness of a load step: a part that hardly changes, and what the foundation answers.

Elasticity, supports and loads make the first part.  It is constant where the strains are linear,
and good for many iterations where they are not; the second follows at every iteration from the
derivatives of the laws of friction and contact, node by node.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.mechanics.elements import ORDER
from jbeamshell.numerics import block_tridiagonal
from jbeamshell.numerics.block_tridiagonal import BlockTridiagonal
from jbeamshell.quasistatic.system import Drive, Level, Seen, System, Touch, V, W


class Stiffness(NamedTuple):
    """The part of the tangent stiffness that is constant where the strains are linear.

    The first axis of its parts says of which block the unknown is: the one before, its own, the
    next.

    Attributes
    ----------
    entries : (3, size, size, blocks) of the residual without the foundation's answer
    balance, v, w : (3, size, n) what the foundation sees per unknown; see `System.touch`
    answer : (size, blocks) residual per traction, contact or reaction, for those with an effect
    """

    entries: Array
    balance: Array
    v: Array
    w: Array
    answer: dict[str, Array]


def unknowns_at_rest(system: System) -> Array:
    """No change of the unknowns, in blocks (blocks, size).

    An element's later nodes share a block, so that blocks couple to their neighbours only.  Where
    the first block has too few nodes it is filled up with unknowns that stay zero.
    """
    order, active = ORDER[system.model.grid], len(system.model.active)
    blocks = (system.x.size + order - 1) // order
    return jnp.zeros((blocks, order * active), system.x.dtype)


def nodal(system: System, unknown: Array) -> Array:
    """Active fields at the nodes (n, active) from the unknowns in blocks (blocks, size)."""
    active = len(system.model.active)
    padding = unknown.size - system.x.size * active
    return unknown.ravel()[padding:].reshape(-1, active)


def in_blocks(active: Array, like: Array) -> Array:
    """Unknowns in blocks (blocks, size) from active fields at the nodes (n, active)."""
    return jnp.pad(active.ravel(), (like.size - active.size, 0)).reshape(like.shape)


@eqx.filter_jit  # traced once for its several uses in a solver
def stiffness_at(system: System, q: Array, touch: Touch, drive: Drive) -> Stiffness:
    """The stiffness at fields q (n, m), where the foundation answers so."""
    like = unknowns_at_rest(system)
    order = ORDER[system.model.grid]
    block = np.arange(like.shape[0] * order)[-system.x.size :] // order  # of every node

    def blocked(active: Array) -> Array:  # (..., n, active) to (..., size, blocks)
        padding = [(0, 0)] * (active.ndim - 2) + [
            (like.shape[0] * order - system.x.size, 0),
            (0, 0),
        ]
        rows = jnp.pad(active, padding).reshape(*active.shape[:-2], *like.shape)
        return jnp.swapaxes(rows, -1, -2)

    probes = _probes(system, like)
    forces, elastic = jax.linearize(lambda q: system.elastic(q, drive.pressure), q)
    along = block_tridiagonal.by_neighbour(jax.vmap(jax.vmap(elastic))(jnp.asarray(probes)), block)
    with jax.ensure_compile_time_eval():  # the compiler would do it anew in every run
        fields = block_tridiagonal.by_neighbour(probes, block)

    _, ends = jax.linearize(lambda f, q, t: system.balance(f, q, t, drive)[1], forces, q, touch)
    still, silent = jnp.zeros_like(q), jax.tree.map(jnp.zeros_like, touch)
    columns = jax.vmap(jax.vmap(lambda f, q: ends(f, q, silent)))(along, fields)
    entries = jnp.moveaxis(blocked(columns), 1, 2)
    filling = np.arange(like.size - system.x.size * len(system.model.active))
    if filling.size:
        entries = entries.at[1, filling, filling, 0].set(1.0)
    one = jnp.ones_like(system.x)
    answer = {
        name: blocked(ends(still, still, silent._replace(**{name: one})))
        for name in Touch._fields
        if system.feels(name)
    }
    # There is no block before the first one, and none after the last one.
    first, last = block == 0, block == block[-1]

    def inside(part: Array, first: Any = first, last: Any = last) -> Array:
        return part.at[0, ..., first].set(0.0).at[2, ..., last].set(0.0)

    return Stiffness(
        inside(entries, 0, -1),
        inside(along[..., W]),
        inside(fields[..., V]),
        inside(fields[..., W]),
        answer,
    )


def _probes(system: System, like: Array) -> np.ndarray:
    """Fields (3, size, n, m) of unit unknowns in every third block."""
    units = block_tridiagonal.seeds(like)
    active = list(system.model.active)
    nodes = units.reshape(*units.shape[:2], -1)[..., like.size - system.x.size * len(active) :]
    fields = np.zeros((*units.shape[:2], system.x.size, system.model.width), units.dtype)
    fields[..., active] = nodes.reshape(*units.shape[:2], -1, len(active))
    return fields


def stiffness_at_rest(
    system: System, rough: ArrayLike, along: Array | tuple[float, float] = (1.0, 0.0)
) -> Stiffness:
    """The stiffness of the strip before anything acts on it, with or without friction."""
    zero = jnp.zeros_like(system.x)
    drive = Drive(zero[0], zero[0] + 1.0, zero[0], zero[0] + rough, along)
    return stiffness_at(system, system.rest().q, Touch(zero, zero, zero), drive)


def matrix(
    system: System, stiffness: Stiffness, seen: Seen, before: Level, drive: Drive
) -> BlockTridiagonal:
    """The matrix of the residual, from what the foundation sees."""
    _, linear = jax.linearize(lambda f, v, w: system.touch(f, v, w, before, drive), *seen)
    answers = jax.vmap(jax.vmap(linear))(stiffness.balance, stiffness.v, stiffness.w)
    entries = stiffness.entries
    for name, weight in stiffness.answer.items():
        entries = entries + weight[:, None] * _of_rows(system, getattr(answers, name))
    return BlockTridiagonal(*entries)


def _of_rows(system: System, answer: Array) -> Array:
    """What the nodes answer, (..., k, n), row by row of the blocks: (..., size or 1, k, blocks)."""
    order, active = ORDER[system.model.grid], len(system.model.active)
    if order == 1:
        return answer[..., None, :, :]
    filled = jnp.pad(answer, [(0, 0)] * (answer.ndim - 1) + [(-answer.shape[-1] % order, 0)])
    nodes = jnp.moveaxis(filled.reshape(*answer.shape[:-1], -1, order), -1, -3)
    return jnp.repeat(nodes, active, axis=-3)

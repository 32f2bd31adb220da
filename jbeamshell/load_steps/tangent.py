"""Tangent stiffness of a load step: a part that hardly changes, and the foundation's response.

Elasticity, supports and loads make the first part.  It is constant where the strains are linear,
and good for many iterations where they are not.  The second part is found again at every iteration,
node by node, from the derivatives of the laws of friction and contact.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.load_steps.system import (
    ContactInput,
    ContactResponse,
    LoadLevel,
    Prescribed,
    System,
    V,
    W,
)
from jbeamshell.mechanics.kinematics import FIELDS
from jbeamshell.numerics import block_tridiagonal
from jbeamshell.numerics.block_tridiagonal import BlockTridiagonal


class Stiffness(NamedTuple):
    """Part of the tangent stiffness that is constant where the strains are linear.

    Unknowns lie in blocks, see `zero_unknowns`.  The first axis of `entries` and of `contact`
    stands for the block of the unknown: the one before, its own, the next.

    Attributes
    ----------
    entries : (3, size, size, blocks) stiffness without the foundation's response
    contact : (3, size, n) each, input of the foundation per unknown
    response : (size, blocks) each, residual per part of the foundation's response, by the part's
        name
    """

    entries: Array
    contact: ContactInput
    response: dict[str, Array]


def zero_unknowns(system: System) -> Array:
    """Unknowns, increments of the active fields, in blocks (blocks, size); all are zero.

    An element's later nodes share a block, so that blocks couple to their neighbours only.  Where
    the first block has too few nodes it is padded with unknowns that stay zero.
    """
    order, active = system.element_order, len(system.plan.active)
    blocks = (system.x.size + order - 1) // order
    return jnp.zeros((blocks, order * active), system.x.dtype)


def block_of_node(system: System) -> np.ndarray:
    """Index of the block (n,) to which each node belongs."""
    nodes, order = system.x.size, system.element_order
    blocks = (nodes + order - 1) // order
    return np.arange(blocks * order)[-nodes:] // order


def nodal(system: System, unknown: Array) -> Array:
    """Active fields at the nodes (n, active) from the unknowns in blocks (blocks, size)."""
    active = len(system.plan.active)
    padding = unknown.size - system.x.size * active
    return unknown.ravel()[padding:].reshape(-1, active)


def in_blocks(active: Array, like: Array) -> Array:
    """Unknowns in blocks (blocks, size) from active fields at the nodes (n, active)."""
    return jnp.pad(active.ravel(), (like.size - active.size, 0)).reshape(like.shape)


def residual_in_blocks(residual: Array, unknown: Array, padding_scale: ArrayLike = 1.0) -> Array:
    """Residual (n, active) in blocks like the unknowns, whose padding is its own residual."""
    padding = padding_scale * unknown.ravel()[: unknown.size - residual.size]
    return jnp.append(padding, residual.ravel()).reshape(unknown.shape)


def with_v(system: System, unknown: Array, v: Array) -> Array:
    """Unknowns (blocks, size) with other increments of v, (n,)."""
    return in_blocks(nodal(system, unknown).at[:, V].set(v), unknown)


@eqx.filter_jit  # traced once for its several uses in a solver
def stiffness_at(
    system: System, q: Array, response: ContactResponse, prescribed: Prescribed
) -> Stiffness:
    """Stiffness at fields q (n, m) under the foundation's response."""
    like, block = zero_unknowns(system), block_of_node(system)
    missing = like.shape[0] * system.element_order - system.x.size

    def blocked(active: Array) -> Array:  # (..., n, active) to (..., size, blocks)
        padding = [(0, 0)] * (active.ndim - 2) + [(missing, 0), (0, 0)]
        rows = jnp.pad(active, padding).reshape(*active.shape[:-2], *like.shape)
        return jnp.swapaxes(rows, -1, -2)

    probes = _probes(system, like)
    forces, elastic = jax.linearize(lambda q: system.elastic_forces(q, prescribed.pressure), q)
    along = block_tridiagonal.by_neighbour(jax.vmap(jax.vmap(elastic))(jnp.asarray(probes)), block)
    with jax.ensure_compile_time_eval():  # else the program would do it in every run
        fields = block_tridiagonal.by_neighbour(probes, block)

    _, residual = jax.linearize(
        lambda f, q, r: system.balance(f, q, r, prescribed)[1], forces, q, response
    )
    zero, no_response = jnp.zeros_like(q), jax.tree.map(jnp.zeros_like, response)
    columns = jax.vmap(jax.vmap(lambda f, q: residual(f, q, no_response)))(along, fields)
    entries = jnp.moveaxis(blocked(columns), 1, 2)
    filling = np.arange(like.size - system.x.size * len(system.plan.active))
    if filling.size:
        entries = entries.at[1, filling, filling, 0].set(1.0)
    ones = jnp.ones_like(system.x)
    per_response = {
        name: blocked(residual(zero, zero, no_response._replace(**{name: ones})))
        for name in ContactResponse._fields
        if system.enters_residual(name)
    }
    contact = ContactInput(along[..., W], fields[..., V], fields[..., W])
    end_nodes = block == 0, block == block[-1]
    return Stiffness(
        _inside(entries, 0, -1),
        ContactInput(*(_inside(a, *end_nodes) for a in contact)),
        per_response,
    )


def _inside(part: Array, first: Any, last: Any) -> Array:
    """Part of a `Stiffness` without the blocks before the first one and after the last one."""
    return part.at[0, ..., first].set(0.0).at[2, ..., last].set(0.0)


def _probes(system: System, like: Array) -> np.ndarray:
    """Fields (3, size, n, m) of unit unknowns in every third block."""
    units = block_tridiagonal.seeds(like)
    active = list(system.plan.active)
    nodes = units.reshape(*units.shape[:2], -1)[..., like.size - system.x.size * len(active) :]
    fields = np.zeros((*units.shape[:2], system.x.size, len(FIELDS)), units.dtype)
    fields[..., active] = nodes.reshape(*units.shape[:2], -1, len(active))
    return fields


def initial_stiffness(
    system: System, rough: ArrayLike, weights: Array | tuple[float, float] = (1.0, 0.0)
) -> Stiffness:
    """Stiffness of the unloaded strip, with or without friction; see `Prescribed`."""
    zero = jnp.zeros_like(system.x)
    prescribed = Prescribed(zero[0], zero[0] + 1.0, zero[0], zero[0] + rough, weights)
    return stiffness_at(system, system.unloaded().q, ContactResponse(zero, zero, zero), prescribed)


def matrix(
    system: System,
    stiffness: Stiffness,
    contact: ContactInput,
    before: LoadLevel,
    prescribed: Prescribed,
) -> BlockTridiagonal:
    """Matrix of the residual, where the foundation's input is ``contact``."""
    _, linear = jax.linearize(lambda c: system.contact_response(c, before, prescribed), contact)
    responses = jax.vmap(jax.vmap(linear))(stiffness.contact)
    entries = stiffness.entries
    for name, weight in stiffness.response.items():
        entries = entries + weight[:, None] * _in_rows(system, getattr(responses, name))
    return BlockTridiagonal(*entries)


def _in_rows(system: System, response: Array) -> Array:
    """Responses of nodes (..., k, n), by rows of the blocks: (..., size or 1, k, blocks)."""
    order, active = system.element_order, len(system.plan.active)
    if order == 1:
        return response[..., None, :, :]
    padding = [(0, 0)] * (response.ndim - 1) + [(-response.shape[-1] % order, 0)]
    response = jnp.pad(response, padding)
    nodes = jnp.moveaxis(response.reshape(*response.shape[:-1], -1, order), -1, -3)
    return jnp.repeat(nodes, active, axis=-3)

"""Events of a branch: nodes that begin to slip, stick again, open and close."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array, lax

from jbeamshell.contact_line.tableau import AGAINST, CLOSE, KINDS, STICK, Branch, Tableau

END = KINDS  # of a branch, which is no event
LATE = 1e-9  # of the largest friction, by which a node is beyond its own where it slips at once
MOST_VERTICES = 8  # of a branch, times the nodes
BY_ROW, AT_ONCE, AT_RETURN, FIXED = range(4)  # what an event's load follows from


class Search(NamedTuple):
    """Extra friction of a branch, which the search for events takes beside the equations.

    Attributes
    ----------
    extra : (2, k) friction that nodes have to go beside their own, before they slip along and
        against v
    back : tau at which the extra friction ends; infinite if it does not
    """

    extra: Array
    back: Array


class Event(NamedTuple):
    """Next event: its tau, kind and node, and what its tau follows from."""

    tau: Array
    kind: Array
    node: Array
    cause: Array


class Record(NamedTuple):
    """Events of a branch in their order, the last of them its `END`.

    Attributes
    ----------
    events : (most, 5) kind, node, cause, vertex, and 1 for nodes that keep reaction or lift
    tau : (most,)
    number : of them
    """

    events: Array
    tau: Array
    number: Array


def keeps(at: Tableau, event: Event) -> Array:
    """True for a node that closes with the lift it has, because it still has a reaction."""
    return (event.kind == CLOSE) & (at.rate[at.sigma.size + event.node] > 0.0)


def recorded(record: Record, event: Event, vertex: Array, keep: Array) -> Record:
    """Record with one more event."""
    row = jnp.stack([event.kind, event.node, event.cause, vertex, keep.astype(int)])
    return Record(
        record.events.at[record.number].set(row.astype(record.events.dtype)),
        record.tau.at[record.number].set(event.tau),
        record.number + 1,
    )


def next_event(branch: Branch, search: Search, at: Tableau) -> Event:
    """Next event; of those at the same tau the one of the first kind and node."""
    k, n = at.sigma.size, at.opened.size
    friction, answer, rate = branch.friction, at.answer, at.rate
    force, force_rate = answer[:k], rate[:k]  # slip where a node slips
    normal, normal_rate = answer[k:], rate[k:]
    sticks = (at.sigma == 0.0) & ~at.opened[:k]
    slips = (at.sigma != 0.0) & ~at.opened[:k]
    cap, cap_rate = friction * normal[:k], friction * normal_rate[:k]
    rest = search.back - at.tau  # until the extra friction ends

    def until(room: Array, change: Array, counts: Array) -> Array:
        falling = counts & (change < 0.0)
        wait = jnp.maximum(room, 0.0) / jnp.where(falling, -change, 1.0)
        return jnp.where(falling, wait, jnp.inf)

    def until_slip(side: float, extra: Array) -> tuple[Array, Array]:
        room = cap + side * force
        change = cap_rate + side * force_rate
        wait, own = until(room + extra, change, sticks), until(room, change, sticks)
        ends = wait >= rest
        late = jnp.where(ends, room, room + extra) < -LATE * jnp.max(cap)
        wait = jnp.where(ends, jnp.maximum(own, rest), wait)
        return wait, jnp.where(ends & (own < rest), AT_RETURN, jnp.where(late, AT_ONCE, BY_ROW))

    def to_nodes(wait: Array) -> Array:
        return jnp.pad(wait, (0, n - k), constant_values=jnp.inf)

    along, along_cause = until_slip(1.0, search.extra[0])
    against, against_cause = until_slip(-1.0, search.extra[1])
    turns_back = jnp.where(slips & (at.sigma * force_rate < 0.0), 0.0, jnp.inf)
    loose = ~at.opened & jnp.append(at.sigma != 0.0, jnp.ones(n - k, bool))
    # A node that still has a reaction closes where it is, if it would open further.
    rises = at.opened & (at.held[k:] > 0.0) & (normal_rate > 0.0)
    wait, kind, node = first_of(
        [  # in the order of the kinds
            to_nodes(along),
            to_nodes(against),
            to_nodes(turns_back),
            until(normal, normal_rate, loose),
            jnp.where(rises, 0.0, until(branch.lift + normal, normal_rate, at.opened)),
        ]
    )
    causes = jnp.stack([along_cause, against_cause])
    slips = causes[jnp.minimum(kind, AGAINST), jnp.minimum(node, k - 1)]
    others = jnp.where((kind == STICK) | rises[node], AT_ONCE, BY_ROW)
    cause = jnp.where(kind < STICK, slips, others)
    return Event(at.tau + wait, kind, node, cause)


def first_of(waits: list[Array]) -> tuple[Array, Array, Array]:
    """Least of the waits (n,) of each kind, its kind and its node; the first of equal ones."""
    n = waits[0].size
    nodes = jnp.arange(n)
    least, number = waits[0], nodes
    for kind, wait in enumerate(waits[1:], 1):  # side by side: a minimum with its place is slow
        less = wait < least
        least = jnp.where(less, wait, least)
        number = jnp.where(less, kind * n + nodes, number)

    def earlier(one: tuple[Array, Array], other: tuple[Array, Array]) -> tuple[Array, Array]:
        before = (one[0] < other[0]) | ((one[0] == other[0]) & (one[1] < other[1]))
        wait, place = (jnp.where(before, a, b) for a, b in zip(one, other, strict=True))
        return wait, place

    none = jnp.asarray(jnp.inf, least.dtype), jnp.asarray(KINDS * n, number.dtype)
    wait, first = lax.reduce((least, number), none, earlier, (0,))
    return wait, first // n, first % n

"""Polygon of a branch: the contact at its events, found one after the other.

Between two events everything is linear in the load (see `tableau`).  So the contact at the events,
the vertices, says all about a branch; `spline` reads it at a load.

A branch begins with a contact that was read between two vertices.  One node has slipped by a part
there, and its friction is below its limit.  All nodes have the friction that they have, but where
the load turns back some have more to go before they slip back:

* A node that slipped in the branch before, also by a part, slips back after the full range, twice
  its limit, as Masing's rule has it.
* So does a node that was about to slip.  One that had little friction has little more to go, so
  that what follows is continuous.  Where the branch before began the contact has closed its loop,
  and beyond it no node has more to go.
* A node that was open or came to stick again has no more to go.

The forces themselves always follow from balance.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.contact_line import replay
from jbeamshell.contact_line.events import (
    END,
    FIXED,
    MOST_VERTICES,
    Event,
    Record,
    Search,
    keeps,
    next_event,
    recorded,
)
from jbeamshell.contact_line.tableau import (
    ALONG,
    KINDS,
    OPEN,
    STICK,
    Branch,
    Tableau,
    begun,
    changed,
)
from jbeamshell.numerics.pushforward import pushforward

MOST_EVENTS = 40  # of a branch, times the nodes
DENSE = 3  # vertices, times the nodes, from which on close ones are merged
MERGED = 1e-9  # of the branch: vertices that are closer are one
MOST_PART = 0.6  # of a step of a front, that rounds one of its corners; see `spline`
UNEVEN = 3.0  # largest ratio of the two parts of a rounded corner
STARTS = 0.25  # of its load: most that the corner where a later front starts reaches back


class Polygon(NamedTuple):
    """Vertices of a branch, of which the first is its begin; others than ``number`` mean nothing.

    Attributes
    ----------
    tau : (most,) loads since the branch began
    change : (most, k + n) change q of the fields since then
    before, after : (most,) vertex at which the node beside had the same kind of event: the last
        one, and the next one; 0 for none
    node : (most,) node of a vertex that has one before
    way : (most,) True if its number is larger than that of the node before
    number : of vertices
    """

    tau: Array
    change: Array
    before: Array
    after: Array
    node: Array
    way: Array
    number: Array


class Slip(NamedTuple):
    """Slip of the nodes of a branch.

    Attributes
    ----------
    side : (k,) 1 and -1 for nodes that slipped along and against v up to the end, else 0
    stuck, opened : (k,) True for nodes that came to stick again, and that were open
    later : (k,) vertex beyond the end at which a node slips first; 0 for none
    later_side : (k,) its side
    ended : True if there were not too many events
    """

    side: Array
    stuck: Array
    opened: Array
    later: Array
    later_side: Array
    ended: Array


def polygon(
    branch: Branch,
    search: Search,
    opened: Array,
    reach: Array,
    slides: Array,
) -> tuple[Polygon, Slip]:
    """Polygon of a branch; the derivatives of its vertices are exact, forward and reverse.

    Parameters
    ----------
    branch : equations
    search : see there
    opened : (n,) True for nodes that are open where it begins
    reach : tau of its end; vertices beyond it are found as far as `spline` needs them
    slides : change of pull.q per load from which on a body slides as a whole
    """
    tau, change, corners, slip = _vertices(branch, search, opened, reach, slides)
    return Polygon(tau, change, *corners), slip


@jax.custom_jvp
def _vertices(
    branch: Branch, search: Search, opened: Array, reach: Array, slides: Array
) -> tuple[Array, Array, tuple[Array, ...], Slip]:
    (tau, change), corners, slip, _ = _walked(branch, search, opened, reach, slides)
    return tau, change, corners, slip


@_vertices.defjvp
def _vertices_jvp(primals, tangents):  # type: ignore[no-untyped-def]
    branch, search, opened, reach, slides = jax.tree.map(lax.stop_gradient, primals)
    (tau, change), corners, slip, record = _walked(branch, search, opened, reach, slides)
    known = opened, record
    slopes = pushforward(replay.vertices, (branch, search), known, tangents[:2])
    none = jax.tree.map(_no_slope, (corners, slip))
    return (tau, change, corners, slip), (*slopes, *none)


def _no_slope(a: Array) -> Array | np.ndarray:
    real = jnp.issubdtype(a.dtype, jnp.floating)
    return jnp.zeros_like(a) if real else np.zeros(a.shape, jax.dtypes.float0)


class Walk(NamedTuple):
    """Walk along a branch.

    Attributes
    ----------
    at, event : where it is, and what comes next
    polygon, slip, record : what was found
    last : (KINDS, n) vertex at which each node had each kind of event, or -1
    """

    at: Tableau
    event: Event
    polygon: Polygon
    slip: Slip
    record: Record
    last: Array


Found = tuple[tuple[Array, Array], tuple[Array, ...], Slip, Record]


@jax.custom_batching.sequential_vmap
def _walked(branch: Branch, search: Search, opened: Array, reach: Array, slides: Array) -> Found:
    """Vertices of a branch, their corners, the slip, and the record of the events."""
    n = branch.lift.size
    k = branch.pull.size - n
    most, most_events = MOST_VERTICES * n, MOST_EVENTS * n
    dtype = branch.pull.dtype
    at = begun(branch, opened)
    none = jnp.zeros(most, int)
    walk = Walk(
        at=at,
        event=next_event(branch, search, at),
        polygon=Polygon(
            jnp.zeros(most, dtype),
            jnp.zeros((most, k + n), dtype),
            *(none, none, none, none > 0),
            jnp.asarray(1),
        ),
        slip=Slip(
            jnp.zeros(k, dtype),
            jnp.zeros(k, bool),
            opened[:k],
            jnp.zeros(k, int),
            jnp.zeros(k, dtype),
            jnp.asarray(True),
        ),
        record=Record(
            jnp.zeros((most_events, 5), int), jnp.zeros(most_events, dtype), jnp.asarray(0)
        ),
        last=jnp.full((KINDS, n), -1),
    )

    def unfinished(now: Walk) -> Array:
        needed = now.event.tau <= horizon(now.polygon, reach)
        room = (now.record.number < most_events - 1) & (now.polygon.number < most - 2)
        gone = (now.at.tau >= reach) & (jnp.abs(branch.pull @ now.at.velocity) > slides)
        return needed & room & ~gone

    def go(now: Walk) -> Walk:
        event = now.event
        at = now.at.at(event.tau)
        keep = keeps(at, event)
        corners, vertex = with_vertex(now.polygon, at, reach)
        record = recorded(now.record, event, vertex, keep)
        corners, last = with_neighbours(corners, now.last, event, vertex, k)
        at = changed(branch, at, event.kind, event.node, keep)
        slip = with_slip(now.slip, event, vertex, reach)
        return Walk(at, next_event(branch, search, at), corners, slip, record, last)

    end = lax.while_loop(unfinished, go, walk)
    # A vertex at the next event, or anywhere beyond, ends the last edge.
    event = end.event
    reached = jnp.maximum(reach, end.at.tau)
    anywhere = jnp.where(reached > 0.0, 2.0 * reached, 1.0)  # a rest has no size
    comes = (event.tau - end.at.tau > MERGED * reached) & (event.tau < anywhere)
    tau = jnp.where(comes, event.tau, anywhere)
    found, at = end.polygon, end.at.at(tau)
    place = found.number
    found = found._replace(
        tau=found.tau.at[place].set(tau),
        change=found.change.at[place].set(at.change),
        number=place + 1,
    )
    cause = jnp.where(comes, event.cause, FIXED)
    final = Event(tau, jnp.where(comes, event.kind, END), event.node, cause)
    record = recorded(end.record, final, place, jnp.asarray(False))
    slip = end.slip._replace(ended=(event.tau > reach) | (end.at.tau >= reach))
    corners = found.before, found.after, found.node, found.way, found.number
    return (found.tau, found.change), corners, slip, record


def horizon(polygon: Polygon, reach: Array) -> Array:
    """Load up to which events are needed: those that may round a corner at the branch's end."""
    tau, rows = polygon.tau, jnp.arange(polygon.tau.size)
    step = tau - tau[polygon.before]
    starts = starts_late(polygon)
    open_end = (rows > 0) & (rows < polygon.number) & (polygon.after == 0)
    open_end &= tau - jnp.where(starts, STARTS, MOST_PART) * step < reach
    beyond = jnp.maximum(
        tau + UNEVEN * MOST_PART / (1.0 - MOST_PART) * step,
        jnp.where(polygon.before > 0, reach + UNEVEN * MOST_PART * step, 0.0),
    )
    beyond = jnp.where(starts, tau + STARTS / (1.0 - MOST_PART) * step, beyond)
    return jnp.maximum(jnp.max(jnp.where(open_end, beyond, 0.0)), reach)


def starts_late(polygon: Polygon) -> Array:
    """Vertices (most,) at which a front starts, while an earlier front is on its way."""
    starts = (polygon.before == 0) & (jnp.arange(polygon.tau.size) > 0)
    goes_on = starts & (polygon.after > 0)
    return starts & (jnp.cumsum(goes_on) > goes_on)


def with_vertex(polygon: Polygon, at: Tableau, reach: Array) -> tuple[Polygon, Array]:
    """Polygon with the vertex of an event, which close events share, and its number."""
    n = at.opened.size
    last = polygon.number - 1
    dense = polygon.number > DENSE * n
    close = jnp.where(dense, 0.5 / n, MERGED) * reach
    new = at.tau - polygon.tau[last] > close
    place = jnp.where(new, last + 1, last)
    first = place == 0  # the branch begins where it begins
    return polygon._replace(
        tau=polygon.tau.at[place].set(jnp.where(first, 0.0, at.tau)),
        change=polygon.change.at[place].set(jnp.where(first, 0.0, at.change)),
        number=place + 1,
    ), place


def with_neighbours(
    polygon: Polygon, last: Array, event: Event, vertex: Array, k: int
) -> tuple[Polygon, Array]:
    """Polygon that knows at which vertices the node beside had the same kind of event.

    Nodes that cannot slip, such as bearings, have none beside them.
    """
    n = last.shape[1]
    kind = jnp.minimum(event.kind, KINDS - 1)
    row = last[kind]
    below = jnp.where(event.node > 0, row[jnp.maximum(event.node - 1, 0)], -1)
    above = jnp.where(event.node < n - 1, row[jnp.minimum(event.node + 1, n - 1)], -1)

    def earlier(a: Array) -> Array:
        return jnp.where(a < vertex, a, -1)

    found = jnp.maximum(earlier(below), earlier(above))
    counts = (kind != STICK) & (found > 0) & (event.node < k)
    first = counts & (polygon.before[vertex] == 0)
    mine = jnp.where(first, vertex, polygon.tau.size)
    before = polygon.before.at[mine].set(found, mode="drop")
    node = polygon.node.at[mine].set(event.node, mode="drop")
    way = polygon.way.at[mine].set(earlier(below) == found, mode="drop")
    place = jnp.where(counts, found, 0)
    follows = jnp.where(counts & (polygon.after[place] == 0), vertex, polygon.after[place])
    after = polygon.after.at[place].set(follows)
    corners = polygon._replace(before=before, after=after, node=node, way=way)
    return corners, last.at[kind, event.node].set(vertex)


def with_slip(slip: Slip, event: Event, vertex: Array, reach: Array) -> Slip:
    """Slip after an event."""
    k = slip.side.size
    node = jnp.where(event.node < k, event.node, k)  # beyond the end where it cannot slip
    slips, sticks = event.kind < STICK, event.kind == STICK
    side = jnp.where(event.kind == ALONG, 1.0, -1.0)
    now = jnp.where(event.tau <= reach, node, k)
    first = jnp.minimum(node, k - 1)
    later = (event.tau > reach) & slips & (slip.later[first] == 0)
    beyond = jnp.where(later, node, k)
    return slip._replace(
        side=slip.side.at[jnp.where(slips, now, k)].set(side, mode="drop"),
        stuck=slip.stuck.at[jnp.where(slips | sticks, now, k)].set(sticks, mode="drop"),
        opened=slip.opened.at[jnp.where(event.kind >= OPEN, now, k)].set(True, mode="drop"),
        later=slip.later.at[beyond].set(vertex, mode="drop"),
        later_side=slip.later_side.at[beyond].set(side, mode="drop"),
    )

"""Vertices of a branch from the record of its events, with derivatives of both modes.

The tableau is that of the walk, so that it needs no derivative.  At an event the contact solves
linear equations: what is held has its value, and what makes the event vanishes.  One step of
Newton's method from the contact that was found changes nothing there, and its derivative is that of
the solution (implicit function theorem).
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array, lax

from jbeamshell.contact_line.events import (
    AT_ONCE,
    AT_RETURN,
    BY_ROW,
    END,
    MOST_VERTICES,
    Record,
    Search,
)
from jbeamshell.contact_line.tableau import (
    ALONG,
    CLOSE,
    OPEN,
    STICK,
    Branch,
    Tableau,
    begun,
    changed,
    places,
)


class Replay(NamedTuple):
    """Replay of a branch: the tableau, and what has derivatives.

    Attributes
    ----------
    at : tableau after an event
    held : (k + n,) what it holds
    tau : load of the event
    vertices, changes : (most,) and (most, k + n) vertices so far
    """

    at: Tableau
    held: Array
    tau: Array
    vertices: Array
    changes: Array


def vertices(given: tuple[Branch, Search], known: tuple[Array, Record]) -> tuple[Array, Array]:
    """Loads (most,) of a branch's vertices and the change (most, k + n) of the fields there.

    Parameters
    ----------
    given : equations and what the search for events knows
    known : (n,) True for nodes that are open where the branch begins, and the events
    """
    (branch, search), (opened, record) = given, known
    n, size = branch.lift.size, branch.pull.size
    most = MOST_VERTICES * n
    fixed = jax.tree.map(lax.stop_gradient, branch)
    start = begun(fixed, opened)
    k = size - n
    # A node that is open where the branch begins keeps the forces that it has.
    sums = branch.r_0[:k] + start.sigma * branch.friction * branch.r_0[k : 2 * k]
    held = jnp.concatenate([jnp.where(start.sigma != 0.0, sums, 0.0), jnp.zeros(n)])
    held = held.at[k:].set(jnp.where(opened, branch.r_0[k:], 0.0))
    zero = jnp.zeros_like(branch.friction)
    begin = Replay(
        start, held, zero, jnp.zeros(most, held.dtype), jnp.zeros((most, size), held.dtype)
    )

    def go(now: Replay, row: tuple[Array, Array, Array]) -> tuple[Replay, None]:
        events, tau, here = row
        return lax.cond(here, lambda: _after(branch, search, now, events, tau), lambda: now), None

    @jax.checkpoint
    def some(now: Replay, rows: tuple[Array, Array, Array]) -> Replay:
        return lax.scan(go, now, rows)[0]

    def chunk(now: Replay, rows: tuple[Array, Array, Array]) -> tuple[Replay, None]:
        return lax.cond(rows[2][0], some, lambda now, _: now, now, rows), None

    here = jnp.arange(record.tau.size) < record.number
    rows = jax.tree.map(lambda a: a.reshape(-1, n, *a.shape[1:]), (record.events, record.tau, here))
    end = lax.scan(chunk, begin, rows)[0]
    return end.vertices, end.changes


def _after(branch: Branch, search: Search, now: Replay, events: Array, load: Array) -> Replay:
    """Replay after an event that was found at a load."""
    kind, node, cause, vertex, keep = events
    at = now.at.at(load)
    tangential, normal, row = places(at, kind, node)
    k = at.sigma.size
    found = at.change
    side = jnp.where(kind == ALONG, 1.0, jnp.where(kind < STICK, -1.0, 0.0))

    def force(i: Array, change: Array, tau: Array) -> Array:
        return branch.r_0[i] + branch.matrix[i] @ change - branch.pull[i] * tau

    # What is held, at the contact that was found and its load.
    forces = branch.r_0 + branch.matrix @ found - branch.pull * load
    sums = forces[:k] + at.sigma * branch.friction * forces[k : 2 * k]
    holds = jnp.where(at.moving, jnp.append(sums, forces[k:]), found)
    answer = at.matrix @ _without_value(now.held - holds)
    change = found + jnp.where(at.moving, answer, _without_value(now.held - holds))
    # What makes the event: a row that vanishes, or the load of something else.
    back = jnp.where(jnp.isfinite(search.back), search.back, 0.0)
    extra = jnp.where(
        load < search.back,
        jnp.where(side > 0.0, search.extra[0, tangential], search.extra[1, tangential]),
        0.0,
    )
    reaction = force(normal, change, load)
    room = jnp.where(
        kind < STICK,
        branch.friction * reaction + side * force(tangential, change, load) + extra,
        jnp.where(kind == CLOSE, branch.lift[node] + change[normal], reaction),
    )
    slope = jnp.where(
        kind < STICK,
        lax.stop_gradient(branch.friction) * at.rate[normal] + side * at.rate[tangential],
        at.rate[normal],
    )
    by_row = cause == BY_ROW
    delay = -_without_value(room) / jnp.where(by_row, slope, 1.0)
    tau = load + jnp.where(
        by_row,
        delay,
        jnp.where(
            cause == AT_ONCE,
            _without_value(now.tau),
            jnp.where(cause == AT_RETURN, _without_value(back), 0.0),
        ),
    )
    change = change + at.velocity * _without_value(tau)
    # What the event holds from now on.
    r_t, r_n = force(tangential, change, tau), force(normal, change, tau)
    slips = r_t + side * branch.friction * r_n
    kept = jnp.where(keep == 1, change[normal], -branch.lift[node])
    holds = jnp.where(
        kind < STICK,
        slips,
        jnp.where(kind == STICK, change[tangential], jnp.where(kind == OPEN, 0.0, kept)),
    )
    place = jnp.where(vertex == 0, now.vertices.size, vertex)  # the first one stays where it is
    fixed = jax.tree.map(lax.stop_gradient, branch)
    ends = kind == END
    after = changed(fixed, at, jnp.minimum(kind, CLOSE), node, keep == 1)
    after = jax.tree.map(lambda a, b: jnp.where(ends, a, b), at, after)
    return Replay(
        jax.tree.map(lax.stop_gradient, after),
        now.held.at[row].set(jnp.where(ends, now.held[row], holds)),
        tau,
        now.vertices.at[place].set(tau, mode="drop"),
        now.changes.at[place].set(change, mode="drop"),
    )


def _without_value(a: Array) -> Array:
    """Zero with the derivative of a number."""
    return a - lax.stop_gradient(a)

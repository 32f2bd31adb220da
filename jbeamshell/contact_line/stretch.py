"""Stretch of a load path between two events: what waits, what comes next, and where it ends."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array, lax

from jbeamshell.contact_line.body import local_compliance
from jbeamshell.contact_line.branches import ContactState
from jbeamshell.contact_line.tableau import KINDS, System, Tableau

MOST_EVENTS = 40  # of a load branch, times the nodes
SLIDES = 1e6  # compliance over that of the clamped contact from which on a body slides as a whole


class Level(NamedTuple):
    """A load level of a path: the contact, its lift, and what happened since the level before.

    Attributes
    ----------
    state : contact
    lift : (n,) lift w
    slip_work : work of friction in the step
    slipping : (k,) True for closed nodes that slip at its end
    settled : True if all events up to here were found, and the body does not slide as a whole
    """

    state: ContactState
    lift: Array
    slip_work: Array
    slipping: Array
    settled: Array


class Event(NamedTuple):
    """Next event: its tau, kind and node."""

    tau: Array
    kind: Array
    node: Array


def moved(at: Tableau, friction: Array, tau: Array) -> Tableau:
    """Tableau at a later tau without an event between."""
    k = at.sigma.size
    step = tau - at.tau
    middle = at.at(at.tau + 0.5 * step)
    closed = (at.sigma != 0.0) & ~at.opened[:k]
    drive = jnp.where(closed, at.sigma * friction * at.rate[:k], 0.0)
    power = jnp.sum(_beside(drive, middle) * middle[k : 2 * k], axis=0)
    return at._replace(work=at.work + power * step, tau=tau)


def _beside(values: Array, others: Array) -> Array:
    """Values along the first axis, for products with others that have more axes."""
    return values.reshape(-1, *[1] * (others.ndim - 1))


def state_of(
    at: Tableau, friction: Array, origin: ContactState, force: Array
) -> tuple[ContactState, Array]:
    """Contact and lift at a tableau's tau; ``origin`` is the contact at the reversal."""
    k = at.sigma.size
    fields, reaction = at.fields(at.tau, origin.v)
    now = at.at(at.tau)
    traction = jnp.where(at.sigma == 0.0, now[:k], -at.sigma * friction * reaction[:k])
    return ContactState(fields[:k], traction, reaction, force, now[-1]), fields[k:]


def ended(
    system: System, at: Tableau, event: Array, last: Level, start: ContactState, force: Array
) -> tuple[Tableau, Level]:
    """Tableau and level at a load; its work is that since the reversal.

    Parameters
    ----------
    at : tableau after the last event before the load
    event : tau of the next one, which comes before the load if no more events were found
    last : level before
    start : contact at the reversal
    force : the load
    """
    tau = jnp.abs(force - start.force)
    at = moved(at, system.friction, tau)
    state, lift = state_of(at, system.friction, start, force)
    local = local_compliance(jnp.diag(system.matrix), system.pull)
    held = jnp.abs(at.rate[-1]) < SLIDES * (jnp.abs(system.c) + local)
    slipping = (at.sigma != 0.0) & ~at.opened[: at.sigma.size]
    return at, Level(state, lift, at.work, slipping, last.settled & (event >= tau) & held)


def goes_on(at: Tableau) -> Array:
    """True if there were not too many events, so that another one can be followed."""
    return at.events < MOST_EVENTS * at.opened.size


def next_event(at: Tableau, friction: Array) -> Event:
    """Next event of a stretch; of those at the same tau the one of the first kind and node."""
    wait, kind, node = first_of(waits_of(at, friction))
    return Event(at.tau + wait, kind, node)


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


def waits_of(at: Tableau, friction: Array) -> list[Array]:
    """Load until the events of a stretch, infinite for those that do not come.

    Returns
    -------
    list
        (n,) of each kind; (n, loads) of many loads
    """
    k, n = at.sigma.size, at.opened.size
    now = at.at(at.tau)
    force, force_rate = now[:k], at.rate[:k]  # slip where a node slips
    normal, normal_rate = now[k : k + n], at.rate[k : k + n]

    def to_nodes(wait: Array) -> Array:
        rest = [(0, n - wait.shape[0]), *[(0, 0)] * (wait.ndim - 1)]
        return jnp.pad(wait, rest, constant_values=jnp.inf)

    def until(room: Array, change: Array, counts: Array) -> Array:
        falling = counts & (change < 0.0)
        inverse = jnp.where(falling, -1.0 / jnp.where(falling, change, 1.0), 0.0)
        wait = jnp.maximum(room, 0.0) * _beside(inverse, room)
        return to_nodes(jnp.where(_beside(falling, room), wait, jnp.inf))

    sticks = (at.sigma == 0.0) & ~at.opened[:k]
    slips = (at.sigma != 0.0) & ~at.opened[:k]
    cap, cap_rate = friction * normal[:k], friction * normal_rate[:k]
    loose = ~at.opened & jnp.append(at.sigma != 0.0, jnp.ones(n - k, bool))
    back = jnp.where(slips & (at.sigma * force_rate < 0.0), 0.0, jnp.inf)
    return [  # in the order of the kinds
        until(cap + force, cap_rate + force_rate, sticks),
        until(cap - force, cap_rate - force_rate, sticks),
        to_nodes(_beside(back, now) + jnp.zeros_like(force)),
        until(normal, normal_rate, loose),
        until(normal, normal_rate, at.opened),
    ]

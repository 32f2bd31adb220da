"""Exact slopes of the levels of a load path, forward and reverse.

With q = (v, w), r = reference + M q - f F are the forces of the base.  Between two events a change
of the system's numbers acts like a change of what is held, by

    dr = dM q - df F + dreference      at fixed q and F,

which the tableau of that stretch turns into changes of q.  So every number at a load, and every
slip at which a node sticks again, is a `Row`: a linear form in dr, dmu and the slips of the nodes
that stuck before.  A node that sticks again holds the slip of an event whose load changes too; the
row of that event's condition gives the change.

The work of friction is W = F f.q - int f.q dF - change of (q.M q / 2 + reference.q).  Between two
events the change of f.q is linear in F, so that the integral's slope is a sum over the events, and
the loads of the events do not matter, because f.q is continuous there.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array, lax

from jbeamshell.contact_line.branches import ContactState
from jbeamshell.contact_line.tableau import AGAINST, ALONG, CLOSE, STICK, System, Tableau
from jbeamshell.numerics.factors import inverse_unit_lower


class Row(NamedTuple):
    """Linear form: value = held . slips + forces . dr + friction dmu.

    Attributes
    ----------
    held : (k + k,) on the slips of sticking nodes: those held at the level's start, and those held
        since a stick event of the level
    forces : (k + n,)
    friction : ()
    """

    held: Array
    forces: Array
    friction: Array

    def plus(self, other: Row, factor: Array) -> Row:
        """Sum with a multiple of another row."""
        return Row(*(a + factor * b for a, b in zip(self, other, strict=True)))


class Trace(NamedTuple):
    """Record of a level's events, from which its slopes follow.

    Attributes
    ----------
    on_matrix, on_pull : (k + n, k + n) and (k + n,) parts of d(int f.q dF) on dM and df
    impulse : its part on held slips, reference and friction
    instance : (k,) number of the held slip of each sticking node in `Row.held`
    sticks : count of stick events
    held : rows (k,) of the slips held since those events
    fields, load : (k, k + n) and (k,) q and F at them
    event : row of the change of the load of the last event that was no stick
    """

    on_matrix: Array
    on_pull: Array
    impulse: Row
    instance: Array
    sticks: Array
    held: Row
    fields: Array
    load: Array
    event: Row


def is_full(trace: Trace) -> Array:
    """True if no more events should be recorded; so many that stick at once are left room for."""
    return trace.sticks >= trace.instance.size // 2


def begun(k: int, n: int) -> Trace:
    """Trace of a level before its first event."""
    m = k + n
    zero = jnp.zeros(())
    none = Row(jnp.zeros(2 * k), jnp.zeros(m), zero)
    return Trace(
        on_matrix=jnp.zeros((m, m)),
        on_pull=jnp.zeros(m),
        impulse=none,
        instance=jnp.arange(k),
        sticks=jnp.asarray(0),
        held=Row(jnp.zeros((k, 2 * k)), jnp.zeros((k, m)), jnp.zeros(k)),
        fields=jnp.zeros((k, m)),
        load=jnp.zeros(k),
        event=none,
    )


def along(
    trace: Trace, system: System, at: Tableau, tau: Array, origin: ContactState, sense: Array
) -> Trace:
    """Trace after the stretch from the tableau's tau to the next event."""
    step, middle = sense * (tau - at.tau), 0.5 * (at.tau + tau)
    load = origin.force + sense * middle
    fields, reactions = at.fields(middle, origin.v)
    row = _answer(trace, system, at, at.rate.size - 1, reactions)
    forces = step * row.forces
    return trace._replace(
        on_matrix=trace.on_matrix + forces[:, None] * fields,
        on_pull=trace.on_pull + step * fields - load * forces,
        impulse=trace.impulse.plus(row, step),
    )


def at_event(
    trace: Trace,
    system: System,
    at: Tableau,
    kind: Array,
    node: Array,
    origin: ContactState,
    sense: Array,
) -> Trace:
    """Trace after an event, whose tableau still stands before it."""
    k = at.sigma.size
    fields, reactions = at.fields(at.tau, origin.v)
    tangential, normal = jnp.minimum(node, k - 1), k + node
    side = jnp.where(kind == ALONG, 1.0, jnp.where(kind == AGAINST, -1.0, 0.0))
    # An event's condition is an answer that vanishes: mu r_n + side r_t where a node slips.
    share = jnp.where(side == 0.0, 1.0, system.friction)
    condition = _answer(trace, system, at, normal, reactions)
    condition = Row(*(share * part for part in condition))
    direct = condition.forces.at[normal].add(jnp.where(kind == CLOSE, 0.0, share))
    condition = condition._replace(
        forces=direct.at[tangential].add(side),
        friction=condition.friction + jnp.where(side == 0.0, 0.0, reactions[tangential]),
    ).plus(_answer(trace, system, at, tangential, reactions), side)
    rate = share * at.rate[normal] + side * at.rate[tangential]
    sticks = kind == STICK
    delay = Row(*(-part / jnp.where(sticks, 1.0, rate) for part in condition))
    event = Row(*(jnp.where(sticks, a, b) for a, b in zip(trace.event, delay, strict=True)))
    # The slip that a node sticks at changes with the load of the event that made it stick.
    slip = _answer(trace, system, at, tangential, reactions)
    slip = slip.plus(trace.event, at.rate[tangential])
    number = jnp.where(sticks, trace.sticks, k)  # beyond the end where it does not stick
    held = (a.at[number].set(b, mode="drop") for a, b in zip(trace.held, slip, strict=True))
    return trace._replace(
        instance=trace.instance.at[tangential].set(
            jnp.where(sticks, k + trace.sticks, trace.instance[tangential])
        ),
        sticks=trace.sticks + sticks,
        held=Row(*held),
        fields=trace.fields.at[number].set(fields, mode="drop"),
        load=trace.load.at[number].set(origin.force + sense * at.tau, mode="drop"),
        event=event,
    )


def _answer(
    trace: Trace, system: System, at: Tableau, number: Array | int, reactions: Array
) -> Row:
    """Row of an answer, without what a change of forces adds to it directly."""
    k = at.sigma.size
    row = at.matrix[number]
    slips = jnp.where(at.sigma == 0.0, 0.0, row[:k])
    sticks = jnp.where(at.sigma == 0.0, row[:k], 0.0)
    resisted = at.sigma * system.friction * slips
    # Not .at[:k], whose index is a constant that custom batching refuses where k is the whole size.
    normal = jnp.where(at.opened, -row[k:], 0.0) - jnp.pad(resisted, (0, at.opened.size - k))
    return Row(
        held=jnp.zeros(2 * k).at[trace.instance].add(sticks),
        forces=jnp.concatenate([-slips, normal]),
        friction=-jnp.sum(slips * at.sigma * reactions[:k]),
    )


class Slopes(NamedTuple):
    """Slopes of a level: of its contact, lift and work."""

    state: ContactState
    lift: Array
    work: Array


def level_slopes(
    system: System,
    change: System,
    before: tuple[ContactState, Array],
    slip_change: Array,
    after: tuple[ContactState, Array],
    load_change: Array,
    at: Tableau,
    trace: Trace,
) -> Slopes:
    """Slopes of a level, linear in the changes.

    Parameters
    ----------
    system, change : equations and their change
    before, after : contact and lift at the start and at the end of the level
    slip_change : (k,) change of v at the start
    load_change : change of the load at the end
    at, trace : tableau at the end, and the events
    """
    k = at.sigma.size
    (first, first_lift), (last, lift) = before, after
    start = jnp.concatenate([first.v, first_lift])
    fields = jnp.concatenate([last.v, lift])
    held_again = lax.cond(
        trace.sticks > 0, _held_again, lambda _, slips, __: 0.0 * slips, change, slip_change, trace
    )
    slips = jnp.concatenate([slip_change, held_again])

    forces = change.matrix @ fields - change.pull * last.force + change.reference
    push = forces - system.pull * load_change
    stuck = slips[trace.instance]
    sum_of_both = push[:k] + at.sigma * (
        change.friction * last.r_n[:k] + system.friction * push[k : 2 * k]
    )
    free = jnp.where(at.opened, -push[k:], 0.0)
    held = jnp.concatenate([jnp.where(at.sigma == 0.0, stuck, -sum_of_both), free])
    answer = at.matrix[:-1] @ held
    dv = jnp.where(at.sigma == 0.0, stuck, answer[:k])
    dw = jnp.where(at.opened, answer[k:], 0.0)
    dq = jnp.concatenate([dv, dw])
    dr = push + system.matrix @ dq

    impulse = (
        jnp.vdot(trace.on_matrix, change.matrix)
        + trace.on_pull @ change.pull
        + trace.impulse.forces @ change.reference
        + trace.impulse.held @ slips
        + trace.impulse.friction * change.friction
    )

    def energy(q: Array, force: Array) -> Array:
        inner = 0.5 * q @ change.matrix @ q
        return force * (change.pull @ q) - inner - change.reference @ q

    work = energy(fields, last.force) - last.r_t @ dv - impulse
    work = work - energy(start, first.force) + first.r_t @ slip_change
    none = jnp.zeros_like(load_change)  # a path's displacement follows from its fields
    state = ContactState(dv, dr[:k], jnp.where(at.opened, 0.0, dr[k:]), load_change, none)
    return Slopes(state, dw, work)


def _held_again(change: System, slip_change: Array, trace: Trace) -> Array:
    """Changes (k,) of the slips held since the stick events of a level.

    NaN where there are more events than are recorded.
    """
    k = slip_change.size
    forces = trace.fields @ change.matrix - trace.load[:, None] * change.pull + change.reference
    sides = trace.held.held[:, :k] @ slip_change + trace.held.friction * change.friction
    sides = sides + jnp.sum(trace.held.forces * forces, axis=1)
    # Each depends on those of earlier events only.
    order = jnp.eye(k) - trace.held.held[:, k:]
    recorded = jnp.where(trace.sticks > k, jnp.nan, 1.0)
    return recorded * (inverse_unit_lower(order) @ sides)

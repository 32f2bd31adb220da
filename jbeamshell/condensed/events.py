"""Load paths event by event: contact that slips in any order, sticks again, opens and closes.

Between two events all changes are linear in the load.  A tableau holds what answers, row by row,

    answer = value + rate tau + sum over what is held (matrix . held),

with tau the load since the last reversal.  A node that sticks holds its slip and answers with its
tangential force r_t; one that slips holds r_t + sigma mu r_n at zero and answers with its slip.  A
closed node holds its lift and answers with its reaction r_n; an open one the reverse.  At an event
one row and one column are exchanged (a principal pivot, as in parametric complementarity: Cottle,
Pang & Stone 1992, chapter 4), so that an event costs a product of two vectors, and the path is
exact in time.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array, lax

from jbeamshell.condensed.body import Body
from jbeamshell.condensed.branches import ContactState

MOST_EVENTS = 40  # of a load step, times the nodes


class Tableau(NamedTuple):
    """Contact between two events; k nodes may slip, n may lift.

    Rows and columns are the k tangential and the n normal ones; the last row of the matrix and of
    the vectors is the displacement of the loaded end.

    Attributes
    ----------
    matrix : (k + n + 1, k + n)
    value, rate : (k + n + 1,) answers at tau = 0, and per tau
    sigma : (k,) 1 and -1 for nodes that slip along and against v, 0 for those that stick
    opened : (n,) True for open nodes
    held : (k,) slip at which sticking nodes are held, since the reversal
    tau : load since the reversal, positive
    work : work of friction since the reversal
    events : count since the reversal
    """

    matrix: Array
    value: Array
    rate: Array
    sigma: Array
    opened: Array
    held: Array
    tau: Array
    work: Array
    events: Array


def reversed_at(
    body: Body, friction: Array, state: ContactState, lift: Array, sense: Array
) -> Tableau:
    """Tableau at a reversal: all closed nodes stick, open ones stay open."""
    k, n = body.f_t.size, body.r_0.size
    matrix = jnp.block([[body.K_tt, body.K_tn], [body.K_tn.T, body.K_nn]])
    pull = jnp.concatenate([body.f_t, body.f_n])
    zero = jnp.zeros_like(state.displacement)
    start = Tableau(
        matrix=jnp.concatenate([matrix, pull[None]]),
        value=jnp.concatenate([state.r_t, state.r_n, state.displacement[None]]),
        rate=sense * jnp.append(-pull, body.c),
        sigma=jnp.zeros(k),
        opened=jnp.zeros(n, bool),
        held=jnp.zeros(k),
        tau=zero,
        work=zero,
        events=jnp.asarray(0),
    )
    wanted = lift > 0.0

    def open_next(at: Tableau) -> Tableau:
        i = jnp.argmax(wanted & ~at.opened)
        tangential = jnp.minimum(i, k - 1)
        slid = _slip(at, tangential, friction, 1.0)
        at = _exchange(jax.tree.map(lambda a, b: jnp.where(i < k, a, b), slid, at), k + i)
        return at._replace(opened=at.opened.at[i].set(True))

    found = lax.while_loop(lambda at: jnp.any(wanted & ~at.opened), open_next, start)
    return found._replace(value=found.value.at[k : k + n].add(jnp.where(wanted, lift, 0.0)))


def advance(at: Tableau, friction: Array, tau: Array) -> tuple[Tableau, Array]:
    """Tableau at a later tau of the same branch, and True if its events came to an end."""
    n = at.opened.size

    def unfinished(both: tuple[Tableau, Array]) -> Array:
        at, done = both
        return ~done & (at.events < MOST_EVENTS * n)

    def go(both: tuple[Tableau, Array]) -> tuple[Tableau, Array]:
        at, _ = both
        when, which, kind = _next_event(at, friction)
        reached = jnp.minimum(when, tau)
        at = at._replace(work=at.work + _work(at, friction, reached), tau=reached)
        done = when >= tau
        changed = lax.switch(
            kind, (_slip_along, _slip_against, _stick, _open, _close), at, which, friction
        )
        changed = changed._replace(events=at.events + 1)
        return jax.tree.map(lambda a, b: jnp.where(done, a, b), at, changed), done

    return lax.while_loop(unfinished, go, (at, jnp.asarray(False)))


def state_at(
    at: Tableau, friction: Array, start: ContactState, sense: Array
) -> tuple[ContactState, Array]:
    """Contact and lift at a tableau's tau; ``start`` is the contact at the reversal."""
    k, n = at.sigma.size, at.opened.size
    now = at.value + at.rate * at.tau
    normal = now[k : k + n]
    reaction, lift = jnp.where(at.opened, 0.0, normal), jnp.where(at.opened, normal, 0.0)
    tangential = jnp.where(at.sigma == 0.0, now[:k], -at.sigma * friction * reaction[:k])
    slip = jnp.where(at.sigma == 0.0, at.held, now[:k])
    force = start.force + sense * at.tau
    return ContactState(start.v + slip, tangential, reaction, force, now[-1]), lift


def _next_event(at: Tableau, friction: Array) -> tuple[Array, Array, Array]:
    """Tau, node and kind of the next event: slip along, slip against, stick, open, close."""
    k, n = at.sigma.size, at.opened.size
    now = at.value + at.rate * at.tau
    normal, rate = now[k : k + n], at.rate[k : k + n]

    def until(room: Array, change: Array, counts: Array) -> Array:
        falling = counts & (change < 0.0)
        wait = jnp.maximum(room, 0.0) / jnp.where(falling, -change, 1.0)
        return jnp.where(falling, wait, jnp.inf)

    sticks = (at.sigma == 0.0) & ~at.opened[:k]
    slips = (at.sigma != 0.0) & ~at.opened[:k]
    cap, cap_rate = friction * normal[:k], friction * rate[:k]
    waits = [
        until(cap + now[:k], cap_rate + at.rate[:k], sticks),
        until(cap - now[:k], cap_rate - at.rate[:k], sticks),
        jnp.where(slips & (at.sigma * at.rate[:k] < 0.0), 0.0, jnp.inf),
        until(normal, rate, ~at.opened & jnp.append(at.sigma != 0.0, jnp.ones(n - k, bool))),
        until(normal, rate, at.opened),
    ]
    first = jnp.stack([jnp.min(wait) for wait in waits])
    kind = jnp.argmin(first)
    which = jnp.stack([jnp.argmin(wait) for wait in waits])[kind]
    return at.tau + first[kind], which, kind


def _work(at: Tableau, friction: Array, tau: Array) -> Array:
    """Work of friction from the tableau's tau to a later one without an event between."""
    k = at.sigma.size
    step = tau - at.tau
    middle = at.value + at.rate * (at.tau + 0.5 * step)
    closed = (at.sigma != 0.0) & ~at.opened[:k]
    return (
        jnp.sum(jnp.where(closed, at.sigma * friction * middle[k : 2 * k] * at.rate[:k], 0.0))
        * step
    )


def _exchange(at: Tableau, i: Array) -> Tableau:
    """Tableau with row and column ``i`` exchanged."""
    row, column = at.matrix[i], at.matrix[:, i]
    pivot = row[i]
    share = (column / pivot).at[i].set(0.0)
    matrix = at.matrix - share[:, None] * row
    matrix = matrix.at[:, i].set(share).at[i].set(-row / pivot).at[i, i].set(1.0 / pivot)
    value, rate = at.value[i], at.rate[i]
    return at._replace(
        matrix=matrix,
        value=(at.value - share * value).at[i].set(-value / pivot),
        rate=(at.rate - share * rate).at[i].set(-rate / pivot),
    )


def _add_row(at: Tableau, i: Array, other: Array, factor: Array) -> Tableau:
    """Tableau with a multiple of another row added to row ``i``."""
    return at._replace(
        matrix=at.matrix.at[i].add(factor * at.matrix[other]),
        value=at.value.at[i].add(factor * at.value[other]),
        rate=at.rate.at[i].add(factor * at.rate[other]),
    )


def _slip(at: Tableau, i: Array, friction: Array, sigma: float) -> Tableau:
    k = at.sigma.size
    at = _exchange(_add_row(at, i, k + i, sigma * friction), i)
    return at._replace(
        sigma=at.sigma.at[i].set(sigma),
        value=at.value.at[i].add(at.held[i]),
        held=at.held.at[i].set(0.0),
    )


def _slip_along(at: Tableau, i: Array, friction: Array) -> Tableau:
    return _slip(at, i, friction, 1.0)


def _slip_against(at: Tableau, i: Array, friction: Array) -> Tableau:
    return _slip(at, i, friction, -1.0)


def _stick(at: Tableau, i: Array, friction: Array) -> Tableau:
    """Tableau in which node ``i`` sticks where it is."""
    k, sigma = at.sigma.size, at.sigma[i]
    slip = at.value[i] + at.rate[i] * at.tau
    at = at._replace(value=at.value.at[i].add(-slip))
    at = _add_row(_exchange(at, i), i, k + i, -sigma * friction)
    return at._replace(sigma=at.sigma.at[i].set(0.0), held=at.held.at[i].set(slip))


def _open(at: Tableau, i: Array, friction: Array) -> Tableau:
    at = _exchange(at, at.sigma.size + i)
    return at._replace(opened=at.opened.at[i].set(True))


def _close(at: Tableau, i: Array, friction: Array) -> Tableau:
    at = _exchange(at, at.sigma.size + i)
    return at._replace(opened=at.opened.at[i].set(False))


class Level(NamedTuple):
    """A load level of a path: the contact, its lift, and what happened since the level before.

    Attributes
    ----------
    state : contact
    lift : (n,) lift w
    slip_work : work of friction in the step
    slipping : (k,) True for nodes that slip at its end
    settled : True if all events up to here were found
    """

    state: ContactState
    lift: Array
    slip_work: Array
    slipping: Array
    settled: Array


def walk(body: Body, friction: Array, start: ContactState, forces: Array, turns: Array) -> Level:
    """Levels of a load path, stacked along the first axis.

    Parameters
    ----------
    body : n contact nodes
    friction : mu
    start : contact without lift at the path's start
    forces : (levels,) end loads
    turns : (levels,) True where the load has turned since the level before
    """

    def go(carry: tuple[Tableau, ContactState, Level], to: tuple[Array, Array]) -> tuple:
        at, origin, last = carry
        force, turned = to
        sense = jnp.where(force >= last.state.force, 1.0, -1.0)
        at, origin = lax.cond(
            turned,
            lambda: (reversed_at(body, friction, last.state, last.lift, sense), last.state),
            lambda: (at, origin),
        )
        after, settled = advance(at, friction, jnp.abs(force - origin.force))
        state, lift = state_at(after, friction, origin, jnp.sign(force - origin.force))
        level = Level(state, lift, after.work - at.work, after.sigma != 0.0, last.settled & settled)
        return (after, origin, level), level

    none = jnp.zeros_like(start.v, bool)
    lift = jnp.zeros_like(start.r_n)
    first = Level(start, lift, start.force * 0.0, none, jnp.asarray(True))
    tableau = reversed_at(body, friction, start, lift, jnp.ones_like(start.force))
    return lax.scan(go, (tableau, start, first), (forces, turns))[1]

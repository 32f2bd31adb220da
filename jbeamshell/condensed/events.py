"""Load paths event by event: contact that slips in any order, sticks again, opens and closes.

Between two events everything is linear in the load (see `tableau`), so that a path is exact in
time: load levels only say where it is looked at.  Derivatives of the levels are exact as well, see
`slopes`.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jax.typing import ArrayLike
from jaxtyping import PyTree

from jbeamshell.condensed import slopes
from jbeamshell.condensed.body import Body
from jbeamshell.condensed.branches import ContactState
from jbeamshell.condensed.slopes import Trace
from jbeamshell.condensed.tableau import OPEN, System, Tableau, changed, empty, reversed_at

MOST_EVENTS = 40  # of a load branch, times the nodes
SLIDES = 1e6  # compliance over that of the clamped contact at which a body slides as a whole


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


class Walk(NamedTuple):
    """Tableau between two events, the next one, and the trace of those before if there is one."""

    at: Tableau
    event: Event
    trace: Trace | None


def walk(
    body: Body,
    friction: Array,
    start: ContactState,
    forces: Array,
    turns: ArrayLike | tuple[bool, ...],
    lift: Array | None = None,
    needed: Array | bool = True,
    *,
    lifting: int | None = None,
) -> Level:
    """Levels of a load path, stacked along the first axis.

    First derivatives are exact, forward and reverse.

    Parameters
    ----------
    body : n contact nodes
    friction : mu
    start : contact at the path's start
    forces : (levels,) end loads
    turns : (levels,) True where the load has turned since the level before; so is the first
    lift : (n,) lift at the start; None is none
    needed : False to leave out the walk at no cost; its levels mean nothing then
    lifting : number of nodes that may lift off, from the loaded end, which is quicker if few do;
        from where another one opens levels are not settled; None is all

    Returns
    -------
    Level
        with the axis of the levels first
    """
    lift = jnp.zeros_like(start.r_n) if lift is None else lift
    turns, needed = jnp.asarray(turns), jnp.asarray(needed)
    given = body, jnp.asarray(friction), start, forces, lift
    return _walk(*given, turns=turns, needed=needed, lifting=lifting)


@eqx.filter_custom_jvp
def _walk(
    body: Body,
    friction: Array,
    start: ContactState,
    forces: Array,
    lift: Array,
    *,
    turns: Array,
    needed: Array,
    lifting: int | None,
) -> Level:
    return _lane_by_lane(lifting)(body, friction, start, forces, lift, turns, needed)


@_walk.def_jvp
def _walk_jvp(
    primals: tuple[PyTree, ...],
    tangents: tuple[PyTree, ...],
    *,
    turns: Array,
    needed: Array,
    lifting: int | None,
) -> tuple[Level, Level]:
    changes = tuple(jax.tree.map(_full, *both) for both in zip(primals, tangents, strict=True))
    path = functools.partial(_differentiable, turns=turns, needed=needed)
    return jax.jvp(path, primals, changes)


@functools.cache
def _lane_by_lane(lifting: int | None) -> Callable[..., Level]:
    """Levels of a path; in a batch one lane after the other, which a loop in step is slower than.

    Lanes that need no walk cost nothing.
    """
    path = functools.partial(_differentiable, lifting=lifting)

    @jax.custom_batching.sequential_vmap
    def lane(*given: PyTree) -> Level:
        def nothing() -> Level:
            shapes = jax.eval_shape(path, *given)
            return jax.tree.map(lambda like: jnp.zeros(like.shape, like.dtype), shapes)

        needed = given[-1]
        return lax.cond(needed, lambda: path(*given), nothing)

    return lane


def _differentiable(
    body: Body,
    friction: Array,
    start: ContactState,
    forces: Array,
    lift: Array,
    turns: Array,
    needed: Array,
    lifting: int | None = None,
) -> Level:
    """Levels of a path, level by level differentiable; see `walk`."""
    k, n = start.v.size, lift.size
    lifting = n if lifting is None else lifting
    matrix = jnp.block([[body.K_tt, body.K_tn], [body.K_tn.T, body.K_nn]])
    pull = jnp.concatenate([body.f_t, body.f_n])
    forces_then = jnp.concatenate([start.r_t, start.r_n]) + pull * start.force
    reference = forces_then - matrix @ jnp.concatenate([start.v, lift])
    system = System(matrix, pull, body.c, friction, reference)
    none = jnp.zeros_like(start.v, bool)
    down = jnp.all(lift[lifting:] <= 0.0)
    first = Level(start, lift, jnp.zeros_like(body.c), none, down)

    def go(
        carry: tuple[Tableau, ContactState, Level], to: tuple[Array, Array]
    ) -> tuple[tuple[Tableau, ContactState, Level], Level]:
        at, origin, last = carry
        force, turned = to
        origin = jax.tree.map(lambda new, old: jnp.where(turned, new, old), last.state, origin)
        origin = lax.stop_gradient(origin)
        at, level = _next_level(
            system, last, force, at=at, origin=origin, turned=turned, needed=needed
        )
        return (lax.stop_gradient(at), origin, level), level

    carry = (empty(k, n, lifting), lax.stop_gradient(start), first)
    found = lax.scan(go, carry, (forces, turns))[1]
    moved = jnp.concatenate([found.state.v - start.v, found.lift - lift], axis=1)
    displacement = start.displacement + body.c * (forces - start.force) + moved @ pull
    return found._replace(state=found.state._replace(displacement=displacement))


@jax.custom_batching.sequential_vmap
def _run(
    system: System,
    last: Level,
    force: Array,
    at: Tableau,
    origin: ContactState,
    turned: Array,
    needed: Array,
    trace: Trace | None,
) -> tuple[Tableau, Level, Trace | None]:
    """Tableau and level at a load, and the trace of the events on the way if one is begun."""
    sense = jnp.where(force >= origin.force, 1.0, -1.0)
    tau = jnp.abs(force - origin.force)

    def turn(both: tuple[Tableau, Array]) -> tuple[Tableau, Array]:
        return reversed_at(system, last.state, last.lift, sense, at.lifting), jnp.asarray(False)

    # Loops that run once: in a batch they cost nothing where no lane needs them.
    at, _ = lax.while_loop(lambda both: both[1], turn, (at, turned & needed))
    done = at.work

    def unfinished(now: Walk) -> Array:
        few = now.at.events < MOST_EVENTS * now.at.opened.size
        able = (now.event.kind != OPEN) | (now.event.node < now.at.lifting)
        return needed & (now.event.tau < tau) & few & able

    def go(now: Walk) -> Walk:
        event, trace = now.event, now.trace
        if trace is not None:
            trace = slopes.along(trace, system, now.at, event.tau, origin, sense)
        at = _moved(now.at, system.friction, event.tau)
        if trace is not None:
            trace = slopes.at_event(trace, system, at, event.kind, event.node, origin, sense)
        at = changed(at, event.kind, event.node, system.friction)
        return Walk(at, _next_event(at, system.friction), trace)

    at, event, trace = lax.while_loop(
        unfinished, go, Walk(at, _next_event(at, system.friction), trace)
    )
    if trace is not None:
        trace = slopes.along(trace, system, at, tau, origin, sense)
    at = _moved(at, system.friction, tau)
    state, lift = _state(at, system.friction, origin, force)
    held = jnp.abs(at.rate[-1]) < SLIDES * jnp.abs(system.c)
    settled = last.settled & (event.tau >= tau) & held
    slipping = (at.sigma != 0.0) & ~at.opened[: at.sigma.size]
    return at, Level(state, lift, at.work - done, slipping, settled), trace


@eqx.filter_custom_jvp
def _next_level(
    system: System,
    last: Level,
    force: Array,
    *,
    at: Tableau,
    origin: ContactState,
    turned: Array,
    needed: Array,
) -> tuple[Tableau, Level]:
    """Tableau and level at a load, from the level before and the contact at the reversal."""
    at, level, _ = _run(system, last, force, at, origin, turned, needed, None)
    return at, level


@_next_level.def_jvp
def _next_level_jvp(
    primals: tuple[System, Level, Array],
    tangents: tuple[System, Level, Array],
    *,
    at: Tableau,
    origin: ContactState,
    turned: Array,
    needed: Array,
) -> tuple[tuple[Tableau, Level], tuple[Tableau, Level]]:
    (system, last, force), (change, last_change, force_change) = primals, tangents
    k, n = last.state.v.size, last.lift.size
    begun = slopes.begun(k, n)
    at, level, trace = _run(system, last, force, at, origin, turned, needed, begun)
    assert trace is not None
    found = slopes.level_slopes(
        system,
        System(*(_full(a, b) for a, b in zip(system, change, strict=True))),
        before=(last.state, last.lift),
        slip_change=_full(last.state.v, last_change.state.v),
        after=(level.state, level.lift),
        load_change=_full(force, force_change),
        at=at,
        trace=trace,
    )
    nothing, change_of_level = jax.tree.map(lambda _: None, (at, level))
    change_of_level = change_of_level._replace(
        state=found.state, lift=found.lift, slip_work=found.work
    )
    return (at, level), (nothing, change_of_level)


def _full(like: Array, change: Array | None) -> Array:
    return jnp.zeros_like(like) if change is None else change


def _moved(at: Tableau, friction: Array, tau: Array) -> Tableau:
    """Tableau at a later tau without an event between."""
    k = at.sigma.size
    step = tau - at.tau
    middle = at.at(at.tau + 0.5 * step)
    closed = (at.sigma != 0.0) & ~at.opened[:k]
    power = jnp.where(closed, at.sigma * friction * middle[k : 2 * k] * at.rate[:k], 0.0)
    return at._replace(work=at.work + jnp.sum(power) * step, tau=tau)


def _state(
    at: Tableau, friction: Array, origin: ContactState, force: Array
) -> tuple[ContactState, Array]:
    """Contact and lift at a tableau's tau; ``origin`` is the contact at the reversal."""
    k = at.sigma.size
    fields, reaction = at.fields(at.tau, origin.v)
    now = at.at(at.tau)
    traction = jnp.where(at.sigma == 0.0, now[:k], -at.sigma * friction * reaction[:k])
    return ContactState(fields[:k], traction, reaction, force, now[-1]), fields[k:]


def _next_event(at: Tableau, friction: Array) -> Event:
    """Next event of a stretch."""
    k, n = at.sigma.size, at.opened.size
    now, rate = at.at(at.tau), at.rate
    force, force_rate = now[:k], rate[:k]  # slip where a node slips
    normal, normal_rate = now[k : k + n], rate[k : k + n]

    def until(room: Array, change: Array, counts: Array) -> Array:
        falling = counts & (change < 0.0)
        wait = jnp.maximum(room, 0.0) / jnp.where(falling, -change, 1.0)
        return jnp.where(falling, wait, jnp.inf)

    sticks = (at.sigma == 0.0) & ~at.opened[:k]
    slips = (at.sigma != 0.0) & ~at.opened[:k]
    cap, cap_rate = friction * normal[:k], friction * normal_rate[:k]
    loose = ~at.opened & jnp.append(at.sigma != 0.0, jnp.ones(n - k, bool))
    waits = [  # in the order of the kinds
        until(cap + force, cap_rate + force_rate, sticks),
        until(cap - force, cap_rate - force_rate, sticks),
        jnp.where(slips & (at.sigma * force_rate < 0.0), 0.0, jnp.inf),
        until(normal, normal_rate, loose),
        until(normal, normal_rate, at.opened),
    ]
    first = jnp.stack([jnp.min(wait) for wait in waits])
    kind = jnp.argmin(first)
    node = jnp.stack([jnp.argmin(wait) for wait in waits])[kind]
    return Event(at.tau + first[kind], kind, node)

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

from jbeamshell.contact_line import abreast, slopes
from jbeamshell.contact_line.body import Body
from jbeamshell.contact_line.branches import ContactState
from jbeamshell.contact_line.slopes import Slopes, Trace
from jbeamshell.contact_line.stretch import Event, Level, ended, goes_on, moved, next_event
from jbeamshell.contact_line.tableau import STICK, System, Tableau, changed, empty, reversed_at

PARTS = 4  # traces of a level at most


class Walk(NamedTuple):
    """Tableau between two events, the next one, and the trace of those before if there is one."""

    at: Tableau
    event: Event
    trace: Trace | None


class Part(NamedTuple):
    """Part of a level that one trace holds: tableau and level at its end, and their slopes."""

    at: Tableau
    level: Level
    change: Slopes


def walk(
    body: Body,
    friction: Array,
    start: ContactState,
    forces: Array,
    turns: ArrayLike | tuple[bool, ...],
    lift: Array | None = None,
    needed: Array | None = None,
    *,
    alike: bool = True,
) -> Level:
    """Levels of a load path, stacked along the first axis.

    First derivatives are exact, forward and reverse.

    Parameters
    ----------
    body : n contact nodes
    friction : mu
    start : contact at the path's start
    forces : (levels,) end loads
    turns : (levels,) True where the load has turned since the level before; so is the first.  Many
        loads on one body (`jax.vmap`) share events if it is a tuple, see `abreast`
    lift : (n,) lift at the start; None is none
    needed : False to leave out the walk at no cost; its levels mean nothing then.  None is True,
        and compiles quicker
    alike : False if other loads on one body meet other events, so that none are shared

    Returns
    -------
    Level
        with the axis of the levels first
    """
    lift = jnp.zeros_like(start.r_n) if lift is None else lift
    path = body, jnp.asarray(friction), start, forces, lift
    return _walk(*path, turns=turns, needed=needed, alike=alike)


@eqx.filter_custom_jvp
def _walk(
    body: Body,
    friction: Array,
    start: ContactState,
    forces: Array,
    lift: Array,
    *,
    turns: ArrayLike | tuple[bool, ...],
    needed: Array | None,
    alike: bool,
) -> Level:
    known_turns = turns if isinstance(turns, tuple) else None
    path = body, friction, start, forces, lift, jnp.asarray(turns), needed
    return _one_or_many(known_turns, alike)(*path)


@_walk.def_jvp
def _walk_jvp(
    primals: tuple[PyTree, ...],
    tangents: tuple[PyTree, ...],
    *,
    turns: ArrayLike | tuple[bool, ...],
    needed: Array | None,
    alike: bool,
) -> tuple[Level, Level]:
    changes = tuple(jax.tree.map(_full, *pair) for pair in zip(primals, tangents, strict=True))
    turns = jnp.asarray(turns)
    path = functools.partial(_differentiable, turns=turns, needed=needed)
    return jax.jvp(path, primals, changes)


@functools.cache
def _one_or_many(known_turns: tuple[bool, ...] | None, alike: bool) -> Callable[..., Level]:
    """Levels of a path.

    Loads on one body walk together, if they meet alike events, their turns are known, and that
    pays.  Other lanes of a batch run one after the other, which a loop in step is slower than.
    Lanes that need no walk cost nothing.
    """

    def together(*inputs: PyTree) -> Level:
        assert known_turns is not None
        body, friction, start, forces, lift, _, needed = inputs
        system = _system(body, friction, jnp.zeros(()))
        path = functools.partial(abreast.walk_abreast, system, start, forces, lift, known_turns)
        return _if_needed(needed, path)

    @jax.custom_batching.custom_vmap
    def lane(*inputs: PyTree) -> Level:
        if known_turns is None:
            return _if_needed(inputs[-1], lambda: _differentiable(*inputs))
        body, friction, *at, turns, needed = inputs
        one = jax.tree.map(lambda a: a[None], at)
        return jax.tree.map(lambda a: a[0], together(body, friction, *one, turns, needed))

    @lane.def_vmap
    def lanes(size: int, batched: list[PyTree], *inputs: PyTree) -> tuple[Level, Level]:
        own_body, own_friction, *_, own_turns, own_need = (_any(part) for part in batched)
        differ = own_body or own_friction or own_turns or own_need
        if known_turns is None or differ or not (alike and abreast.pays(known_turns)):
            mapped, shared = eqx.partition(list(inputs), batched)
            levels = lax.map(lambda some: lane(*eqx.combine(some, shared)), mapped)
        else:
            at = jax.tree.map(
                lambda a, batch: a if batch else jnp.broadcast_to(a, (size, *a.shape)),
                list(inputs[2:5]),
                batched[2:5],
            )
            levels = together(*inputs[:2], *at, *inputs[5:])
        return levels, jax.tree.map(lambda _: True, levels)

    return lane


def _any(batched: PyTree) -> bool:
    return any(jax.tree.leaves(batched))


def _if_needed(needed: Array | None, path: Callable[[], Level]) -> Level:
    """Levels of a path, or zeros at no cost."""
    if needed is None:
        return path()

    def nothing() -> Level:
        return jax.tree.map(lambda a: jnp.zeros(a.shape, a.dtype), jax.eval_shape(path))

    return lax.cond(needed, path, nothing)


def _system(body: Body, friction: Array, reference: Array) -> System:
    matrix = jnp.block([[body.K_tt, body.K_tn], [body.K_tn.T, body.K_nn]])
    return System(matrix, jnp.concatenate([body.f_t, body.f_n]), body.c, friction, reference)


def _differentiable(
    body: Body,
    friction: Array,
    start: ContactState,
    forces: Array,
    lift: Array,
    turns: Array,
    needed: Array | None,
) -> Level:
    """Levels of a path, level by level differentiable; see `walk`."""
    needed = jnp.asarray(True) if needed is None else needed
    k, n = start.v.size, lift.size
    system = _system(body, friction, start.force)
    forces_then = jnp.concatenate([start.r_t, start.r_n]) + system.pull * start.force
    reference = forces_then - system.matrix @ jnp.concatenate([start.v, lift])
    system = system._replace(reference=reference)
    none = jnp.zeros_like(start.v, bool)
    first = Level(start, lift, jnp.zeros_like(body.c), none, jnp.asarray(True))

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

    carry = (empty(k, n), lax.stop_gradient(start), first)
    levels = lax.scan(go, carry, (forces, turns))[1]
    change = jnp.concatenate([levels.state.v - start.v, levels.lift - lift], axis=1)
    displacement = start.displacement + body.c * (forces - start.force) + change @ system.pull
    return levels._replace(state=levels.state._replace(displacement=displacement))


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
    stops: Array,
) -> tuple[Tableau, Level, Trace | None]:
    """Tableau and level at a load, and the trace of the events on the way if one is begun.

    If it ``stops``, the level is that where the trace is full, and may come before the load.
    """
    sense = jnp.where(force >= origin.force, 1.0, -1.0)
    tau = jnp.abs(force - origin.force)

    def turn(now: tuple[Tableau, Array]) -> tuple[Tableau, Array]:
        start = reversed_at(system, last.state, last.lift, last.lift > 0.0, sense)
        return start, jnp.asarray(False)

    # Loops that run once: in a batch they cost nothing where no lane needs them.
    at, _ = lax.while_loop(lambda now: now[1], turn, (at, turned & needed))
    work_before = at.work

    def full(now: Walk) -> Array:
        # What sticks at once belongs to the event before, and to one trace with it.
        if now.trace is None:
            return jnp.asarray(False)
        return stops & slopes.is_full(now.trace) & (now.event.kind != STICK)

    def unfinished(now: Walk) -> Array:
        return needed & (now.event.tau < tau) & goes_on(now.at) & ~full(now)

    def go(now: Walk) -> Walk:
        event, trace = now.event, now.trace
        if trace is not None:
            trace = slopes.along(trace, system, now.at, event.tau, origin, sense)
        at = moved(now.at, system.friction, event.tau)
        if trace is not None:
            trace = slopes.at_event(trace, system, at, event.kind, event.node, origin, sense)
        at = changed(at, event.kind, event.node, system.friction)
        return Walk(at, next_event(at, system.friction), trace)

    end = lax.while_loop(unfinished, go, Walk(at, next_event(at, system.friction), trace))
    at, event, trace = end
    if trace is not None:
        early = full(end) & (event.tau < tau)
        tau = jnp.where(early, at.tau, tau)
        force = jnp.where(early, origin.force + sense * tau, force)
        trace = slopes.along(trace, system, at, tau, origin, sense)
    at, level = ended(system, at, event.tau, last, origin, force)
    return at, level._replace(slip_work=level.slip_work - work_before), trace


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
    at, level, _ = _run(system, last, force, at, origin, turned, needed, None, jnp.asarray(False))
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
    change = System(*(_full(a, b) for a, b in zip(system, change, strict=True)))
    slip_change, force_change = _full(last.state.v, last_change.state.v), _full(force, force_change)
    k, n = last.state.v.size, last.lift.size

    def part(now: Part, turned: Array, stops: Array) -> Part:
        at, level, trace = _run(
            system, now.level, force, now.at, origin, turned, needed, slopes.begun(k, n), stops
        )
        assert trace is not None
        whole = level.state.force == force
        slope = slopes.level_slopes(
            system,
            change,
            before=(now.level.state, now.level.lift),
            slip_change=now.change.state.v,
            after=(level.state, level.lift),
            load_change=jnp.where(whole, force_change, 0.0),
            at=at,
            trace=trace,
        )
        level = level._replace(slip_work=now.level.slip_work + level.slip_work)
        return Part(at, level, slope._replace(work=now.change.work + slope.work))

    def parts(now: Part) -> Part:
        def go(carry: tuple[Part, Array], number: Array) -> tuple[tuple[Part, Array], None]:
            now, whole = carry
            now = lax.cond(
                whole, lambda: now, lambda: part(now, turned & (number == 0), number < PARTS - 1)
            )
            return (now, now.level.state.force == force), None

        return lax.scan(go, (now, jnp.asarray(False)), jnp.arange(PARTS))[0][0]

    none = jnp.zeros_like(last.slip_work)
    state = jax.tree.map(jnp.zeros_like, last.state)._replace(v=slip_change)
    start = Slopes(state, jnp.zeros_like(last.lift), none)
    # A reverse pass walks the parts again in place of keeping their traces.
    at, level, slope = jax.checkpoint(parts)(Part(at, last._replace(slip_work=none), start))
    nothing, changes = jax.tree.map(lambda _: None, (at, level))
    changes = changes._replace(state=slope.state, lift=slope.lift, slip_work=slope.work)
    return (at, level), (nothing, changes)


def _full(like: Array, change: Array | None) -> Array:
    return jnp.zeros_like(like) if change is None else change

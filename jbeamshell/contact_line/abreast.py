"""Load paths of many loads on one body, which share the events that they have in common.

What a tableau answers with depends on who sticks, slips and is open, not on the load: two loads
that meet the same events in the same order share its matrix and differ in one column.  So the
loads of a branch set out together.  The one that goes farthest leads: its next event is that of
all whose own next event it is.  Those with another one are left behind and set out again, led by
one of their own.

A branch that starts where the branch before the last one did, to the same loads, is copied: a
closed loop is walked once.
"""

from __future__ import annotations

import functools
import itertools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import PyTree

from jbeamshell.contact_line.branches import ContactState
from jbeamshell.contact_line.stretch import (
    Event,
    Level,
    ended,
    first_of,
    goes_on,
    moved,
    next_event,
    waits_of,
)
from jbeamshell.contact_line.tableau import System, Tableau, changed, reversed_at

FEW_LEVELS = 2  # of a branch, up to which loads walk together
SAME = 1e-12  # of a branch, within which events come at the same load
CLOSED = 1e-10  # of the largest slip, force or lift, within which a loop is closed
LOAD_AXES: Any = Tableau(None, 1, None, None, None, 1, 0, 0, None)  # type: ignore[arg-type]
"""Axes of the loads in a tableau: each has its own value, held slips, tau and work."""


class Group(NamedTuple):
    """Loads on their way along a branch.

    Attributes
    ----------
    at : tableau of those that walk together, of which each load has the parts `LOAD_AXES`
    walking, waiting : (loads,) True for them, and for all that have not arrived
    levels : those of all that have, (loads, ...)
    """

    at: Tableau
    walking: Array
    waiting: Array
    levels: Level


class Branch(NamedTuple):
    """Branch of many loads: levels (loads, ...) at its start, end loads and levels along it."""

    start: Level
    targets: Array
    levels: Level

    def starts_at(self, start: Level, targets: Array) -> Array:
        """True if another one with this start and these end loads is the same, in a closed loop."""
        one, other = ((level.state, level.lift) for level in (self.start, start))

        def close(a: Array, b: Array) -> Array:
            return jnp.max(jnp.abs(a - b)) <= CLOSED * jnp.max(jnp.abs(a))

        parts = [close(*pair) for pair in zip(*map(jax.tree.leaves, (one, other)), strict=True)]
        return jnp.all(self.targets == targets) & jnp.all(jnp.stack(parts))


def pays(turns: tuple[bool, ...]) -> bool:
    """True if many loads are quicker together: each level is a load of its own there."""
    return _longest(_bounds(turns)) <= FEW_LEVELS


def walk_abreast(
    system: System,
    start: ContactState,
    forces: Array,
    lift: Array,
    turns: tuple[bool, ...],
) -> Level:
    """Levels (loads, levels, ...) of the paths of many loads on one body; see `events.walk`.

    Parameters
    ----------
    system : equations of the body, whose reference is of no use here
    start, forces, lift : contact at the start (loads, ...), end loads (loads, levels), lift at the
        start (loads, n)
    turns : True where the loads have turned since the level before
    """
    loads = forces.shape[0]
    bounds = _bounds(turns)
    longest = _longest(bounds)

    none = jnp.zeros(start.v.shape, bool)
    begin = Level(start, lift, jnp.zeros_like(start.force), none, jnp.ones(loads, bool))
    parts = [forces[:, a:b] for a, b in itertools.pairwise(bounds)]
    branches = jnp.stack([_filled(part, longest) for part in parts])

    def go(carry: tuple[Level, Branch, Branch], targets: Array) -> tuple[PyTree, Level]:
        origin, before, older = carry

        def anew() -> Level:
            if loads == 1:
                levels = _alone(system, jax.tree.map(lambda a: a[0], origin), targets[0])
                return jax.tree.map(lambda a: a[None], levels._replace(slip_work=_steps(levels)))
            starts = jax.tree.map(lambda a: jnp.repeat(a, longest, axis=0), origin)
            levels = _branch(system, starts, targets.ravel())
            levels = jax.tree.map(lambda a: a.reshape(loads, longest, *a.shape[1:]), levels)
            return levels._replace(slip_work=_steps(levels))

        levels = lax.cond(older.starts_at(origin, targets), lambda: older.levels, anew)
        levels = levels._replace(settled=levels.settled & origin.settled[:, None])
        last = jax.tree.map(lambda a: a[:, -1], levels)
        return (last, Branch(origin, targets, levels), before), levels

    blank = jax.tree.map(lambda a: jnp.repeat(a[:, None], longest, axis=1), begin)
    nowhere = Branch(begin, jnp.full_like(branches[0], jnp.nan), blank)
    levels = lax.scan(go, (begin, nowhere, nowhere), branches)[1]

    def in_order(a: Array) -> Array:
        return jnp.concatenate([a[i, :, : part.shape[1]] for i, part in enumerate(parts)], axis=1)

    return jax.tree.map(in_order, levels)


def _bounds(turns: tuple[bool, ...]) -> list[int]:
    """First levels of the branches, and the number of all levels."""
    return [*(place for place, turned in enumerate(turns) if turned), len(turns)]


def _longest(bounds: list[int]) -> int:
    return max(b - a for a, b in itertools.pairwise(bounds))


def _filled(forces: Array, longest: int) -> Array:
    """End loads (loads, longest) of a branch that may be shorter; the last one fills it up."""
    return jnp.pad(forces, ((0, 0), (0, longest - forces.shape[1])), mode="edge")


def _branch(system: System, last: Level, forces: Array) -> Level:
    """Levels (loads, ...) at the end of one branch, with the work along it."""
    friction = system.friction
    sense = jnp.where(forces >= last.state.force, 1.0, -1.0)
    reach, opened = jnp.abs(forces - last.state.force), last.lift > 0.0

    def leader(among: Array) -> Array:
        return jnp.argmax(jnp.where(among, reach, -1.0))

    def set_out(now: tuple[Array, Level]) -> tuple[Array, Level]:
        waiting, levels = now
        first = leader(waiting)

        def begin(state: ContactState, lift: Array) -> Tableau:
            return reversed_at(system, state, lift, opened[first], sense[first])

        at = jax.vmap(begin, out_axes=LOAD_AXES)(last.state, last.lift)
        alike = (sense == sense[first]) & jnp.all(opened == opened[first], axis=1)
        group = Group(at, waiting & alike, waiting, levels)
        group = lax.while_loop(lambda now: jnp.any(now.walking), on, group)
        return group.waiting, group.levels

    def on(now: Group) -> Group:
        at, walking, waiting, levels = now
        waits = waits_of(at, friction)
        least = jnp.min(functools.reduce(jnp.minimum, waits), axis=0)
        arrival = at.tau + least
        first = leader(walking)
        _, kind, node = first_of([values[:, first] for values in waits])
        event = Event(arrival[first], kind, node)
        wait = jnp.stack([values[node] for values in waits])[kind]
        # Negations count loads without numbers in: the leader arrives in the end, whatever it is.
        follows = walking & ~(wait > least + SAME * reach)
        arrives = walking & (~(arrival < reach) | (follows & ~goes_on(at)))
        levels, _ = lax.while_loop(
            lambda now: jnp.any(now[1]), functools.partial(arrive, at, arrival), (levels, arrives)
        )
        walking = follows & ~arrives
        at = moved(at, friction, at.tau + jnp.where(walking, wait, 0.0))
        at = changed(at, event.kind, event.node, friction)
        return Group(at, walking, waiting & ~arrives, levels)

    def arrive(at: Tableau, arrival: Array, now: tuple[Level, Array]) -> tuple[Level, Array]:
        levels, arrives = now
        one = jnp.argmax(arrives)
        lone = at._replace(
            value=at.value[:, one], held=at.held[:, one], tau=at.tau[one], work=at.work[one]
        )
        before = jax.tree.map(lambda a: a[one], last)
        level = ended(system, lone, arrival[one], before, before.state, forces[one])[1]
        levels = jax.tree.map(lambda old, new: old.at[one].set(new), levels, level)
        return levels, arrives.at[one].set(False)

    everyone = jnp.ones_like(sense, bool)
    return lax.while_loop(lambda now: jnp.any(now[0]), set_out, (everyone, last))[1]


def _alone(system: System, last: Level, forces: Array) -> Level:
    """Levels (levels, ...) along a branch of one load, each with the work since its start."""
    friction, start = system.friction, last.state
    sense = jnp.where(forces[-1] >= start.force, 1.0, -1.0)

    def on(now: tuple[Tableau, Event]) -> tuple[Tableau, Event]:
        at, event = now
        at = changed(moved(at, friction, event.tau), event.kind, event.node, friction)
        return at, next_event(at, friction)

    def to(at: Tableau, force: Array) -> tuple[Tableau, Level]:
        tau = jnp.abs(force - start.force)

        def unfinished(now: tuple[Tableau, Event]) -> Array:
            return (now[1].tau < tau) & goes_on(now[0])

        at, event = lax.while_loop(unfinished, on, (at, next_event(at, friction)))
        return ended(system, at, event.tau, last, start, force)

    at = reversed_at(system, start, last.lift, last.lift > 0.0, sense)
    return lax.scan(to, at, forces)[1]


def _steps(levels: Level) -> Array:
    """Works of the steps between levels, from those since the start of their branch."""
    return jnp.diff(levels.slip_work, axis=-1, prepend=0.0)

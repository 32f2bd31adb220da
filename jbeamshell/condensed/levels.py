"""Load levels of a path: from factors where slip zones are nested, event by event elsewhere."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.condensed.body import Body
from jbeamshell.condensed.branches import ContactState, Factors, factorise, follow
from jbeamshell.condensed.events import walk
from jbeamshell.condensed.stretch import Level

Turns = tuple[bool, ...] | Array


def levels(
    body: Body,
    friction: Array,
    start: ContactState,
    forces: Array,
    turns: Turns,
    lift: Array | None = None,
) -> Level:
    """Levels of a load path, stacked along the first axis; everything may be traced.

    Factors are taken where they hold along the whole path, and events elsewhere.  First derivatives
    are exact, forward and reverse.  In a batch (`jax.vmap`) lanes whose factors hold take no step
    of the loop over the events; to differentiate many lanes, `jax.lax.map` is faster.

    Parameters
    ----------
    body : n contact nodes, or one of `drives`
    friction : mu
    start : contact at the path's start
    forces : (levels,) end loads, or what drives the body
    turns : True for each level before which the load has turned, the first one among them; as an
        array, which may be traced, it costs more
    lift : (n,) lift at the start; None is none
    """
    nested, valid = nested_levels(body, friction, start, forces, turns)

    def by_events() -> Level:
        return walk(body, friction, start, forces, turns, lift, ~valid)

    return lax.cond(valid, lambda: nested, by_events)


def nested_levels(
    body: Body, friction: Array, start: ContactState, forces: Array, turns: Turns
) -> tuple[Level, Array]:
    """Levels of a load path whose slip zones are nested, and True if they are.

    The arguments are those of `levels`.  All levels of a branch are one product of matrices where
    the turns are known.
    """
    if not isinstance(turns, tuple):
        return _one_by_one(body, friction, start, forces, turns)
    if not turns:
        none = Level(start, start.r_n, start.force, start.v > 0.0, start.force >= 0.0)
        return jax.tree.map(lambda a: jnp.zeros((0, *a.shape), a.dtype), none), jnp.asarray(True)
    factors = factorise(body, friction)
    first = np.flatnonzero(turns)
    sizes = np.diff(first, append=len(turns))
    longest = int(sizes.max())
    inside = np.minimum(np.arange(longest), sizes[:, None] - 1)  # the last level fills a branch up

    def go(state: ContactState, targets: Array) -> tuple[ContactState, tuple[Level, Array]]:
        found, valid = _branch(body, factors, friction, state, targets)
        return jax.tree.map(lambda a: a[-1], found.state), (found, valid)

    targets = forces[first[:, None] + inside]
    found, valid = lax.scan(go, start, targets)[1]
    real = np.flatnonzero((np.arange(longest) < sizes[:, None]).ravel())
    flat = jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:])[real], found)
    return flat, jnp.all(valid)


def _one_by_one(
    body: Body, friction: Array, start: ContactState, forces: Array, turns: Array
) -> tuple[Level, Array]:
    """Levels of a load path whose turns are traced, and True if its slip zones are nested."""
    factors = factorise(body, friction)

    def go(carry: Any, to: tuple[Array, Array]) -> tuple[Any, tuple[Level, Array]]:
        origin, last, done = carry
        force, turned = to
        origin = jax.tree.map(lambda new, old: jnp.where(turned, new, old), last, origin)
        done = jnp.where(turned, 0.0, done)
        found, valid = _branch(body, factors, friction, origin, force[None])
        level = jax.tree.map(lambda a: a[0], found)
        work = level.slip_work  # since the turn
        level = level._replace(slip_work=work - done)
        return (origin, level.state, work), (level, valid)

    found, valid = lax.scan(go, (start, start, start.force * 0.0), (forces, turns))[1]
    return found, jnp.all(valid)


def turns_of(forces: Array) -> Array:
    """True for each level (levels,) of a traced path before which its load, from 0, has turned."""
    moves = jnp.sign(jnp.diff(forces, prepend=0.0))

    def go(sense: Array, move: Array) -> tuple[Array, Array]:
        turned = (move != 0.0) & (move != sense)
        return jnp.where(turned, move, sense), turned

    return lax.scan(go, jnp.zeros_like(forces[0]), moves)[1].at[0].set(True)


def _branch(
    body: Body, factors: Factors, friction: Array, start: ContactState, forces: Array
) -> tuple[Level, Array]:
    """Levels of one branch, and True if what it assumes holds."""
    branch = follow(body, factors, friction, start, forces)
    lift = jnp.zeros_like(branch.at.r_n)
    settled = jnp.ones_like(forces, bool)
    work = jnp.diff(branch.slip_work, prepend=0.0)
    return Level(branch.at, lift, work, branch.slipping, settled), branch.valid

"""Turns of a load path: the levels before which its load, from 0, has changed its way.

Where a load rests, the level that leaves the rest has turned.  The first level always has.
"""

from __future__ import annotations

import functools

import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.scene.parts import unit_path

Turns = tuple[bool, ...] | Array


def known_turns(loads: np.ndarray) -> tuple[bool, ...]:
    """True for each level (levels,) before which the load has turned."""
    turns = np.zeros(loads.size, bool)
    moves = np.sign(np.diff(loads, prepend=0.0))
    moving = np.flatnonzero(moves)
    turns[moving[np.diff(moves[moving], prepend=0.0) != 0.0]] = True
    turns[:1] = True
    return tuple(turns.tolist())


def turns_of(loads: Array) -> Array:
    """Turns (levels,) of loads that may be traced, see `known_turns`."""
    moves = jnp.sign(jnp.diff(loads, prepend=0.0))

    def go(sense: Array, move: Array) -> tuple[Array, Array]:
        turned = (move != 0.0) & (move != sense)
        return jnp.where(turned, move, sense), turned

    return lax.scan(go, jnp.zeros_like(loads[0]), moves)[1].at[0].set(True)


@functools.cache
def turns_of_cycles(cycles: int, steps: int) -> tuple[bool, ...]:
    """Turns of a scene's own cycles with so many load steps per half cycle."""
    return known_turns(unit_path(cycles, steps))

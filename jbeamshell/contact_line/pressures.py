"""Load paths along which the pressures change too.

With P the part of the pressures that acts, a body's equations are

    r_t = K_tt v + K_tn w - f_t F - g_t P,    u = c F + f_t.v + f_n.w + h P,

and likewise for r_n.  A straight step in F and P is a load path of its own: one number s drives it,
with f dF + g dP in place of f.  Steps of one way are one branch, which goes event by event; where
the way changes, another one begins.  Where ways change from step to step a branch is shorter than
the steps in which nodes slip.  So these paths are read on the polygon of their events.
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax

from jbeamshell.contact_line.body import Body
from jbeamshell.contact_line.contact_state import ContactState
from jbeamshell.contact_line.walk import (
    Contact,
    Course,
    Drive,
    Level,
    departed,
    level_by_level,
)

SAME = 1e-9  # difference of two ways that are one


class Press(NamedTuple):
    """Share of the pressures in a body's equations.

    Attributes
    ----------
    g_t, g_n : (k,) and (n,) part of the pressures that each clamped contact field carries
    h : displacement of the loaded end per part of the pressures with a clamped contact
    """

    g_t: Array
    g_n: Array
    h: Array

    @classmethod
    def of(cls, hessian: Array, k: int, bearings: int) -> Press:
        """Share in the equations of a strip whose potential has this (2n + 2, 2n + 2) hessian.

        Parameters
        ----------
        k : number of nodes that may slip
        bearings : number of further contact nodes
        """
        fields = -hessian[:-2, -1].reshape(-1, 2)[::-1]
        return cls(fields[:k, 0], jnp.pad(fields[:, 1], (0, bearings)), -hessian[-2, -1])

    def driven_by_displacement(self, driven: Body) -> Press:
        """Share in the equations of a body that was changed by `drives.driven_by_displacement`."""
        t, n = self.g_t - driven.f_t * self.h, self.g_n - driven.f_n * self.h
        return Press(t, n, -driven.c * self.h)


def walk_with_pressures(
    body: Body,
    press: Press,
    friction: Array,
    start: ContactState,
    loads: Array,
    parts: Array,
    lift: Array | None = None,
) -> Level:
    """Levels of a path of straight steps in the load and the pressures, stacked along the first.

    First derivatives are exact, forward and reverse.

    Parameters
    ----------
    body, friction, start, lift : see `contact_line.events.walk`; all the pressures act at
        the start
    press : share of the pressures
    loads, parts : (levels,) end loads, or what drives the body, and parts of the pressures
    """
    lift = jnp.zeros_like(start.r_n) if lift is None else lift
    rises = jnp.diff(loads, prepend=start.force), jnp.diff(parts, prepend=jnp.ones_like(parts[0]))
    sizes, ways = jax.vmap(_direction)(*rises)
    before = tuple(jnp.concatenate([jnp.zeros_like(way[:1]), way[:-1]]) for way in ways)
    turns = ~_alike(ways, before).at[0].set(False)
    back = _alike(ways, tuple(-way for way in before))
    whole = jnp.cumsum(sizes)
    begins = lax.cummax(jnp.where(turns, whole - sizes, 0.0))
    load, part = ways
    senses = jnp.where(jnp.where(load == 0.0, part, load) < 0.0, -1.0, 1.0)
    along = senses * (whole - begins)  # of the branch, a straight part of the path

    def depart(contact: Contact, step: _Step, first: Array) -> Course:
        load, part = step.way
        pull_t, pull_n = load * body.f_t + part * press.g_t, load * body.f_n + part * press.g_n
        moving = eqx.tree_at(
            lambda b: (b.f_t, b.f_n, b.c), body, (pull_t, pull_n, load**2 * body.c)
        )
        state, memory = contact.state, contact.memory
        force = jnp.where(first, 0.0, state.force)
        sense = jnp.where(first & ~step.back, 0.0, memory.sense)
        memory = memory._replace(sense=sense)
        at = contact._replace(state=state._replace(force=force), memory=memory)
        drive = Drive(jnp.concatenate([pull_t, pull_n]), step.sense)
        return departed(moving, friction, at, drive, step.along, rounded=False)

    steps = _Step(ways, senses, along, back)
    levels, _ = level_by_level(body, depart, Contact.of(start, lift), along, turns, steps)
    slip, rise = levels.state.v - start.v, levels.lift - lift
    u = body.c * (loads - start.force) + slip @ body.f_t + rise @ body.f_n
    u = start.displacement + u + press.h * (parts - 1.0)
    return levels._replace(state=levels.state._replace(force=loads, displacement=u))


class _Step(NamedTuple):
    """Step of a path, and what is known of the branch, a straight part of the path, that it is on.

    Attributes
    ----------
    way : change of the load and of the pressures along the branch, the larger one of size 1
    sense : 1 or -1 where the load, or else the pressures, rise or fall
    along : length of the branch up to here times the sense
    back : True if the branch goes back on the one before
    """

    way: tuple[Array, Array]
    sense: Array
    along: Array
    back: Array


def _alike(ways: tuple[Array, ...], others: tuple[Array, ...]) -> Array:
    """True for ways (steps,) that are the same but for rounding."""
    same = [jnp.abs(a - b) <= SAME for a, b in zip(ways, others, strict=True)]
    return same[0] & same[1]


def _direction(load: Array, part: Array) -> tuple[Array, tuple[Array, Array]]:
    """Size of a step, and the step over it; a rest is a step of no size in the load alone."""
    size = jnp.maximum(jnp.abs(load), jnp.abs(part))
    moves = size > 0.0
    scale = jnp.where(moves, size, 1.0)
    return size, (jnp.where(moves, load / scale, 1.0), jnp.where(moves, part / scale, 0.0))

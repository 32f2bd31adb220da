"""Load paths of a body on its contact line, branch by branch.

A branch, from one reversal of the load to the next, is a polygon (`polygon`) that is read on the
spline of its events (`spline`).  The next branch begins with the contact that was read.  So load
levels only say where a path is looked at, and every answer is a smooth function of every number.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.contact_line.body import Body, local_compliance
from jbeamshell.contact_line.branches import ContactState
from jbeamshell.contact_line.events import Search
from jbeamshell.contact_line.polygon import Polygon, Slip, polygon
from jbeamshell.contact_line.spline import read, slipped
from jbeamshell.contact_line.tableau import Branch

SLIDES = 1e6  # compliance over that of the clamped contact from which on a body slides as a whole
SLIDES_ON = 1e-2  # of it, from which on a corner of the polygon stays sharp
TOUCHES = 1e-9  # of the largest reaction, below which an open node has none
SAME = 1e-9  # of a branch, within which it ends where the branch before began
NEVER = 1e100  # times a branch, from where on nothing comes any more


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


class Memory(NamedTuple):
    """What a contact remembers of the branch that led to it.

    Attributes
    ----------
    side : (k,) 1 and -1 for nodes that slipped along and against v, else 0
    free : (k,) True for nodes that were open or came to stick again
    sense : 1 or -1 where the load rose or fell; 0 before the first branch
    length : load from its begin to its end
    closed : how many branches in a row ended where the one before had begun
    extra, extra_before : (2, k) extra friction of the branch and of the one before, see `Search`
    """

    side: Array
    free: Array
    sense: Array
    length: Array
    closed: Array
    extra: Array
    extra_before: Array

    @classmethod
    def none(cls, state: ContactState) -> Memory:
        """Memory of a contact that was only pressed."""
        zero, still = jnp.zeros_like(state.force), jnp.zeros_like(state.v)
        extra = jnp.stack([still, still])
        return cls(still, still > 0.0, zero, zero, zero, extra, extra)


class Contact(NamedTuple):
    """Contact where a branch begins or ends, and what it remembers."""

    state: ContactState
    lift: Array
    settled: Array
    memory: Memory

    @classmethod
    def of(cls, state: ContactState, lift: Array) -> Contact:
        """Contact that was only pressed."""
        return cls(state, lift, jnp.asarray(True), Memory.none(state))


class Drive(NamedTuple):
    """What drives a branch: tau grows from 0, and the load is ``sense`` times tau.

    Attributes
    ----------
    pull : (k + n,) part of tau that each clamped contact field carries
    sense : 1 or -1
    """

    pull: Array
    sense: Array


class Course(NamedTuple):
    """Branch that a path is on, from the contact where it began.

    Attributes
    ----------
    contact : contact where it began
    drive, branch, search : what drives it, its equations, and how its events are found
    vertices, slip : its polygon and the slip of the nodes
    closes : True if it ends where the branch before began
    """

    contact: Contact
    drive: Drive
    branch: Branch
    search: Search
    vertices: Polygon
    slip: Slip
    closes: Array


def walk(
    body: Body,
    friction: Array,
    start: ContactState,
    forces: Array,
    turns: ArrayLike | tuple[bool, ...],
    lift: Array | None = None,
    needed: Array | None = None,
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
    needed : False to leave out the walk at no cost; its levels mean nothing then.  None is True

    Returns
    -------
    Level
        with the axis of the levels first
    """
    lift = jnp.zeros_like(start.r_n) if lift is None else lift
    return walk_on(body, friction, Contact.of(start, lift), forces, turns, needed)[0]


def walk_on(
    body: Body,
    friction: Array,
    start: Contact,
    forces: Array,
    turns: ArrayLike | tuple[bool, ...],
    needed: Array | None = None,
) -> tuple[Level, Contact]:
    """Levels of a load path, and the contact at its end; see `walk`."""
    friction = jnp.asarray(friction, forces.dtype)

    def path() -> tuple[Level, Contact]:
        if isinstance(turns, tuple):
            return _in_branches(body, friction, start, forces, turns)
        return _in_levels(body, friction, start, forces, jnp.asarray(turns))

    if needed is None:
        return path()

    def nothing() -> tuple[Level, Contact]:
        return jax.tree.map(lambda a: jnp.zeros(a.shape, a.dtype), jax.eval_shape(path))

    return lax.cond(needed, path, nothing)


def _in_branches(
    body: Body, friction: Array, start: Contact, forces: Array, turns: tuple[bool, ...]
) -> tuple[Level, Contact]:
    """Levels of a path whose turns are known: each branch is read at all its levels at once."""
    begins = np.flatnonzero(turns)
    ends = np.append(begins[1:], len(turns))
    longest = int(np.max(ends - begins))
    places = np.minimum(begins[:, None] + np.arange(longest), ends[:, None] - 1)

    def go(contact: Contact, targets: Array) -> tuple[Contact, Level]:
        course = departed(body, friction, contact, along(body, contact, targets[-1]), targets[-1])
        levels = levels_of(body, course, targets)
        return arrived(levels, course), levels

    end, levels = lax.scan(go, start, forces[places])
    inside = places.ravel()[np.diff(places.ravel(), prepend=-1) > 0]
    rows = np.searchsorted(places.ravel(), inside)
    return jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:])[rows], levels), end


def _in_levels(
    body: Body, friction: Array, start: Contact, forces: Array, turns: Array
) -> tuple[Level, Contact]:
    """Levels of a path whose turns are not known beforehand, one after the other."""
    last = turns.size - 1
    ends = jnp.where(jnp.append(turns[1:], True), jnp.arange(turns.size), last)
    ends = lax.cummin(ends, reverse=True)  # last level of each branch

    def depart(contact: Contact, target: Array) -> tuple[Course, Array]:
        drive = along(body, contact, target)
        return departed(body, friction, contact, drive, target), jnp.zeros_like(target)

    def go(
        carry: tuple[Contact, tuple[Course, Array]], to: tuple[Array, Array, Array]
    ) -> tuple[tuple[Contact, tuple[Course, Array]], Level]:
        now, way = carry
        force, turned, target = to
        course, before = lax.cond(turned, lambda: depart(now, target), lambda: way)
        levels = levels_of(body, course, force[None])
        level = jax.tree.map(lambda a: a[0], levels)
        work = level.slip_work
        level = level._replace(slip_work=work - before)
        return (arrived(levels, course), (course, work)), level

    unknown = jax.eval_shape(depart, start, forces[0])
    nowhere = jax.tree.map(lambda a: jnp.zeros(a.shape, a.dtype), unknown)
    (end, _), levels = lax.scan(go, (start, nowhere), (forces, turns, forces[ends]))
    return levels, end


def along(body: Body, contact: Contact, target: Array) -> Drive:
    """Drive by the end load, towards a target."""
    sense = jnp.where(target >= contact.state.force, 1.0, -1.0).astype(target.dtype)
    return Drive(sense * jnp.concatenate([body.f_t, body.f_n]), sense)


def departed(
    body: Body, friction: Array, contact: Contact, drive: Drive, target: Array
) -> Course:
    """Branch that begins with a contact, with its polygon up to a load and a little beyond."""
    state, memory = contact.state, contact.memory
    matrix = jnp.block([[body.K_tt, body.K_tn], [body.K_tn.T, body.K_nn]])
    forces = jnp.concatenate([state.r_t, state.r_n])
    branch = Branch(matrix, drive.pull, friction, forces, contact.lift)
    reach = lax.stop_gradient(jnp.abs(target - state.force))
    turns_back = drive.sense * memory.sense < 0.0
    closes = turns_back & (memory.length >= reach * (1.0 - SAME))
    # In cycles the extra friction is that of the cycle before: so a partly slipped node settles.
    again = closes & (memory.closed >= 2.0)
    extra = jnp.where(again, memory.extra_before, _extra(contact, drive, friction))
    back = jnp.where(turns_back, memory.length, 0.0)
    back = jnp.where(closes, NEVER * jnp.maximum(reach, memory.length), back)
    search = Search(extra, back)
    sliding = SLIDES_ON * _slides(body)
    vertices, slip = polygon(branch, search, contact.lift > 0.0, reach, sliding)
    return Course(contact, drive, branch, search, vertices, slip, closes)


def _extra(contact: Contact, drive: Drive, friction: Array) -> Array:
    """Extra friction (2, k) of a branch that turns back, see `polygon`.

    It puts the friction of a node at its limit on the side of its last slip.  A node that stuck is
    expected to slip the way the load goes, and its friction that way has the whole range.
    """
    state, memory = contact.state, contact.memory
    slipped_before = memory.side != 0.0
    limit = jnp.where(slipped_before, -memory.side, drive.sense)
    extra = limit * friction * state.r_n[: limit.size] - state.r_t
    extra = jnp.stack([extra, -extra])
    ahead = drive.sense * jnp.array([[1.0], [-1.0]], extra.dtype) > 0.0
    return jnp.where((slipped_before | ahead) & ~memory.free, extra, 0.0)


def _slides(body: Body) -> Array:
    """Change of the displacement per load from which on a body slides as a whole."""
    stiffness = jnp.append(jnp.diag(body.K_tt), jnp.diag(body.K_nn))
    local = local_compliance(stiffness, jnp.append(body.f_t, body.f_n))
    return lax.stop_gradient(SLIDES * (jnp.abs(body.c) + local))


def levels_of(body: Body, course: Course, targets: Array) -> Level:
    """Levels (levels,) of a branch at end loads, each with the work since the level before."""
    contact, drive = course.contact, course.drive
    start, k = contact.state, contact.state.v.size
    tau = drive.sense * (targets - start.force)
    found = read(course.branch, course.vertices, tau, _slides(body))
    lift = contact.lift + found.change[:, k:]
    r_t, r_n = found.r[:, :k], found.r[:, k:]
    # Rounding leaves open nodes a little reaction.
    touches = r_n > TOUCHES * jnp.max(r_n, axis=1, keepdims=True)
    apart = (lift > 0.0) & ~touches
    moved = drive.sense * (found.change @ drive.pull)
    state = ContactState(
        v=start.v + found.change[:, :k],
        r_t=jnp.where(apart[:, :k], 0.0, r_t),
        r_n=jnp.where(apart, 0.0, r_n),
        force=targets,
        displacement=start.displacement + body.c * (targets - start.force) + moved,
    )
    return Level(
        state=state,
        lift=lift,
        slip_work=jnp.diff(found.work, prepend=0.0),
        slipping=found.slipping & (lift[:, :k] <= 0.0),
        settled=contact.settled & course.slip.ended & ~found.slides,
    )


def arrived(levels: Level, course: Course) -> Contact:
    """Contact at the last level of a branch."""
    memory = course.contact.memory
    state, lift, settled = jax.tree.map(
        lambda a: a[-1], (levels.state, levels.lift, levels.settled)
    )
    length = lax.stop_gradient(jnp.abs(state.force - course.contact.state.force))
    side, stuck = slipped(course.vertices, course.slip, length)
    now = Memory(
        side=lax.stop_gradient(side),
        free=stuck | course.slip.opened,
        sense=course.drive.sense,
        length=length,
        closed=jnp.where(course.closes, memory.closed + 1.0, 0.0),
        extra=course.search.extra,
        extra_before=memory.extra,
    )
    return Contact(state, lift, settled, now)

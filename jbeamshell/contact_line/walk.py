"""Load paths of a body on its contact line, branch by branch.

A branch, from one reversal of the load to the next, is a polygon (`polygon`) that is read on the
spline of its events (`spline`).  The next branch begins with the contact that was read.  So load
levels only say where a path is looked at, and every answer is a smooth function of every number.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike
from jaxtyping import PyTree

from jbeamshell.contact_line import native
from jbeamshell.contact_line.body import Body, local_compliance
from jbeamshell.contact_line.contact_state import ContactState
from jbeamshell.contact_line.events import Search
from jbeamshell.contact_line.polygon import Polygon, Slip, polygon
from jbeamshell.contact_line.spline import read, slipped
from jbeamshell.contact_line.tableau import Branch

SLIDES = 1e6  # compliance over that of the clamped contact from which on a body slides as a whole
SLIDES_ON = 1e-2  # of it, from which on a corner of the polygon stays sharp
ABOUT = 2.0  # of its friction, how much more a node that stuck has to go before it slips back
TOUCHES = 1e-9  # of the largest reaction, below which an open node has none
ROUNDING = 32.0 * 2.0**-52  # of a node's stiffness times its change, the error of its force
SAME = 1e-9  # of a branch, within which it ends where the branch before began


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
    """Memory of a contact: the branch that led to it.

    Attributes
    ----------
    side : (k,) 1 and -1 for nodes that slipped along and against v, else 0
    free : (k,) True for nodes that were open or came to stick again
    sense : 1 or -1 where the load rose or fell; 0 before the first branch
    length : load from its begin to its end
    turned : True if it had turned back on another branch
    closed : how many branches in a row ended where the one before had begun
    extra, extra_before : (2, k) extra friction of the branch and of the one before, see `Search`
    """

    side: Array
    free: Array
    sense: Array
    length: Array
    turned: Array
    closed: Array
    extra: Array
    extra_before: Array

    @classmethod
    def none(cls, state: ContactState) -> Memory:
        """Memory of a contact that was only pressed."""
        zero, still = jnp.zeros_like(state.force), jnp.zeros_like(state.v)
        extra, no = jnp.stack([still, still]), still > 0.0
        return cls(still, no, zero, zero, zero > 0.0, zero, extra, extra)


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
    """Drive of a branch: tau grows from 0, and the load is ``sense`` times tau.

    Attributes
    ----------
    pull : (k + n,) part of tau that each clamped contact field carries
    sense : 1 or -1
    """

    pull: Array
    sense: Array


class Course(NamedTuple):
    """Branch that a path is on, or a part of it, from the contact where it began.

    A branch that goes beyond the load where the one before began has two parts.  The first one
    closes a loop there; the second one goes on.

    Attributes
    ----------
    x : (n,) positions of the nodes
    contact : contact where it began
    drive, branch, search : what drives it, its equations, and how its events are found
    vertices, slip : its polygon and the slip of the nodes
    end : load at its end
    turns, closes : True if it turns back, and if it ends where the branch before began
    """

    x: Array
    contact: Contact
    drive: Drive
    branch: Branch
    search: Search
    vertices: Polygon
    slip: Slip
    end: Array
    turns: Array
    closes: Array


def walk(
    body: Body,
    friction: Array,
    start: ContactState,
    forces: Array,
    turns: ArrayLike | tuple[bool, ...],
    lift: Array | None = None,
    rounded: bool = True,
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
    rounded : False reads the polygon of the events itself, whose nodes slip one after the other

    Returns
    -------
    Level
        with the axis of the levels first
    """
    lift = 0.0 * start.r_n if lift is None else lift
    given = native.arguments(body, friction, start, forces, lift)
    if forces.dtype == float and native.serves(*given):
        found = native.levels(given, turns, rounded)
        state = ContactState(found.v, found.r_t, found.r_n, forces, found.displacement)
        return Level(state, found.lift, found.slip_work, found.slipping, found.settled)
    return walk_on(body, friction, Contact.of(start, lift), forces, turns, rounded)[0]


def walk_on(
    body: Body,
    friction: Array,
    start: Contact,
    forces: Array,
    turns: ArrayLike | tuple[bool, ...],
    rounded: bool = True,
) -> tuple[Level, Contact]:
    """Levels of a load path, and the contact at its end; see `walk`."""
    friction = jnp.asarray(friction, forces.dtype)
    if isinstance(turns, tuple):
        return _in_branches(body, friction, start, forces, turns, rounded)
    return _in_levels(body, friction, start, forces, jnp.asarray(turns), rounded)


def _in_branches(
    body: Body,
    friction: Array,
    start: Contact,
    forces: Array,
    turns: tuple[bool, ...],
    rounded: bool,
) -> tuple[Level, Contact]:
    """Levels of a path whose turns are known: each branch is read at all its levels at once."""
    begins = np.flatnonzero(turns)
    ends = np.append(begins[1:], len(turns))
    longest = int(np.max(ends - begins))
    places = np.minimum(begins[:, None] + np.arange(longest), ends[:, None] - 1)

    def part(contact: Contact, targets: Array) -> tuple[Contact, Level]:
        """Part of a branch, seen at its end and at all levels of the branch."""
        drive = along(body, contact, targets[-1])
        course = departed(body, friction, contact, drive, targets[-1], rounded)
        levels = levels_of(body, course, jnp.append(course.end, targets))
        return arrived(jax.tree.map(lambda a: a[0], levels), course), levels

    def go(contact: Contact, targets: Array) -> tuple[Contact, Level]:
        def further(now: Contact, number: Array) -> tuple[Contact, Level]:
            arrives = (number > 0) & (now.state.force == targets[-1])
            return lax.cond(arrives, stay, part, now, targets)

        end, parts = lax.scan(further, contact, jnp.arange(2))
        return end, _joined(parts, targets, end.memory.sense)

    def stay(now: Contact, targets: Array) -> tuple[Contact, Level]:
        shapes = jax.eval_shape(part, now, targets)[1]
        return now, jax.tree.map(lambda a: jnp.zeros(a.shape, a.dtype), shapes)

    end, levels = lax.scan(go, start, forces[places])
    rows = np.flatnonzero(np.diff(places.ravel(), prepend=-1) > 0)
    return jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:])[rows], levels), end


def _joined(parts: Level, targets: Array, sense: Array) -> Level:
    """Levels of a branch from those of its two parts, which hold the level of their end first."""
    end = jax.tree.map(lambda a: a[0, 0], parts)
    first, second = (jax.tree.map(lambda a, i=i: a[i, 1:], parts) for i in range(2))
    inside = sense * (targets - end.state.force) <= 0.0

    def chosen(one: Array, other: Array) -> Array:
        return jnp.where(inside.reshape(-1, *[1] * (one.ndim - 1)), one, other)

    levels = jax.tree.map(chosen, first, second)
    work = jnp.where(inside, levels.slip_work, levels.slip_work + end.slip_work)
    return levels._replace(slip_work=jnp.diff(work, prepend=0.0))


def _in_levels(
    body: Body, friction: Array, start: Contact, forces: Array, turns: Array, rounded: bool
) -> tuple[Level, Contact]:
    """Levels of a path whose turns are not known beforehand, one after the other."""

    def depart(contact: Contact, target: Array, _: Array) -> Course:
        return departed(body, friction, contact, along(body, contact, target), target, rounded)

    return level_by_level(body, depart, start, forces, turns, forces)


def level_by_level(
    body: Body,
    depart: Callable[[Contact, PyTree, Array], Course],
    start: Contact,
    loads: Array,
    turns: Array,
    steps: PyTree,
) -> tuple[Level, Contact]:
    """Levels of a path, one after the other, and the contact at its end.

    Parameters
    ----------
    body : n contact nodes
    depart : function of a contact, of the last step of the branch that goes on from it, and of True
        where the branch begins
    start : contact where the path begins
    loads, turns : (levels,) loads, as `Course.end` has them, and True where a branch begins
    steps : what ``depart`` needs to know of each level, (levels, ...)
    """
    numbers = jnp.arange(turns.size)
    ends = lax.cummin(jnp.where(jnp.append(turns[1:], True), numbers, numbers[-1]), reverse=True)
    lasts = jax.tree.map(lambda a: a[ends], steps)

    def level(course: Course, load: Array) -> Level:
        return jax.tree.map(lambda a: a[0], levels_of(body, course, load[None]))

    def go(
        carry: tuple[Contact, Course, Array, Array], to: tuple[Array, Array, PyTree]
    ) -> tuple[tuple[Contact, Course, Array, Array], Level]:
        now, course, done, work = carry
        load, turned, last = to

        def part(way: tuple[Course, Array], first: Array) -> tuple[tuple[Course, Array], None]:
            course, done = way
            at_end = level(course, course.end)
            goes_on = arrived(at_end, course), done + at_end.slip_work
            contact, worked = jax.tree.map(
                lambda a, b: jnp.where(first, a, b), (now, jnp.zeros_like(done)), goes_on
            )
            beyond = course.drive.sense * (load - course.end) > 0.0
            begins = jnp.where(first, turned, beyond)
            return lax.cond(
                begins, lambda: (depart(contact, last, first), worked), lambda: way
            ), None

        (course, done), _ = lax.scan(part, (course, done), jnp.array([True, False]))
        found = level(course, load)
        total = done + found.slip_work
        step = found._replace(slip_work=total - jnp.where(turned, 0.0, work))
        return (arrived(found, course), course, done, total), step

    first = jax.tree.map(lambda a: a[0], lasts)
    unknown = jax.eval_shape(depart, start, first, turns[0])
    nowhere = jax.tree.map(lambda a: jnp.zeros(a.shape, a.dtype), unknown)
    none = jnp.zeros_like(start.state.force)
    (end, *_), levels = lax.scan(go, (start, nowhere, none, none), (loads, turns, lasts))
    return levels, end


def along(body: Body, contact: Contact, target: Array) -> Drive:
    """Drive by the end load, towards a target."""
    sense = jnp.where(target >= contact.state.force, 1.0, -1.0).astype(target.dtype)
    return Drive(sense * jnp.concatenate([body.f_t, body.f_n]), sense)


def departed(
    body: Body,
    friction: Array,
    contact: Contact,
    drive: Drive,
    target: Array,
    rounded: bool = True,
) -> Course:
    """Course that begins with a contact, with its polygon up to its end and a little beyond.

    It ends at a target, or before that where it closes a loop, at the load where the branch before
    began.

    Parameters
    ----------
    rounded : False reads the polygon itself, whose nodes slip one after the other
    """
    state, memory = contact.state, contact.memory
    matrix = jnp.block([[body.K_tt, body.K_tn], [body.K_tn.T, body.K_nn]])
    forces = jnp.concatenate([state.r_t, state.r_n])
    branch = Branch(matrix, drive.pull, friction, forces, contact.lift)
    turns = drive.sense * memory.sense < 0.0
    reach = jnp.abs(target - state.force)
    loops = turns & memory.turned  # and so it comes back to where the branch before began
    splits = loops & (reach * (1.0 - SAME) > memory.length)
    end = jnp.where(splits, state.force + drive.sense * memory.length, target)
    closes = loops & (reach * (1.0 + SAME) >= memory.length)
    reach = lax.stop_gradient(jnp.abs(end - state.force))
    # In cycles the extra friction is that of the cycle before: so a partly slipped node settles.
    again = closes & (memory.closed >= 2.0)
    extra = jnp.where(again, memory.extra_before, _extra(contact, friction, turns))
    # After a first loading it ends where that began.
    first = turns & ~memory.turned
    search = Search(extra, jnp.where(first, memory.length, jnp.inf))
    if not rounded:
        search = Search(jnp.zeros_like(extra), search.back)
    sliding = SLIDES_ON * _slides(body)
    vertices, slip = polygon(branch, search, contact.lift > 0.0, reach, sliding)
    if not rounded:
        own = jnp.arange(vertices.tau.size)  # with no step before it a corner stays sharp
        vertices = vertices._replace(before=own)
    return Course(body.x, contact, drive, branch, search, vertices, slip, end, turns, closes)


def _extra(contact: Contact, friction: Array, turns: Array) -> Array:
    """Extra friction (2, k) of a branch that turns back, see `polygon`."""
    state, memory = contact.state, contact.memory
    cap = friction * state.r_n[: memory.side.size]
    slipped_before = memory.side != 0.0
    side = jnp.where(slipped_before, memory.side, jnp.where(state.r_t > 0.0, -1.0, 1.0))
    used = -side * state.r_t  # of the friction on that side
    left = cap - used
    beside = jnp.maximum(jnp.minimum(left, ABOUT * used), 0.0)
    extra = jnp.where(slipped_before, left, beside)
    extra = jnp.where(turns & ~memory.free, extra, 0.0)
    return jnp.where(side * jnp.array([[1.0], [-1.0]], cap.dtype) < 0.0, extra, 0.0)


def _slides(body: Body) -> Array:
    """Change of the displacement per load from which on a body slides as a whole."""
    stiffness = jnp.append(jnp.diag(body.K_tt), jnp.diag(body.K_nn))
    local = local_compliance(stiffness, jnp.append(body.f_t, body.f_n))
    return lax.stop_gradient(SLIDES * (jnp.abs(body.c) + local))


def levels_of(body: Body, course: Course, targets: Array) -> Level:
    """Levels (levels,) of a course at end loads, each with the work since it began."""
    contact, drive = course.contact, course.drive
    start, k = contact.state, contact.state.v.size
    tau = drive.sense * (targets - start.force)
    found = read(course.branch, course.vertices, body.x, tau, _slides(body))
    lift = contact.lift + found.change[:, k:]
    r_t, r_n = found.r[:, :k], found.r[:, k:]
    # Rounding leaves open nodes a little force: the shorter the elements, the more.
    rounding = ROUNDING * jnp.diagonal(course.branch.matrix) * jnp.abs(found.change)
    least = jnp.maximum(TOUCHES * jnp.max(r_n, axis=1, keepdims=True), rounding)
    touches = r_n > least[:, k:]
    apart = (lift > 0.0) & ~touches
    moved = drive.sense * (found.change @ drive.pull)
    state = ContactState(
        v=start.v + found.change[:, :k],
        r_t=jnp.where(apart[:, :k] & (jnp.abs(r_t) <= least[:, :k]), 0.0, r_t),
        r_n=jnp.where(apart, 0.0, r_n),
        force=targets,
        displacement=start.displacement + body.c * (targets - start.force) + moved,
    )
    return Level(
        state=state,
        lift=lift,
        slip_work=found.work,
        slipping=found.slipping & (lift[:, :k] <= 0.0),
        settled=contact.settled & course.slip.ended & ~found.slides,
    )


def arrived(level: Level, course: Course) -> Contact:
    """Contact at a level of a course."""
    before = course.contact.memory
    goes_on = course.drive.sense * before.sense > 0.0  # of the branch that it is a part of
    length = jnp.abs(level.state.force - course.contact.state.force)
    side, stuck = slipped(course.vertices, course.slip, course.x, length)
    free = stuck | course.slip.opened
    now = Memory(
        side=lax.stop_gradient(jnp.where(goes_on & (side == 0.0) & ~free, before.side, side)),
        free=free | (goes_on & before.free & (side == 0.0)),
        sense=course.drive.sense,
        length=jnp.where(goes_on, before.length + length, length),
        turned=jnp.where(goes_on, before.turned, course.turns),
        closed=jnp.where(course.closes, before.closed + 1.0, 0.0),
        extra=jnp.where(goes_on, before.extra, course.search.extra),
        extra_before=jnp.where(goes_on, before.extra_before, before.extra),
    )
    return Contact(level.state, level.lift, level.settled, now)

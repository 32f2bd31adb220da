"""Load steps of a contact on a face, one after the other, until its cycles are steady."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import numpy as np
from jax import Array

from jbeamshell.bodies.face import Drive, Face, Sticking
from jbeamshell.bodies.face_step import BALANCED, Found, forces, take_step
from jbeamshell.common.checks import TINY
from jbeamshell.common.numbers_of import numbers_of, quiet, scan, without_slopes

MOST_CYCLES = 16  # until the loop is steady
PRESSING = 8  # steps in which the bolts are tightened with friction
REPEATS = 3e-3  # slip left over by a steady cycle, over its largest range: .2 % of D


class Steps(NamedTuple):
    """Steps of a path, each at its end.

    Attributes
    ----------
    given, load : (m,) loads that were asked for, and loads that act
    u : (N,) displacements of the nodes
    slip, force : (q, 3) of the contact points
    error, iterations : force out of balance over the loads, and iterations of Newton's method
    """

    given: Array
    load: Array
    u: Array
    slip: Array
    force: Array
    error: Array
    iterations: Array


class Path(NamedTuple):
    """Steps to take.

    Attributes
    ----------
    loads : (steps, m)
    rub : (steps,) part of the friction that acts
    driven : (steps,) True where the displacement of the load to and fro is prescribed
    begins : (steps,) True where the pressing has ended
    """

    loads: Any
    rub: Any
    driven: Any
    begins: Any


def first_steps(loads: Array, frictional: bool, driven: bool) -> tuple[int, Path]:
    """Steps of the pressing, the first of some loads (levels, m), their number, and the others."""
    xp, count = numbers_of(loads), PRESSING if frictional else 1
    pressing = (np.arange(1, count + 1) / count)[:, None] * loads[0]
    number = np.arange(count + len(loads) - 1)
    path = number >= count
    return count, Path(
        loads=xp.concatenate([pressing, loads[1:]]),
        rub=np.where(path, 1.0, float(frictional)),
        driven=path & driven,
        begins=number == count,
    )


def cycle_of(loads: Array, driven: bool) -> Path:
    """Steps of a cycle of some loads (steps, m)."""
    none = np.zeros(len(loads), bool)
    return Path(loads, none + 1.0, none | driven, none)


def nothing_yet(face: Face) -> Steps:
    """Bodies before anything presses."""
    xp = numbers_of(face)
    none = xp.zeros(face.loads.shape[1])
    slip = xp.zeros((face.points.gap.size, 3))
    zero = xp.zeros(())
    return Steps(none, none, xp.zeros(len(face.loads)), slip, slip, zero, zero)


def pressed(begun: Steps, count: int) -> Steps:
    """Last step (1, ...) of the pressing of so many, with the errors and iterations of all."""
    xp = numbers_of(begun)
    return jax.tree.map(lambda a: a[count - 1 : count], begun)._replace(
        error=xp.max(begun.error[:count], keepdims=True),
        iterations=xp.sum(begun.iterations[:count], keepdims=True),
    )


def ends(before: Steps, now: Steps) -> Array:
    """True if a cycle after some step is steady, or has no equilibrium."""
    xp = numbers_of(before, now)
    slip = without_slopes(now.slip[..., :2])
    apart = xp.max(xp.abs(slip[-1] - without_slopes(before.slip[..., :2])))
    steady = apart <= REPEATS * xp.max(xp.ptp(slip, axis=0))
    found: Array = steady | ~(now.error[-1] <= BALANCED)
    return found


def _displacement(face: Face, u: Array, load: Array) -> Array:
    """Displacement of the load to and fro."""
    return face.loads[:, 0] @ u + face.flexibility[0] @ load


def steps_of(
    bodies: tuple[Face, Sticking], begin: Steps, start: Array, path: Path
) -> tuple[Steps, Array]:
    """Levels of a path, and the displacement of the load after the pressing.

    The search for a level starts at the slip to which the last step would lead if it went on.  That
    for the first one starts with all gaps closed, because a body on few points is nearly loose.

    Parameters
    ----------
    begin : level before it
    start : displacement of the load after the pressing, 0 until it is known
    path : steps
    """
    face, sticking = bodies
    xp = numbers_of(bodies, begin, start, path)
    closed = face.points.gap[:, None] * np.array([0.0, 0.0, -1.0])

    def step(carry: tuple[Any, ...], now: Path) -> tuple[Any, Steps]:
        before, slid, further, start = carry
        start = xp.where(now.begins, _displacement(face, before.u, before.load), start)
        slid, further = (xp.where(now.begins, 0.0, a) for a in (slid, further))
        ahead = now.loads - before.given
        rests = xp.all(ahead == 0.0)
        goes_on = xp.sum(ahead * further) / xp.maximum(xp.sum(further**2), TINY)
        guess = before.slip + xp.clip(goes_on, 0.0, 1.0) * slid
        guess = xp.where(xp.all(before.given == 0.0), closed, guess)
        points = face.points._replace(friction=now.rub * face.points.friction)
        own, drive = face._replace(points=points), Drive(now.loads, now.driven, start)
        if xp is np and not before.error <= BALANCED:  # no level after it counts
            found = Found(before.u, before.error, xp.zeros(()))
        else:
            found = take_step(own, sticking, before.slip, drive, guess)
        force, slip = forces(own, found.u, before.slip)
        acts = own.load(found.u, drive)
        level = Steps(now.loads, acts, found.u, slip, force, found.error, found.iterations)
        slid = xp.where(rests, slid, slip - before.slip)
        return (level, slid, xp.where(rests, further, ahead), start), level

    still = xp.zeros_like(begin.slip), xp.zeros_like(begin.given)
    (_, _, _, start), levels = scan(step, (begin, *still, start), path)
    return levels, start


@quiet
def levels_of(
    bodies: tuple[Face, Sticking],
    loads: Array,
    half: int | None,
    frictional: bool,
    driven: bool,
    count: int | None = None,
) -> tuple[Steps, int]:
    """Levels of a path and the number of its cycles, by NumPy.

    Parameters
    ----------
    loads : (levels, m), those of the pressing, which is taken in steps, first
    half : steps of half a cycle; None if all levels are taken
    frictional : True if the face is pressed with friction
    driven : True if the load to and fro is a displacement since the pressing, in which it is free
    count : number of cycles; None goes on until they are steady
    """
    rise = len(loads) if half is None else 1 + half // 2
    last, path = first_steps(loads[:rise], frictional, driven)
    begin: Any = np.zeros(())
    now, start = steps_of(bodies, nothing_yet(bodies[0]), begin, path)
    parts = [pressed(now, last), jax.tree.map(lambda a: a[last:], now)]
    taken = 0
    if half is not None:
        cycle = cycle_of(loads[rise : rise + 2 * half], driven)
        while taken < (MOST_CYCLES if count is None else count):
            before = jax.tree.map(lambda a: a[-1], now)
            now, start = steps_of(bodies, before, start, cycle)
            parts.append(now)
            taken += 1
            if count is None and ends(before, now):
                break
    return jax.tree.map(lambda *a: np.concatenate(a), *parts), taken

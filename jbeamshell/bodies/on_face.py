"""Contact of bodies on a face, in backward load steps."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.bodies.coarser_mesh import coarser
from jbeamshell.bodies.contact_input import Problem
from jbeamshell.bodies.face_bodies import Bodies, bodies_of
from jbeamshell.bodies.face_step import TOLERANCE, Drive, Face, Sticking, take_step
from jbeamshell.bodies.levels import Found, Levels
from jbeamshell.common.checks import TINY, is_traced
from jbeamshell.common.small import Small

STEPS = 32  # per half cycle
MOST_CYCLES = 16  # until the loop is steady
PRESSING = 8  # steps in which the bolts are tightened with friction
REPEATS = 3e-3  # slip left over by a steady cycle, over its largest range: .2 % of D
LARGE = 150  # contact points, from which on the time of a run counts
SLIDES = 1e-9  # of friction times reaction, within which a point is at its limit
TOUCHES = 1e-9  # of the largest reaction, below which one is that of an open point, rounded


class Steps(NamedTuple):
    """Steps of a path, each at its end.

    Attributes
    ----------
    given, load : (m,) loads that were asked for, and loads that act
    u : (N,) displacements of the nodes
    slip, force : (q, 2) and (q, 3) of the contact points
    error, iterations : force out of balance over the loads, and iterations of Newton's method
    """

    given: Array
    load: Array
    u: Array
    slip: Array
    force: Array
    error: Array
    iterations: Array


def solved(problem: Problem) -> Found:
    """Levels of a contact, its cycles until it is steady, and levels in half as many steps.

    A cycle is steady if its slip ends where it began.  The path rests at its amplitude before the
    first cycle that is taken, so that the last one always is the steady one.  The same bodies on a
    coarser mesh of their face, in half as many steps, show what the mesh is worth.
    """
    bodies, loads = bodies_of(problem), problem.loads
    settings = problem.assembly == "frictional", problem.half, problem.control == "displacement"
    steps, count = _walk((bodies.face, loads, np.asarray(MOST_CYCLES)), *settings)
    levels = _in_levels((bodies, steps))
    if problem.unit is None or is_traced(levels) or not bool(jnp.all(levels.sound)):
        return Found(levels, count)
    rests = loads.at[1::2].set(loads[:-1:2])  # rests between them: one program serves all
    meshes = [bodies]
    onto = None if problem.points else coarser(problem)
    if onto is not None:
        meshes.append(bodies_of(problem, onto))
    found = []
    for each in meshes:
        fewer, _ = _walk((each.face, rests, np.asarray(count)), *settings)
        every_second = jax.tree.map(lambda a: np.asarray(a)[::2], fewer)
        found.append(_in_levels((each, every_second)))
    return Found(levels, count, *found)


def _levels_of(
    inputs: tuple[Face, Array, Array], frictional: bool, half: int | None, driven: bool
) -> tuple[Steps, Array]:
    """Levels of the path, and the number of cycles until it is steady, see `_until_steady`.

    The pressing, its first level (m,), is taken in steps.

    Parameters
    ----------
    inputs : face, loads (levels, m), and most cycles
    frictional : True if the face is pressed with friction
    half : steps of half a cycle; None if all levels are taken
    driven : True if the load to and fro is a displacement since the pressing, in which it is free
    """
    face, loads, most = inputs
    bodies = face, Sticking.of(lax.stop_gradient(face))
    parts = np.arange(1, PRESSING + 1) / PRESSING if frictional else np.ones(1)
    last = parts.size - 1
    cycles = 0 if half is None else 2 * half * MOST_CYCLES
    rise = loads.shape[0] - cycles
    ways = jnp.concatenate([jnp.asarray(parts)[:, None] * loads[0], loads[1:rise]])
    # Each loop compiles for seconds: that of the pressing and the rise takes the cycles too.
    length = ways.shape[0] if half is None else 2 * half
    ways = jnp.concatenate([ways, jnp.broadcast_to(ways[-1], (length - len(ways), ways.shape[1]))])
    number = np.arange(length)
    path = number > last
    rubs = np.where(path, 1.0, float(frictional))
    first = ways, rubs, path & driven, number == parts.size
    nothing = Steps(
        given=jnp.zeros_like(loads[0]),
        load=jnp.zeros_like(loads[0]),
        u=jnp.zeros(face.loads.shape[0]),
        slip=jnp.zeros((face.shares.shape[0], 2)),
        force=jnp.zeros((face.shares.shape[0], 3)),
        error=jnp.zeros(()),
        iterations=jnp.zeros(()),
    )
    begin, count = (nothing, jnp.zeros(())), jnp.asarray(0)
    if half is None:
        begun, _ = _steps(bodies, *begin, first)
    else:
        cycle = loads[rise : rise + length]
        none = np.zeros(length, bool)
        others = cycle, none + 1.0, none | driven, none
        begun, rest, count = _until_steady(bodies, begin, (first, others), most)
    pressed = jax.tree.map(lambda a: a[last : last + 1], begun)._replace(
        error=jnp.max(begun.error[: last + 1], keepdims=True),
        iterations=jnp.sum(begun.iterations[: last + 1], keepdims=True),
    )
    stop = last + rise  # what comes then are rests
    parted = [pressed, jax.tree.map(lambda a: a[last + 1 : stop], begun)]
    parted += [] if half is None else [rest]
    return jax.tree.map(lambda *a: jnp.concatenate(a), *parted), count


WALKS = Small(_levels_of, level=0), Small(_levels_of)


def _walk(inputs: tuple[Face, Array, Any], *settings: Any) -> tuple[Steps, Array]:
    """Levels of the path and the number of cycles, by the program that suits the face.

    That of a large face takes longer to compile, and less to run.
    """
    found: tuple[Steps, Array] = WALKS[inputs[0].shares.shape[0] >= LARGE](inputs, *settings)
    return found


def _displacement(face: Face, u: Array, load: Array) -> Array:
    """Displacement of the load to and fro."""
    return face.loads[:, 0] @ u + face.flexibility[0] @ load


Path = tuple[Any, Any, Any, Any]


def _until_steady(
    bodies: tuple[Face, Sticking],
    begin: tuple[Steps, Array],
    paths: tuple[Path, Path],
    most: Array,
) -> tuple[Steps, Steps, Array]:
    """Levels up to the first cycle, levels of all cycles, and the number of those that were taken.

    Parameters
    ----------
    begin : level before the pressing, and displacement of the load
    paths : up to the first cycle, and of each cycle, see `_steps`
    most : cycles at most
    """
    length = paths[0][1].size
    first, cycle = (tuple(map(jnp.asarray, path)) for path in paths)

    def go(
        carry: tuple[Steps, Array, Array], number: Array
    ) -> tuple[tuple[Steps, Array, Array], tuple[Steps, Array]]:
        before, start, steady = carry

        def taken() -> tuple[Steps, Array]:
            path = jax.tree.map(lambda a, b: jnp.where(number == 0, a, b), first, cycle)
            return _steps(bodies, jax.tree.map(lambda a: a[-1], before), start, path)

        now, start = lax.cond(steady, lambda: (before, start), taken)
        ends = lax.stop_gradient(now.slip)
        apart = jnp.max(jnp.abs(ends[-1] - lax.stop_gradient(before.slip[-1])))
        repeats = (apart <= REPEATS * jnp.max(jnp.ptp(ends, axis=0))) & (number > 0)
        lost = ~(now.error[-1] <= TOLERANCE)
        ends_here = repeats | lost | (number >= most)
        return (now, start, steady | ends_here), (now, steady)

    still = jax.tree.map(lambda a: jnp.broadcast_to(a, (length, *a.shape)), begin[0])
    carry = still, begin[1], jnp.asarray(False)
    _, (blocks, copied) = lax.scan(go, carry, jnp.arange(1 + MOST_CYCLES))
    count = jnp.sum(~copied) - 1
    # Those that were taken come last: the last cycle of a traced path is that of a plain one.
    number = 1 + jnp.arange(MOST_CYCLES) - (MOST_CYCLES - count)
    rests = (number < 1).reshape(-1, 1)

    def in_order(levels: Array) -> Array:
        chosen = levels[jnp.maximum(number, 0)]
        resting = rests.reshape(-1, *[1] * (levels.ndim - 1))
        chosen = jnp.where(resting, levels[0, -1], chosen)
        return chosen.reshape(-1, *levels.shape[2:])

    return jax.tree.map(lambda a: a[0], blocks), jax.tree.map(in_order, blocks), count


def _steps(
    bodies: tuple[Face, Sticking], begin: Steps, start: Array, path: Path
) -> tuple[Steps, Array]:
    """Levels of a path, and the displacement of the load after the pressing.

    The search for a level starts where the last step would lead if it went on.  That for the first
    one starts with all gaps closed, because a body on few points is nearly loose.

    Parameters
    ----------
    begin : level before it
    start : displacement of the load after the pressing, 0 until it is known
    path : loads (steps, m), part (steps,) of the friction that acts, True where the displacement of
        the load is prescribed, and True where the pressing has ended
    """
    face, sticking = bodies

    def step(carry: tuple[Any, ...], now: tuple[Array, ...]) -> tuple[Any, Steps]:
        load, rub, driven, begins = now
        before, moved, further, start = carry
        start = jnp.where(begins, _displacement(face, before.u, before.load), start)
        moved, further = (jnp.where(begins, 0.0, a) for a in (moved, further))
        ahead = load - before.given
        rests = jnp.all(ahead == 0.0)
        goes_on = jnp.sum(ahead * further) / jnp.maximum(jnp.sum(further**2), TINY)
        guess = before.u + jnp.clip(goes_on, 0.0, 1.0) * moved
        guess = jnp.where(jnp.all(before.given == 0.0), sticking.glued(face, load), guess)
        points = face.points._replace(friction=rub * face.points.friction)
        own, drive = face._replace(points=points), Drive(load, driven, start)
        found = take_step(own, sticking, before.slip, drive, guess)
        force = own.forces(found.u, before.slip)
        slip = own.moves(found.u)[:, :2] + force[:, :2] / points.springs[:, :1]
        acts = own.load(found.u, drive)
        level = Steps(load, acts, found.u, slip, force, found.error, found.iterations)
        moved = jnp.where(rests, moved, found.u - before.u)
        return (level, moved, jnp.where(rests, further, ahead), start), level

    still = jnp.zeros_like(begin.u), jnp.zeros_like(begin.given)
    whole = tuple(map(jnp.asarray, path))
    (_, _, _, start), levels = lax.scan(step, (begin, *still, start), whole)
    return levels, start


@functools.partial(Small, level=0)
def _in_levels(inputs: tuple[Bodies, Steps]) -> Levels:
    """Levels of steps, the displacements since the pressing."""
    bodies, steps = inputs
    face, points = bodies.face, bodies.face.points
    moved = (steps.u - steps.u[0]) @ face.loads + (steps.load - steps.load[0]) @ face.flexibility
    slip, normal = steps.slip - steps.slip[0], steps.force[..., 2]
    pull = -jnp.where(bodies.held, 0.0, steps.force)[..., :2]
    apart = jax.vmap(face.moves)(steps.u)[..., 2] + bodies.softness * normal
    touching = normal > TOUCHES * jnp.max(normal, axis=-1, keepdims=True)
    at_limit = jnp.linalg.norm(pull, axis=-1) >= (1.0 - SLIDES) * points.friction * normal
    mean = 0.5 * (pull[1:] + pull[:-1])
    work = jnp.sum(mean * jnp.diff(slip, axis=0), axis=(1, 2))
    sound = lax.stop_gradient(steps.error) <= TOLERANCE
    return Levels(
        loads=steps.load,
        displacements=moved,
        slip=slip,
        gap=points.gap + apart,
        friction_force=pull,
        normal_force=normal,
        slipping=touching & at_limit & (points.friction > 0.0),
        slip_work=jnp.append(0.0, work),
        sound=jnp.cumsum(~sound) == 0,
        error=steps.error,
        iterations=steps.iterations,
    )

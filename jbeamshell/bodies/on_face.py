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
    steps, count = _walk((bodies.face, loads, jnp.asarray(MOST_CYCLES)), *settings)
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
        fewer, _ = _walk((each.face, rests, count), *settings)
        every_second = jax.tree.map(lambda a: np.asarray(a)[::2], fewer)
        found.append(_in_levels((each, every_second)))
    return Found(levels, count, *found)


@functools.partial(Small, level=0)
def _walk(
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
    sticking = Sticking.of(lax.stop_gradient(face))
    parts = np.arange(1, PRESSING + 1) / PRESSING if frictional else np.ones(1)
    last = parts.size - 1
    cycles = 0 if half is None else 2 * half * MOST_CYCLES
    rise = loads.shape[0] - cycles
    ways = jnp.concatenate([jnp.asarray(parts)[:, None] * loads[0], loads[1:rise]])
    # One loop for the pressing and for what comes then: each step compiles for seconds.
    rubs = np.append(np.full(parts.size, float(frictional)), np.ones(rise - 1))
    path = np.arange(rubs.size) >= parts.size
    nothing = Steps(
        given=jnp.zeros_like(loads[0]),
        load=jnp.zeros_like(loads[0]),
        u=jnp.zeros(face.loads.shape[0]),
        slip=jnp.zeros((face.nodes.shape[0], 2)),
        force=jnp.zeros((face.nodes.shape[0], 3)),
        error=jnp.zeros(()),
        iterations=jnp.zeros(()),
    )
    bodies = face, sticking
    first = _steps(bodies, nothing, None, (ways, rubs, path & driven, np.diff(path, prepend=0) > 0))
    pressed = jax.tree.map(lambda a: a[last : last + 1], first)._replace(
        error=jnp.max(first.error[: last + 1], keepdims=True),
        iterations=jnp.sum(first.iterations[: last + 1], keepdims=True),
    )
    levels = jax.tree.map(lambda a, b: jnp.concatenate([a, b[last + 1 :]]), pressed, first)
    if half is None:
        return levels, jnp.asarray(0)
    cycle = loads[rise : rise + 2 * half]
    start = _displacement(face, first.u[last], first.load[last])
    begin = jax.tree.map(lambda a: a[-1], first)
    rest, count = _until_steady(bodies, begin, start, (cycle, most), driven)
    return jax.tree.map(lambda a, b: jnp.concatenate([a, b]), levels, rest), count


def _displacement(face: Face, u: Array, load: Array) -> Array:
    """Displacement of the load to and fro."""
    return face.loads[:, 0] @ u + face.flexibility[0] @ load


def _until_steady(
    bodies: tuple[Face, Sticking],
    begin: Steps,
    start: Array,
    path: tuple[Array, Array],
    driven: bool,
) -> tuple[Steps, Array]:
    """Levels of all cycles, and the number of those that were taken.

    Parameters
    ----------
    begin : level after the first loading
    start : displacement of the load after the pressing
    path : (levels, m) loads of a cycle, and most cycles
    driven : see `_walk`
    """
    cycle, most = path
    none = np.zeros(cycle.shape[0])

    def go(
        carry: tuple[Steps, Array], number: Array
    ) -> tuple[tuple[Steps, Array], tuple[Steps, Array]]:
        before, steady = carry

        def taken() -> Steps:
            last = jax.tree.map(lambda a: a[-1], before)
            flags = none + 1.0, none + float(driven) > 0.0, none > 0.0
            return _steps(bodies, last, start, (cycle, *flags))

        now = lax.cond(steady, lambda: before, taken)
        ends = lax.stop_gradient(now.slip)
        apart = jnp.max(jnp.abs(ends[-1] - lax.stop_gradient(before.slip[-1])))
        repeats = apart <= REPEATS * jnp.max(jnp.ptp(ends, axis=0))
        lost = ~(now.error[-1] <= TOLERANCE)
        ends_here = repeats | lost | (number + 1 >= most)
        return (now, steady | ends_here), (now, steady)

    rests = jax.tree.map(lambda a: jnp.broadcast_to(a, (cycle.shape[0], *a.shape)), begin)
    _, (cycles, copied) = lax.scan(go, (rests, jnp.asarray(False)), jnp.arange(MOST_CYCLES))
    count = jnp.sum(~copied)
    # Those that were taken come last: the last cycle of a traced path is that of a plain one.
    number = jnp.arange(MOST_CYCLES) - (MOST_CYCLES - count)
    here = number >= 0

    def in_order(all_cycles: Array, rest: Array) -> Array:
        wanted = here.reshape(-1, *[1] * (all_cycles.ndim - 1))
        chosen = jnp.where(wanted, all_cycles[jnp.maximum(number, 0)], rest)
        return chosen.reshape(-1, *all_cycles.shape[2:])

    return jax.tree.map(in_order, cycles, rests), count


def _steps(
    bodies: tuple[Face, Sticking],
    begin: Steps,
    start: Array | None,
    path: tuple[Array, np.ndarray, np.ndarray, np.ndarray],
) -> Steps:
    """Levels of a path.

    The search for a level starts where the last step would lead if it went on.

    Parameters
    ----------
    begin : level before it
    start : displacement of the load after the pressing; None until it is known
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
    start = jnp.zeros(()) if start is None else start
    return lax.scan(step, (begin, *still, start), tuple(map(jnp.asarray, path)))[1]


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

"""Contact of bodies on a face, in backward load steps."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.bodies.contact_input import Problem
from jbeamshell.bodies.face_law import Pairs
from jbeamshell.bodies.face_step import TOLERANCE, Face, take_step
from jbeamshell.bodies.joined import joined
from jbeamshell.bodies.levels import Found, Levels
from jbeamshell.common.checks import TINY, is_traced, require
from jbeamshell.common.small import Small

STEPS = 32  # per half cycle
MOST_CYCLES = 16  # until the loop is steady
PRESSING = 8  # steps in which the bolts are tightened with friction
REPEATS = 3e-3  # slip left over by a steady cycle, over its largest range: .2 % of D
SLIDES = 1e-9  # of friction times reaction, within which a pair is at its limit
TOUCHES = 1e-9  # of the largest reaction, below which one is that of an open pair, rounded


class Steps(NamedTuple):
    """Steps of a path: loads, displacements and forces of the pairs at the end of each."""

    load: Array
    v: Array
    force: Array
    error: Array
    iterations: Array


class Bodies(NamedTuple):
    """Bodies on their face.

    Attributes
    ----------
    face : their face, the surfaces' softness among the bodies
    flexibility : (m, m) displacements per load while the face does not move
    softness : (n, 3) displacement per force of the surfaces at each pair
    """

    face: Face
    flexibility: Array
    softness: Array

    @classmethod
    def of(cls, problem: Problem) -> Bodies:
        """Bodies of a problem, joined."""
        upper, lower = problem.upper, problem.lower
        n = upper.places.shape[0]
        held = np.array(upper.fixed) & (True if lower is None else np.array(lower.fixed))
        held = held.reshape(n, 3)
        soft = jnp.where(held, 0.0, problem.softness)
        hessian, size = joined(upper, lower), 3 * n
        stiffness, loads = hessian[:size, :size], -hessian[:size, size:]
        rest = -hessian[size:, size:]
        if is_traced(soft) or np.any(np.asarray(soft)):
            stiffness, loads, rest = _on_surfaces(stiffness, loads, rest, soft.ravel())
        own = jnp.diag(stiffness).reshape(n, 3)
        scale = jnp.stack([jnp.max(own[:, :2], axis=1), own[:, 2]], axis=1)
        scale = jnp.where(scale > 0.0, scale, jnp.max(own))  # of a pair that supports hold
        pairs = Pairs(
            friction=jnp.broadcast_to(problem.friction, (n,)),
            gap=problem.gap,
            roughness=problem.roughness,
            scale=lax.stop_gradient(scale),
        )
        return cls(Face(stiffness, loads, jnp.asarray(held), pairs), rest, soft)

    def driven(self) -> Face:
        """Face whose first load is a displacement d = f' v + c P, solved for P."""
        face, rest = self.face, self.flexibility
        pull, soft = face.loads[:, 0], rest[0, 0]
        fix = "the pulled nodes are in the contact: take control='force'"
        require("control", "displacement", is_traced(soft) or bool(soft > 0.0), fix)
        others = face.loads[:, 1:] - jnp.outer(pull, rest[0, 1:]) / soft
        return face._replace(
            stiffness=face.stiffness + jnp.outer(pull, pull) / soft,
            loads=jnp.column_stack([pull / soft, others]),
        )


def solved(problem: Problem) -> Found:
    """Levels of a contact, its cycles until it is steady, and levels in half as many steps.

    A cycle is steady if its slip ends where it began.  The cycles after it are copies, and so are
    those after as many as are wanted at most.
    """
    bodies, loads = Bodies.of(problem), problem.loads
    face = bodies.driven() if problem.control == "displacement" else bodies.face
    settings = problem.assembly == "frictional", problem.half
    steps, count = _walk((face, loads, jnp.asarray(MOST_CYCLES)), *settings)
    levels = _in_levels((bodies, steps), problem.control)
    if problem.unit is None or is_traced(levels) or not bool(jnp.all(levels.sound)):
        return Found(levels, count)
    rests = loads.at[1::2].set(loads[:-1:2])  # rests between them: one program serves both
    fewer, _ = _walk((face, rests, count), *settings)
    every_second = jax.tree.map(lambda a: np.asarray(a)[::2], fewer)
    coarse = _in_levels((bodies, every_second), problem.control)
    return Found(levels, count, coarse)


@jax.jit
def _on_surfaces(
    stiffness: Array, loads: Array, rest: Array, soft: Array
) -> tuple[Array, Array, Array]:
    """Stiffness, loads and flexibility of bodies in series with their surfaces.

    With w the displacement of the bodies and lambda = K w - f P, the pairs move by
    v = w + c lambda.
    """
    size = soft.size
    both = jnp.column_stack([stiffness, loads])
    found = jnp.linalg.solve(jnp.eye(size) + stiffness * soft, both)
    series = 0.5 * (found[:, :size] + found[:, :size].T)
    return series, found[:, size:], rest + (loads.T * soft) @ found[:, size:]


@functools.partial(Small, level=0)
def _walk(
    inputs: tuple[Face, Array, Array], frictional: bool, half: int | None
) -> tuple[Steps, Array]:
    """Levels of the path, and the number of cycles until it is steady, see `_until_steady`.

    The pressing, its first level (m,), is taken in steps.

    Parameters
    ----------
    inputs : face, loads (levels, m), and most cycles
    frictional : True if the face is pressed with friction
    half : steps of half a cycle; None if all levels are taken
    """
    face, loads, most = inputs
    parts = np.arange(1, PRESSING + 1) / PRESSING if frictional else np.ones(1)
    last = parts.size - 1
    cycles = 0 if half is None else 2 * half * MOST_CYCLES
    rise = loads.shape[0] - cycles
    ways = jnp.concatenate([jnp.asarray(parts)[:, None] * loads[0], loads[1:rise]])
    # One loop for the pressing and for what comes then: each step compiles for seconds.
    rubs = np.append(np.full(parts.size, float(frictional)), np.ones(rise - 1))
    begins = np.arange(rubs.size) == parts.size
    first = _steps(face, jnp.zeros(face.held.shape), ways, rubs, begins)
    pressed = jax.tree.map(lambda a: a[last : last + 1], first)._replace(
        error=jnp.max(first.error[: last + 1], keepdims=True),
        iterations=jnp.sum(first.iterations[: last + 1], keepdims=True),
    )
    levels = jax.tree.map(lambda a, b: jnp.concatenate([a, b[last + 1 :]]), pressed, first)
    if half is None:
        return levels, jnp.asarray(0)
    cycle = loads[rise : rise + 2 * half]
    rest, count = _until_steady(face, jax.tree.map(lambda a: a[-1], first), cycle, most)
    return jax.tree.map(lambda a, b: jnp.concatenate([a, b]), levels, rest), count


def _until_steady(face: Face, begin: Steps, cycle: Array, most: Array) -> tuple[Steps, Array]:
    """Levels of all cycles, and the number of those that were taken.

    Parameters
    ----------
    begin : level after the first loading
    cycle : (levels, m) loads of a cycle
    """

    def go(
        carry: tuple[Steps, Array], number: Array
    ) -> tuple[tuple[Steps, Array], tuple[Steps, Array]]:
        before, steady = carry

        def taken() -> Steps:
            none = np.zeros(cycle.shape[0])
            return _steps(face, before.v[-1], cycle, none + 1.0, none > 0.0)

        now = lax.cond(steady, lambda: before, taken)
        ends = lax.stop_gradient(now.v[..., :2])
        apart = jnp.max(jnp.abs(ends[-1] - lax.stop_gradient(before.v[-1, :, :2])))
        repeats = apart <= REPEATS * jnp.max(jnp.ptp(ends, axis=0))
        lost = ~(now.error[-1] <= TOLERANCE)
        ends_here = repeats | lost | (number + 1 >= most)
        return (now, steady | ends_here), (now, steady)

    start = jax.tree.map(lambda a: jnp.broadcast_to(a, (cycle.shape[0], *a.shape)), begin)
    _, (cycles, copied) = lax.scan(go, (start, jnp.asarray(False)), jnp.arange(MOST_CYCLES))
    levels = jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:]), cycles)
    return levels, jnp.sum(~copied)


def _steps(face: Face, start: Array, loads: Array, rubs: np.ndarray, begins: np.ndarray) -> Steps:
    """Levels of a path of loads (steps, m).

    The search for a level starts where the last step would lead if it went on.

    Parameters
    ----------
    rubs : (steps,) part of the friction that acts
    begins : (steps,) True where a path begins, so that nothing goes on
    """

    def step(
        carry: tuple[Array, Array, Array], now: tuple[Array, Array, Array]
    ) -> tuple[Any, Steps]:
        load, rub, begin = now
        before, moved, last = carry
        moved, last = (jnp.where(begin, 0.0, a) for a in (moved, last))
        further = load - last[0]
        rests = jnp.all(further == 0.0)
        goes_on = jnp.sum(further * last[1]) / jnp.maximum(jnp.sum(last[1] ** 2), TINY)
        guess = before + jnp.clip(goes_on, 0.0, 1.0) * moved
        pairs = face.pairs._replace(friction=rub * face.pairs.friction)
        own = face._replace(pairs=pairs)
        found = take_step(own, before, load, guess)
        force = own.reaction(found.v, load)
        level = Steps(load, found.v, force, found.error, found.iterations)
        moved = jnp.where(rests, moved, found.v - before)
        return (found.v, moved, jnp.stack([load, jnp.where(rests, last[1], further)])), level

    still = jnp.zeros((2, loads.shape[1]))
    whole = loads, jnp.asarray(rubs), jnp.asarray(begins)
    return lax.scan(step, (start, jnp.zeros_like(start), still), whole)[1]


@functools.partial(Small, level=0)
def _in_levels(inputs: tuple[Bodies, Steps], control: str) -> Levels:
    """Levels of steps, the displacements since the pressing."""
    bodies, steps = inputs
    face, rest = bodies.face, bodies.flexibility
    count = steps.v.shape[0]
    moved = (steps.v - steps.v[0]).reshape(count, -1) @ face.loads
    loads = steps.load
    if control == "displacement":
        others = rest[0, 1:] @ (loads[:, 1:] - loads[0, 1:]).T
        loads = loads.at[:, 0].set((loads[:, 0] - moved[:, 0] - others) / rest[0, 0])
    slip, normal = steps.v[..., :2] - steps.v[0, :, :2], steps.force[..., 2]
    pull = -jnp.where(face.held, 0.0, steps.force)[..., :2]
    apart = steps.v[..., 2] - bodies.softness[:, 2] * normal
    touching = normal > TOUCHES * jnp.max(normal, axis=-1, keepdims=True)
    friction = face.pairs.friction
    at_limit = jnp.linalg.norm(pull, axis=-1) >= (1.0 - SLIDES) * friction * normal
    mean = 0.5 * (pull[1:] + pull[:-1])
    work = jnp.sum(mean * jnp.diff(slip, axis=0), axis=(1, 2))
    sound = lax.stop_gradient(steps.error) <= TOLERANCE
    return Levels(
        loads=loads,
        displacements=moved + (loads - loads[0]) @ rest,
        slip=slip,
        gap=face.pairs.gap + apart,
        friction_force=pull,
        normal_force=normal,
        slipping=touching & at_limit & (friction > 0.0),
        slip_work=jnp.append(0.0, work),
        sound=jnp.cumsum(~sound) == 0,
        error=steps.error,
        iterations=steps.iterations,
    )

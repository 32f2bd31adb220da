"""Contact of bodies on a face, in backward load steps."""

from __future__ import annotations

import functools

import numpy as np

from jbeamshell.bodies.coarser_mesh import coarser
from jbeamshell.bodies.contact_input import Problem
from jbeamshell.bodies.face import Sticking
from jbeamshell.bodies.face_bodies import Bodies, bodies_of
from jbeamshell.bodies.face_path import MOST_CYCLES, Steps, levels_of
from jbeamshell.bodies.face_program import traced_levels
from jbeamshell.bodies.face_step import BALANCED
from jbeamshell.bodies.levels import Found, Levels
from jbeamshell.common.checks import is_traced
from jbeamshell.common.numbers_of import numbers_of, plain, without_slopes
from jbeamshell.common.small import Small, always
from jbeamshell.common.threads import on_one_core

__all__ = ["MOST_CYCLES", "STEPS", "solved"]

STEPS = 32  # per half cycle
SLIDES = 1e-9  # of friction times reaction, within which a point is at its limit
TOUCHES = 1e-9  # of the largest reaction, below which one is that of an open point, rounded


def solved(problem: Problem) -> Found:
    """Levels of a contact, its cycles until it is steady, and levels in half as many steps.

    A cycle is steady if its slip ends where it began.  The same bodies on a coarser mesh of their
    face, in half as many steps, show what the mesh is worth.  Where numbers are traced, the steps
    are a program of JAX, which compares nothing and always has as many cycles: the path rests at
    its amplitude before the first one that is taken, so that the last one always is the steady one.
    """
    if is_traced(problem):
        bodies = bodies_of(problem)
        frictional, driven = problem.assembly == "frictional", problem.control == "displacement"
        steps, count = traced_levels(bodies.face, problem.loads, problem.half, frictional, driven)
        return Found(_in_levels((bodies, steps)), count)
    return _by_numpy(plain(problem))


@on_one_core
def _by_numpy(problem: Problem) -> Found:
    """The same of numbers alone, which compiles nothing."""
    frictional, driven = problem.assembly == "frictional", problem.control == "displacement"
    bodies, half = bodies_of(problem), problem.half
    sticking = Sticking.of(bodies.face)
    steps, count = levels_of((bodies.face, sticking), problem.loads, half, frictional, driven)
    levels = _in_levels((bodies, steps))
    found = Found(levels, count)
    if problem.unit is None or not np.all(levels.sound):
        return found
    fewer = problem.loads[np.append(0, np.arange(2, len(problem.loads), 2))]
    half = None if half is None else half // 2
    meshes = [(bodies, sticking)]
    onto = None if problem.points else coarser(problem)
    if onto is not None:
        small = bodies_of(problem, onto)
        meshes.append((small, Sticking.of(small.face)))
    halves = []
    for each, stuck in meshes:
        steps, _ = levels_of((each.face, stuck), fewer, half, frictional, driven, count)
        halves.append(_in_levels((each, steps)))
    return found._replace(**dict(zip(("coarse", "coarser"), halves, strict=False)))


@functools.partial(Small, level=0, by_numpy=always)
def _in_levels(inputs: tuple[Bodies, Steps]) -> Levels:
    """Levels of steps, the displacements since the pressing."""
    bodies, steps = inputs
    xp = numbers_of(steps.u)
    face, points = bodies.face, bodies.face.points
    moved = (steps.u - steps.u[0]) @ face.loads + (steps.load - steps.load[0]) @ face.flexibility
    slip, normal = (steps.slip - steps.slip[0])[..., :2], steps.force[..., 2]
    pull = -xp.where(bodies.held, 0.0, steps.force)[..., :2]
    apart = steps.slip[..., 2] - normal / points.springs[:, 1] + bodies.softness * normal
    touching = normal > TOUCHES * xp.max(normal, axis=-1, keepdims=True)
    at_limit = xp.linalg.norm(pull, axis=-1) >= (1.0 - SLIDES) * points.friction * normal
    mean = 0.5 * (pull[1:] + pull[:-1])
    work = xp.sum(mean * xp.diff(slip, axis=0), axis=(1, 2))
    sound = without_slopes(steps.error) <= BALANCED
    return Levels(
        loads=steps.load,
        displacements=moved,
        slip=slip,
        gap=points.gap + apart,
        friction_force=pull,
        normal_force=normal,
        slipping=touching & at_limit & (points.friction > 0.0),
        slip_work=xp.append(0.0, work),
        sound=xp.cumsum(~sound) == 0,
        error=steps.error,
        iterations=steps.iterations,
    )

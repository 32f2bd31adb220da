"""Contact of bodies on a face, pressed and loaded to and fro, in backward load steps."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.common.checks import (
    NOT_NEGATIVE,
    TINY,
    as_leaf,
    is_traced,
    require_choice,
    require_number,
)
from jbeamshell.common.errors import Status, UnconvergedError, warn_of_doubts
from jbeamshell.contact_face.body import FaceBody
from jbeamshell.contact_face.face_input import MOST_CYCLES, check_bodies, load_path
from jbeamshell.contact_face.joined import Joined, joined
from jbeamshell.contact_face.step import ITERATIONS, TOLERANCE, Face, take_step
from jbeamshell.contact_line.contact_input import checked_bolts
from jbeamshell.history.face_history import FaceHistory
from jbeamshell.numerics.cycles import closed_cycles
from jbeamshell.scene.keys import ASSEMBLIES, CONTROLS
from jbeamshell.scene.parts import unit_path

STEPS = 32  # per half cycle
PRESSING = 8  # steps in which the bolts are tightened with friction
REPEATS = 3e-3  # slip left over by a steady cycle, over its largest range: .2 % of D
FIX = "take a smaller amplitude or more steps, or control='displacement'"


class Levels(NamedTuple):
    """Levels of a path: loads, displacements and forces of the pairs at each step."""

    load: Array
    v: Array
    force: Array
    error: Array
    iterations: Array


def solve_faces(
    upper: FaceBody,
    lower: FaceBody | None = None,
    *,
    friction: ArrayLike = 0.1,
    amplitude: ArrayLike = 1.0,
    cycles: int | None = None,
    steps_per_half_cycle: int = STEPS,
    control: str = "force",
    path: ArrayLike | None = None,
    bolts: ArrayLike = 1.0,
    gap: ArrayLike = 0.0,
    softness: ArrayLike = 0.0,
    roughness: ArrayLike = 0.0,
    assembly: str = "frictional",
    throw: bool = True,
) -> FaceHistory:
    """Press bodies together on a face, load them to and fro, and return the history.

    All numbers may be traced: those of the bodies, friction, amplitude,
    bolts, gap, softness and roughness.

    Parameters
    ----------
    upper : body that is pulled
    lower : body below, on matching nodes and with the same normals; None is a rigid base
    friction : Coulomb's coefficient mu, a number or (n,)
    amplitude, steps_per_half_cycle : load path, 0 to A, then cycles A, -A, A
    cycles : number of cycles; None goes on until the slip repeats, 16 at most.  A traced history
        always has 16, those after the first steady one copied at no cost
    control : "force" or "displacement", what the amplitude is of
    path : (levels,) loads instead of the cycles
    bolts : size of each pressing load of the bodies, a number or one for each
    gap : distance of the nodes before anything presses, a number or (n,)
    softness : displacement per pressure of the surfaces themselves, tangential and normal, a
        number or (2,), length per stress; 0 is rigid contact
    roughness : (2,) h and p_0 of rough surfaces, which approach each other by h log(1 + p / p_0)
        under a pressure p (exponential heights, Greenwood and Williamson 1966); 0 is smooth
    assembly : "frictional", as bolts are tightened one with the other in several steps, or
        "frictionless", which locks no shear in; a body that friction alone holds needs the first
    throw : True raises for a load without equilibrium and warns of doubts; False returns NaN, and
        leaves both to ``history.status`` and ``history.doubts``

    Returns
    -------
    FaceHistory

    Raises
    ------
    InputError
        for numbers that make no sense, faces that do not match, or if nothing pulls or presses
    UnconvergedError
        if a load has no equilibrium, such as beyond gross slip

    Warns
    -----
    DoubtfulWarning
        if the result may still be wrong, see `jbeamshell.FaceHistory.doubts`
    """
    check_bodies(upper, lower)
    require_choice("assembly", assembly, ASSEMBLIES)
    require_choice("control", control, CONTROLS)
    require_number("friction", jnp.min(as_leaf(friction)), NOT_NEGATIVE, low=-TINY)
    sizes = checked_bolts(upper, lower, bolts)
    loads = load_path(amplitude, cycles, steps_per_half_cycle, path, sizes)
    bodies = joined(upper, lower, friction, gap, softness, roughness)
    face = bodies.driven() if control == "displacement" else bodies.face
    half = steps_per_half_cycle if path is None and cycles is None else None
    frictional, most = assembly == "frictional", jnp.asarray(MOST_CYCLES)
    levels, count = _walk(face, loads, frictional, half, most)
    last = loads.shape[0] if half is None else 1 + unit_path(MOST_CYCLES, half).size
    if half is not None and not is_traced(levels):
        last = 1 + unit_path(int(count), half).size
    history = _history(upper, bodies, _first(levels, last), control, assembly)
    if path is None and not is_traced(history) and history.converged:
        every_second = loads.at[1::2].set(loads[:-1:2])  # rests between them: one program for both
        levels, _ = _walk(face, every_second, frictional, half, count)
        levels = jax.tree.map(lambda a: a[:last:2], levels)
        coarse = _history(upper, bodies, levels, control, assembly)
        apart = history.dissipation - coarse.dissipation
        history = eqx.tree_at(lambda h: h.change, history, apart)
    if path is None and is_traced(history):  # its loads are known but for their size
        known = np.append(0.0, unit_path(cycles or MOST_CYCLES, steps_per_half_cycle))
        history = dataclasses.replace(history, cycles=closed_cycles(known))
    if not is_traced(history) and throw:
        _demand(history)
        warn_of_doubts(history.doubts, stacklevel=2)
    return history


def _first(levels: Levels, count: int) -> Levels:
    """First levels of a path."""
    return jax.tree.map(lambda a: a[:count], levels)


@eqx.filter_jit
def _walk(
    face: Face, loads: Array, frictional: bool, half: int | None, most: Array
) -> tuple[Levels, Array]:
    """Levels of the path, and the number of cycles until it is steady, see `_until_steady`.

    The pressing, its first level (m,), is taken in steps.
    """
    start = jnp.zeros(face.held.shape)
    parts = np.arange(1, PRESSING + 1) / PRESSING if frictional else np.ones(1)
    smooth = face.pairs._replace(friction=jnp.zeros_like(face.pairs.friction))
    pressing = face if frictional else face._replace(pairs=smooth)
    first = _steps(pressing, start, jnp.asarray(parts)[:, None] * loads[0])
    pressed = jax.tree.map(lambda a: a[-1:], first)._replace(
        error=jnp.max(first.error, keepdims=True),
        iterations=jnp.sum(first.iterations, keepdims=True),
    )
    if half is None:
        rest, count = _steps(face, pressed.v[0], loads[1:]), jnp.asarray(0)
    else:
        rest, count = _until_steady(face, pressed.v[0], loads[1:], half, most)
    return jax.tree.map(lambda a, b: jnp.concatenate([a, b]), pressed, rest), count


def _until_steady(
    face: Face, begin: Array, loads: Array, half: int, most: Array
) -> tuple[Levels, Array]:
    """Levels of the first loading and of all cycles, and the number of those that were taken.

    A cycle is steady if its slip ends where it began.  The cycles after it are copies, and so are
    those after as many as are wanted at most.
    """
    rise = loads.shape[0] - 2 * half * MOST_CYCLES
    first = _steps(face, begin, loads[:rise])
    cycle = loads[rise : rise + 2 * half]

    def go(
        carry: tuple[Levels, Array], number: Array
    ) -> tuple[tuple[Levels, Array], tuple[Levels, Array]]:
        before, steady = carry

        def taken() -> Levels:
            return _steps(face, before.v[-1], cycle)

        now = lax.cond(steady, lambda: before, taken)
        ends = lax.stop_gradient(now.v[..., :2])
        apart = jnp.max(jnp.abs(ends[-1] - lax.stop_gradient(before.v[-1, :, :2])))
        repeats = apart <= REPEATS * jnp.max(jnp.ptp(ends, axis=0))
        lost = ~(now.error[-1] <= TOLERANCE)
        ends_here = repeats | lost | (number + 1 >= most)
        return (now, steady | ends_here), (now, steady)

    start = jax.tree.map(lambda a: jnp.broadcast_to(a[-1], (2 * half, *a.shape[1:])), first)
    _, (cycles, copied) = lax.scan(go, (start, jnp.asarray(False)), jnp.arange(MOST_CYCLES))
    flat = jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:]), cycles)
    levels = jax.tree.map(lambda a, b: jnp.concatenate([a, b]), first, flat)
    return levels, jnp.sum(~copied)


def _steps(face: Face, start: Array, loads: Array) -> Levels:
    """Levels of a path of loads (steps, m).

    The search for a level starts where the last step would lead if it went on.
    """

    def step(carry: tuple[Array, Array, Array], load: Array) -> tuple[Any, Levels]:
        before, moved, last = carry
        further = load - last[0]
        rests = jnp.all(further == 0.0)
        goes_on = jnp.sum(further * last[1]) / jnp.maximum(jnp.sum(last[1] ** 2), TINY)
        guess = before + jnp.clip(goes_on, 0.0, 1.0) * moved
        found = take_step(face, before, load, guess)
        force = face.reaction(found.v, load)
        level = Levels(load, found.v, force, found.error, found.iterations)
        moved = jnp.where(rests, moved, found.v - before)
        return (found.v, moved, jnp.stack([load, jnp.where(rests, last[1], further)])), level

    still = jnp.zeros((2, loads.shape[1]))
    return lax.scan(step, (start, jnp.zeros_like(start), still), loads)[1]


def _history(
    upper: FaceBody,
    bodies: Joined,
    levels: Levels,
    control: str,
    assembly: str,
) -> FaceHistory:
    """History of levels, the displacements since the pressing."""
    face, rest = bodies.face, bodies.flexibility
    steps = levels.v.shape[0]
    moved = (levels.v - levels.v[0]).reshape(steps, -1) @ face.loads
    loads = levels.load
    if control == "displacement":
        others = rest[0, 1:] @ (loads[:, 1:] - loads[0, 1:]).T
        loads = loads.at[:, 0].set((loads[:, 0] - moved[:, 0] - others) / rest[0, 0])
    displacements = moved + (loads - loads[0]) @ rest
    sound = jax.lax.stop_gradient(levels.error) <= TOLERANCE
    sound = jnp.cumsum(~sound) == 0
    keep = lambda a: jnp.where(sound.reshape(-1, *(1,) * (a.ndim - 1)), a, jnp.nan)  # noqa: E731
    slip, pull = levels.v[..., :2] - levels.v[0, :, :2], jnp.where(face.held, 0.0, levels.force)
    apart = levels.v[..., 2] - bodies.softness[:, 2] * levels.force[..., 2]
    return FaceHistory(
        places=upper.places,
        normals=upper.normals,
        tributary=upper.areas,
        loads=keep(loads),
        displacements=keep(displacements),
        slip=keep(slip),
        gap=keep(face.pairs.gap + apart),
        traction=keep(-pull[..., :2]),
        reaction=keep(levels.force[..., 2]),
        status=jnp.where(sound, int(Status.CONVERGED), int(Status.MAX_ITERATIONS)),
        error=levels.error,
        iterations=levels.iterations,
        friction=face.pairs.friction,
        change=jnp.asarray(jnp.nan),
        cycles=() if is_traced(levels.load) else _cycles(np.asarray(levels.load)),
        control=control,
        assembly=assembly,
    )


def _cycles(loads: np.ndarray) -> tuple[tuple[int, int, int], ...]:
    """Closed cycles of the first load, none where the others change."""
    return closed_cycles(loads[:, 0]) if np.all(loads[:, 1:] == loads[0, 1:]) else ()


def _demand(history: FaceHistory) -> None:
    """Refuse a path without equilibrium."""
    failed = np.asarray(history.status) != Status.CONVERGED
    if not failed.any():
        return
    first = int(np.argmax(failed))
    if first == 0:
        raise UnconvergedError(
            "bolts: no equilibrium while they are tightened; most likely nothing holds a body "
            "along the face: hold it, or give more friction"
        )
    raise UnconvergedError(
        f"step {first}: no equilibrium after {ITERATIONS} iterations; most likely all of the "
        f"contact slides: {FIX}"
    )

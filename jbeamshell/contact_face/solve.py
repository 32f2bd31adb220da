"""Contact of bodies on a face, pressed and loaded to and fro, in backward load steps."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

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
    require,
    require_choice,
    require_count,
    require_finite,
    require_number,
)
from jbeamshell.common.errors import Status, UnconvergedError, warn_of_doubts
from jbeamshell.contact_face.body import RIGID, FaceBody
from jbeamshell.contact_face.pair import Pairs, slip_after
from jbeamshell.contact_face.step import ITERATIONS, TOLERANCE, Face, take_step
from jbeamshell.contact_line.contact_input import checked_bolts
from jbeamshell.contact_line.pair import together
from jbeamshell.history.face_history import FaceHistory
from jbeamshell.numerics.cycles import closed_cycles
from jbeamshell.scene.keys import ASSEMBLIES, CONTROLS
from jbeamshell.scene.parts import unit_path

STEPS = 32  # per half cycle
PRESSING = 8  # steps in which the bolts are tightened with friction
MATCH = 1e-6  # of the face's extent, within which nodes match
MOST_CYCLES = 16  # until the loop is steady
REPEATS = 3e-3  # slip left over by a steady cycle, over its largest range: .2 % of D
FIX = "take a smaller amplitude or more steps, or control='displacement'"


class Levels(NamedTuple):
    """Levels of a path: loads, displacements, slip and forces at each step."""

    load: Array
    w: Array
    slip: Array
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
    assembly: str = "frictional",
    throw: bool = True,
) -> FaceHistory:
    """Press bodies together on a face, load them to and fro, and return the history.

    All numbers may be traced: those of the bodies, friction, amplitude, bolts, gap and softness.

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
    _check_bodies(upper, lower)
    lower = lower if lower is None or is_traced(upper, lower) else _grounded(upper, lower)
    require_choice("assembly", assembly, ASSEMBLIES)
    require_choice("control", control, CONTROLS)
    require_number("friction", jnp.min(as_leaf(friction)), NOT_NEGATIVE, low=-TINY)
    face, rest, sizes = _joined(upper, lower, friction, bolts, gap, softness)
    loads = _loads(amplitude, cycles, steps_per_half_cycle, path, sizes)
    driven = _driven(face, rest) if control == "displacement" else face
    half = steps_per_half_cycle if path is None and cycles is None else None
    frictional, most = assembly == "frictional", jnp.asarray(MOST_CYCLES)
    levels, count = _walk(driven, loads, frictional, half, most)
    last = loads.shape[0] if half is None else 1 + unit_path(MOST_CYCLES, half).size
    if half is not None and not is_traced(levels):
        last = 1 + unit_path(int(count), half).size
    history = _history(upper, face, rest, _first(levels, last), control, assembly)
    if path is None and not is_traced(history) and history.converged:
        every_second = None if half is None else half // 2
        levels, _ = _walk(driven, loads[::2], frictional, every_second, count)
        coarse = _history(upper, face, rest, _first(levels, last // 2 + 1), control, assembly)
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


def _check_bodies(upper: FaceBody, lower: FaceBody | None) -> None:
    """Refuse what is no body, faces that do not match, and bodies that nothing pulls."""
    for key, body in (("upper", upper), ("lower", lower)):
        fits = isinstance(body, FaceBody) or (body is None and key == "lower")
        require(key, type(body).__name__, fits, "give a jbeamshell.FaceBody")
    if lower is not None and not is_traced(upper, lower):
        places, below = np.asarray(upper.places), np.asarray(lower.places)
        same = places.shape == below.shape
        fix = "must have the nodes of the upper face, in the same order"
        require("lower.places", below.shape, same, fix)
        apart = np.linalg.norm(places - below, axis=1)
        worst = int(np.argmax(apart))
        near = apart[worst] <= MATCH * np.max(np.ptp(places, axis=0))
        require("lower.places", f"node {worst}, {apart[worst]:.3g} away", bool(near), fix)
        turned = np.max(np.abs(np.asarray(upper.normals) - np.asarray(lower.normals)))
        fix = "must be those of the upper face, from the body below to the one above"
        require("lower.normals", f"{turned:.3g} off", bool(turned < MATCH), fix)
    bodies = [body for body in (upper, lower) if body is not None]
    pulls = [body.forces[:, 0] for body in bodies] + [body.flexibility[0] for body in bodies]
    pulled = is_traced(pulls) or any(bool(np.any(np.asarray(pull))) for pull in pulls)
    require("pull", 0, pulled, "nothing pulls the bodies: condense one with pull=")


def _grounded(upper: FaceBody, lower: FaceBody) -> FaceBody:
    """Lower body, on springs against the rigid motions of both bodies that nothing holds.

    The springs carry nothing, because the loads along these motions are in balance.
    """
    motions = upper.rigid_motions()
    loose = ~(np.array(upper.fixed) | np.array(lower.fixed))
    stiffness = np.asarray(upper.stiffness) + np.asarray(lower.stiffness)
    stiff = float(np.max(np.diag(stiffness)))
    held = np.einsum("ki,ij,lj->kl", motions, stiffness, motions)
    held += stiff * (motions * ~loose) @ motions.T
    alone = np.einsum("ki,i,li->kl", motions, np.diag(stiffness), motions)
    sizes = np.sqrt(np.diag(alone))
    values, vectors = np.linalg.eigh(held / sizes[:, None] / sizes)
    free = (vectors[:, values < RIGID] / sizes[:, None]).T @ motions
    if not len(free):
        return lower
    count = max(upper.forces.shape[1], lower.forces.shape[1])
    forces = np.zeros((free.shape[1], count))
    for body in (upper, lower):
        forces[:, : body.forces.shape[1]] += np.asarray(body.forces)
    pushed = np.abs(free @ forces) / (np.abs(free) @ np.abs(forces) + TINY)
    fix = "no support holds them, and the loads are not in balance: hold a body, or balance them"
    require(
        "bodies", f"pushed by {np.max(pushed):.2g} of the loads", bool(np.max(pushed) < 1e-6), fix
    )
    springs = stiff * free.T @ np.linalg.inv(free @ free.T) @ free
    return eqx.tree_at(lambda body: body.stiffness, lower, lower.stiffness + springs)


def _loads(
    amplitude: ArrayLike,
    cycles: int | None,
    steps_per_half_cycle: int,
    path: ArrayLike | None,
    sizes: Array,
) -> Array:
    """Loads (levels + 1, m): the pressing first."""
    pressing = jnp.append(0.0, sizes)
    if path is None:
        require_number("amplitude", amplitude)
        if cycles is not None:
            require_count("cycles", cycles, 1)
        require_count("steps_per_half_cycle", steps_per_half_cycle, 8)
        fix = "take a multiple of 4: every second step estimates the error"
        require("steps_per_half_cycle", steps_per_half_cycle, steps_per_half_cycle % 4 == 0, fix)
        targets = as_leaf(amplitude) * jnp.asarray(
            unit_path(cycles or MOST_CYCLES, steps_per_half_cycle)
        )
    else:
        targets = as_leaf(path, "path")
        require_finite("path", targets)
    fix = f"give (levels,) loads to and fro, or (levels, {pressing.size}) of all loads"
    both = targets.ndim in (1, 2) and targets.size > 0
    require("path", targets.shape, both, fix)
    if targets.ndim == 1:
        targets = targets[:, None] * jnp.eye(1, pressing.size) + pressing
    require("path", targets.shape, targets.shape[1] == pressing.size, fix)
    return jnp.concatenate([pressing[None], targets])


@jax.jit
def _potential(upper: FaceBody, lower: FaceBody | None) -> Array:
    """Second derivatives (3n + m, 3n + m) in the relative displacements and the loads."""
    count = max(body.forces.shape[1] for body in (upper, lower) if body is not None)
    above = _of_body(upper, count)
    if lower is None:
        return above
    fixed = np.array(upper.fixed), np.array(lower.fixed)
    return together(above, _of_body(lower, count), *fixed)[0]


def _of_body(body: FaceBody, count: int) -> Array:
    """Second derivatives of a body's potential, on as many loads as both bodies have."""
    missing = (0, count - body.forces.shape[1])
    forces = -jnp.pad(body.forces, ((0, 0), missing))
    return jnp.block(
        [[body.stiffness, forces], [forces.T, -jnp.pad(body.flexibility, (missing,) * 2)]]
    )


def _joined(
    upper: FaceBody,
    lower: FaceBody | None,
    friction: ArrayLike,
    bolts: ArrayLike,
    gap: ArrayLike,
    softness: ArrayLike,
) -> tuple[Face, Array, Array]:
    """Bodies on their face, their flexibility (m, m), and the sizes (m - 1,) of the bolts."""
    n = upper.areas.size
    sizes = checked_bolts(upper, lower, bolts)
    distance, soft = as_leaf(gap, "gap"), as_leaf(softness, "softness")
    require(
        "gap", gap, distance.shape in ((), (n,)), f"give a number, or one for each of {n} nodes"
    )
    require(
        "softness",
        softness,
        soft.shape in ((), (2,)),
        "give a number, or a tangential and a normal one",
    )
    for key, value in (("gap", distance), ("softness", soft)):
        require_finite(key, value)
        require(
            key,
            value,
            is_traced(value) or bool(np.all(np.asarray(value) >= 0.0)),
            "must not be negative",
        )
    hessian = _potential(upper, lower)
    size = 3 * n
    stiffness, loads, rest = hessian[:size, :size], -hessian[:size, size:], -hessian[size:, size:]
    held = np.array(upper.fixed) & (True if lower is None else np.array(lower.fixed))
    own = jnp.diag(stiffness).reshape(n, 3)
    scale = jnp.stack([jnp.max(own[:, :2], axis=1), own[:, 2]], axis=1)
    scale = jnp.where(scale > 0.0, scale, jnp.max(own))  # of a pair that supports hold
    pairs = Pairs(
        friction=jnp.broadcast_to(as_leaf(friction), (n,)),
        gap=jnp.broadcast_to(distance, (n,)),
        softness=jnp.broadcast_to(soft, (2,)) / upper.areas[:, None],
        scale=lax.stop_gradient(scale),
    )
    return Face(stiffness, loads, jnp.asarray(held), pairs), rest, sizes


def _driven(face: Face, rest: Array) -> Face:
    """Bodies whose first load is the one that a displacement needs: d = f' w + c P solved for P."""
    pull, soft = face.loads[:, 0], rest[0, 0]
    fix = "the pulled nodes are in the contact: take control='force'"
    require("control", "displacement", is_traced(soft) or bool(soft > 0.0), fix)
    others = face.loads[:, 1:] - jnp.outer(pull, rest[0, 1:]) / soft
    return face._replace(
        stiffness=face.stiffness + jnp.outer(pull, pull) / soft,
        loads=jnp.column_stack([pull / soft, others]),
    )


@eqx.filter_jit
def _walk(
    face: Face, loads: Array, frictional: bool, half: int | None, most: Array
) -> tuple[Levels, Array]:
    """Levels of the path, and the number of cycles until it is steady, see `_until_steady`.

    The pressing, its first level (m,), is taken in steps.
    """
    n = face.stiffness.shape[0] // 3
    none = jnp.zeros((n, 3)), jnp.zeros((n, 2))
    parts = np.arange(1, PRESSING + 1) / PRESSING if frictional else np.ones(1)
    smooth = face.pairs._replace(friction=jnp.zeros_like(face.pairs.friction))
    pressing = face if frictional else face._replace(pairs=smooth)
    first = _steps(pressing, none, jnp.asarray(parts)[:, None] * loads[0])
    pressed = jax.tree.map(lambda a: a[-1:], first)
    if not frictional:
        pressed = pressed._replace(slip=pressed.w[..., :2])
    pressed = pressed._replace(
        error=jnp.max(first.error, keepdims=True),
        iterations=jnp.sum(first.iterations, keepdims=True),
    )
    begin = pressed.w[0], pressed.slip[0]
    if half is None:
        rest, count = _steps(face, begin, loads[1:]), jnp.asarray(0)
    else:
        rest, count = _until_steady(face, begin, loads[1:], half, most)
    return jax.tree.map(lambda a, b: jnp.concatenate([a, b]), pressed, rest), count


def _until_steady(
    face: Face, begin: tuple[Array, Array], loads: Array, half: int, most: Array
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
            return _steps(face, (before.w[-1], before.slip[-1]), cycle)

        now = lax.cond(steady, lambda: before, taken)
        ends = lax.stop_gradient(now.slip)
        apart = jnp.max(jnp.abs(ends[-1] - lax.stop_gradient(before.slip[-1])))
        repeats = apart <= REPEATS * jnp.max(jnp.ptp(ends, axis=0))
        lost = ~(now.error[-1] <= TOLERANCE)
        ends_here = repeats | lost | (number + 1 >= most)
        return (now, steady | ends_here), (now, steady)

    start = jax.tree.map(lambda a: jnp.broadcast_to(a[-1], (2 * half, *a.shape[1:])), first)
    _, (cycles, copied) = lax.scan(go, (start, jnp.asarray(False)), jnp.arange(MOST_CYCLES))
    flat = jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:]), cycles)
    levels = jax.tree.map(lambda a, b: jnp.concatenate([a, b]), first, flat)
    return levels, jnp.sum(~copied)


def _steps(face: Face, start: tuple[Array, Array], loads: Array) -> Levels:
    """Levels of a path of loads (steps, m)."""

    def step(at: tuple[Array, Array], load: Array) -> tuple[tuple[Array, Array], Levels]:
        w, slip = at
        found = take_step(face, w, slip, load)
        force = face.reaction(found.w, load)
        slip = jax.vmap(slip_after)(force, found.w, face.pairs)
        return (found.w, slip), Levels(load, found.w, slip, force, found.error, found.iterations)

    return lax.scan(step, start, loads)[1]


def _history(
    upper: FaceBody,
    face: Face,
    rest: Array,
    levels: Levels,
    control: str,
    assembly: str,
) -> FaceHistory:
    """History of levels, the displacements since the pressing."""
    steps = levels.w.shape[0]
    moved = (levels.w - levels.w[0]).reshape(steps, -1) @ face.loads
    loads = levels.load
    if control == "displacement":
        others = rest[0, 1:] @ (loads[:, 1:] - loads[0, 1:]).T
        loads = loads.at[:, 0].set((loads[:, 0] - moved[:, 0] - others) / rest[0, 0])
    displacements = moved + (loads - loads[0]) @ rest
    sound = jax.lax.stop_gradient(levels.error) <= TOLERANCE
    sound = jnp.cumsum(~sound) == 0
    held = face.held.reshape(-1, 3)
    keep = lambda a: jnp.where(sound.reshape(-1, *(1,) * (a.ndim - 1)), a, jnp.nan)  # noqa: E731
    slip, pull = levels.slip - levels.slip[0], jnp.where(held, 0.0, levels.force)
    return FaceHistory(
        places=upper.places,
        normals=upper.normals,
        tributary=upper.areas,
        loads=keep(loads),
        displacements=keep(displacements),
        slip=keep(slip),
        gap=keep(face.pairs.gap + levels.w[..., 2]),
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

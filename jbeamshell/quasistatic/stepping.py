"""Newton's method at every load level of a path, one scan over the path."""

from __future__ import annotations

import functools
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.common.errors import Status
from jbeamshell.mechanics.friction import plastic_slip
from jbeamshell.numerics.block_tridiagonal import BlockTridiagonal
from jbeamshell.numerics.newton import Newton
from jbeamshell.quasistatic import slip_patterns
from jbeamshell.quasistatic.load_path import LoadPath
from jbeamshell.quasistatic.prediction import (
    SMALLEST_SHARE,
    BeforeStep,
    Reversal,
    first_to_slip,
    last_reversal,
)
from jbeamshell.quasistatic.slip_patterns import Foreseen, Foresight, Memory
from jbeamshell.quasistatic.system import (
    ContactInput,
    ContactResponse,
    LoadLevel,
    Prescribed,
    System,
    V,
)
from jbeamshell.quasistatic.tangent import (
    Stiffness,
    in_blocks,
    initial_stiffness,
    matrix,
    nodal,
    residual_in_blocks,
    stiffness_at,
    with_v,
    zero_unknowns,
)
from jbeamshell.scene.keys import ARC_LENGTH
from jbeamshell.scene.scene import Scene

SLIPS = 0.5  # a node slips in a step when more than this part of its motion is inelastic
EVENLY = 0.5**0.5  # of a direction that is as much displacement as force
PIECES = (8, 64)  # a load step that fails is walked in so many pieces, or so many


class PathState(NamedTuple):
    """Where a path stands.

    Attributes
    ----------
    level : the level reached
    rest : u(L) after the pressure
    target, pressure : the controlled load and the part of the pressures reached
    turn : the last reversal
    change : (blocks, size) the last increment of the unknowns
    along : (2,) direction in which the path goes on, of u(L) and F L/(E' 2H); for the arc length
    sound : whether all steps so far found equilibrium
    """

    level: LoadLevel
    rest: Array
    target: Array
    pressure: Array
    turn: Reversal
    change: Array
    along: Array
    sound: Array


class Steps(NamedTuple):
    """What every step of a path leaves behind, stacked along the first axis; see `History`."""

    state: PathState
    displacement: Array
    slipping: Array
    slip_work: Array
    stored_energy: Array
    sinking: Array
    iterations: Array
    error: Array
    status: Array


def march(scene: Scene, start: PathState, path: LoadPath, solver: Newton) -> Steps:
    """Walk a load path in one scan.

    Parameters
    ----------
    scene : what is loaded
    start : where the path starts
    path : what is prescribed
    solver : of one step
    """
    system = System(scene)
    foresees = slip_patterns.applies(scene)
    if foresees and isinstance(solver, Foresight):
        return _as_foreseen(system, start, path, solver)
    if foresees:
        known = slip_patterns.known(system)
    else:
        rough = initial_stiffness(system, 1.0)
        if system.ends_depend_on_friction:
            smooth = initial_stiffness(system, 0.0)

    def step(state: PathState, to: LoadPath) -> tuple[PathState, Steps]:
        if foresees:
            foreseen = slip_patterns.step(
                known, slip_patterns.memory_of(state), lax.stop_gradient(to)
            )
            return _step(system, state, to, solver, None, foreseen)
        stiffness = rough
        if system.ends_depend_on_friction:
            stiffness = jax.tree.map(lambda a, b: jnp.where(to.rough > 0.0, a, b), rough, smooth)
        return _step(system, state, to, solver, stiffness, None)

    return lax.scan(step, start, path)[1]


_march = eqx.filter_jit(march)


def walk(scene: Scene, start: PathState, path: LoadPath, solver: Newton) -> Steps:
    """Walk a load path; a step that fails is walked again in pieces."""
    steps = _march(scene, start, path, Foresight.of(solver, checked=True))
    return steps if bool(steps.state.sound[-1]) else recover(scene, steps, path, solver, start)


def _step(
    system: System,
    state: PathState,
    to: LoadPath,
    solver: Newton,
    stiffness: Stiffness | None,
    foreseen: Foreseen | None,
) -> tuple[PathState, Steps]:
    before = state.level
    if foreseen is None:
        turn = last_reversal(
            system, BeforeStep(before.traction, before.cap, state.target, state.turn), to
        )
        guess = _guess(system, state, to, turn)
    else:
        turn, guess = foreseen.memory.turn, foreseen.change.T
    prescribed = Prescribed(to.target, to.pressure, state.rest, to.rough)
    if system.control == ARC_LENGTH:
        prescribed = _onwards(system, state, prescribed, turn)
        stiffness = initial_stiffness(system, prescribed.rough, prescribed.weights)

    def evaluate(unknown: Array) -> tuple[Array, ContactInput]:
        _, residual, contact = system.advance(nodal(system, unknown), before, prescribed)
        return residual_in_blocks(residual, unknown), contact

    def tangent(contact: ContactInput, stiffness: Stiffness) -> BlockTridiagonal:
        return matrix(system, stiffness, contact, before, prescribed)

    def refresh(unknown: Array) -> Stiffness:
        # Tied to the unknowns, lest the compiler finds it before it is needed.
        strip, unknown = lax.optimization_barrier((system, unknown))
        level, _, contact = strip.advance(nodal(strip, unknown), before, prescribed)
        return stiffness_at(
            strip, level.q, strip.contact_response(contact, before, prescribed), prescribed
        )

    def limit(old: Array, new: Array) -> Array:
        slip, was = nodal(system, new)[:, V], nodal(system, old)[:, V]
        limited = system.foundation.limited_slip(was, slip, before.traction, before.cap)
        return with_v(system, new, jnp.where(prescribed.rough > 0.0, limited, slip))

    change, (iterations, error) = solver.solve(
        evaluate,
        limit,
        guess,
        state.sound,
        tangent,
        stiffness,
        refresh if stiffness is None or not system.linear else None,
    )
    after, *_ = system.advance(nodal(system, change), before, prescribed)
    sound = state.sound & (error <= solver.tolerance_for(system.x.dtype))
    end = system.end_displacement(after.q)
    rest = jnp.where(prescribed.rough > 0.0, state.rest, end)
    kept = jax.tree.map(lambda new, old: jnp.where(sound, new, old), after, before)
    path = _place(system, after, rest) - _place(system, before, rest)
    gone = jnp.linalg.norm(path)
    along = jnp.where(gone > 0.0, path / jnp.where(gone > 0.0, gone, 1.0), state.along)
    new = PathState(kept, rest, to.target, to.pressure, turn, change, along, sound)
    return new, Steps(
        state=new,
        displacement=end - rest,
        slipping=_slipping(system, before, after, prescribed.rough),
        slip_work=prescribed.rough * system.slip_work(before, after),
        stored_energy=system.stored_energy(after, prescribed.pressure),
        sinking=system.sinking(after.q),
        iterations=iterations if foreseen is None else iterations + foreseen.solves,
        error=error,
        status=_status(sound, state.sound, error),
    )


def _as_foreseen(system: System, start: PathState, path: LoadPath, solver: Foresight) -> Steps:
    """The steps that are foreseen; not sound from the first on that is none."""
    foreseen = slip_patterns.foresee(system, start, path)
    memory = foreseen.memory
    change = jnp.swapaxes(foreseen.change, 1, 2)

    def go(
        at: tuple[Array, Array], to: tuple[LoadPath, Array]
    ) -> tuple[tuple[Array, Array], tuple]:
        rough, q = to[0].rough > 0.0, at[0] + system.embed(to[1])
        end = system.end_displacement(q)
        rest = jnp.where(rough, at[1], end)
        return (q, rest), (q, rest, end)

    q, rest, end = lax.scan(go, (start.level.q, start.rest), (path, change))[1]
    along = jnp.tile(start.along, (q.shape[0], 1))
    prescribed = Prescribed(path.target, path.pressure, rest, path.rough, along)

    def reached(q: Array, memory: Memory, prescribed: Prescribed) -> LoadLevel:
        touch = ContactResponse(memory.traction, jnp.zeros_like(system.x), memory.reaction)
        force, _ = system.balance(
            system.elastic_forces(q, prescribed.pressure), q, touch, prescribed
        )
        return LoadLevel(q, memory.traction, memory.cap, memory.reaction, force)

    level = jax.vmap(reached)(q, memory, prescribed)
    before = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b[:-1]]), start.level, level)
    error = foreseen.error
    if solver.checked:
        # One after the other: a loop stays small enough for what runs as one native function.
        each = (change, before, prescribed)
        error = lax.map(lambda at: jnp.max(jnp.abs(system.advance(*at)[1])), each)
    good = foreseen.settled & (error <= solver.tolerance_for(system.x.dtype))
    sound = start.sound & (jnp.cumsum(~good) == 0)
    return Steps(
        state=PathState(
            level=level,
            rest=rest,
            target=path.target,
            pressure=path.pressure,
            turn=memory.turn,
            change=jax.vmap(lambda c: in_blocks(c, start.change))(change),
            along=along,
            sound=sound,
        ),
        displacement=end - rest,
        slipping=jax.vmap(functools.partial(_slipping, system))(before, level, path.rough),
        slip_work=foreseen.slip_work,
        stored_energy=jax.vmap(system.stored_energy)(level, path.pressure),
        sinking=jax.vmap(system.sinking)(q),
        iterations=foreseen.solves,
        error=error,
        status=_status(sound, jnp.append(start.sound, sound[:-1]), error),
    )


def _slipping(system: System, before: LoadLevel, after: LoadLevel, rough: Array) -> Array:
    """Whether the nodes slip in a step, (n,)."""
    motion = after.q[:, V] - before.q[:, V]
    inelastic = plastic_slip(
        motion, before.traction, after.traction, system.foundation.slip_stiffness
    )
    noticeable = system.foundation.slip_stiffness * jnp.abs(inelastic) > SMALLEST_SHARE * after.cap
    rubbing = (rough > 0.0) & (system.foundation.has_friction(after.cap))
    return rubbing & noticeable & (jnp.abs(inelastic) > SLIPS * jnp.abs(motion))


def _status(sound: Array, sound_before: Array, error: Array) -> Array:
    failure = jnp.where(jnp.isfinite(error), Status.MAX_ITERATIONS, Status.NOT_FINITE)
    failed = jnp.where(sound_before, failure, Status.NOT_REACHED)
    return jnp.where(sound, Status.CONVERGED, failed)


def _onwards(
    system: System, state: PathState, prescribed: Prescribed, turn: Reversal
) -> Prescribed:
    """So far along the direction of the last step; on the middle way after a reversal."""
    stride = prescribed.controlled - state.target
    middle = jnp.where(stride >= 0.0, EVENLY, -EVENLY)
    along = jnp.where(turn.target == state.target, middle, state.along)
    ahead = jnp.sum(along * _place(system, state.level, state.rest)) + jnp.abs(stride)
    return prescribed._replace(
        controlled=jnp.where(prescribed.rough > 0.0, ahead, 0.0), weights=along
    )


def _place(system: System, level: LoadLevel, rest: Array) -> Array:
    """Where a level is on the path: u(L) and F L/(E' 2H), (2,)."""
    u = system.end_displacement(level.q) - rest
    return jnp.stack([u, level.force / system.stiffness_scale])


def _guess(system: System, state: PathState, to: LoadPath, turn: Reversal) -> Array:
    """Increments of v that take those nodes to their caps which would slip in a bar."""
    level, slips = state.level, first_to_slip(system, turn, to.target)
    beyond = (2.0 * level.cap - slips * level.traction) / system.foundation.slip_stiffness
    slip = slips * jnp.maximum(beyond, 0.0)
    fields = jnp.zeros_like(level.q).at[:, V].set(slip)[:, list(system.model.active)]
    bar = in_blocks(fields, state.change)
    return lax.stop_gradient(jnp.where(to.rough > 0.0, bar, state.change))


def at_rest(scene: Scene, touching: ArrayLike | None = None) -> PathState:
    """The strip before anything acts on it.

    Parameters
    ----------
    scene : of which
    touching : (n,) nodes from which the search for the contact starts; None is all of them
    """
    system, fields = System(scene), scene.model.fields
    change, zero = zero_unknowns(system), jnp.zeros_like(system.x)
    if touching is not None:
        raised = jnp.where(jnp.asarray(touching), 0.0, scene.strip.half_height)
        lifted = jnp.zeros((zero.size, len(system.model.active)), zero.dtype)
        change = in_blocks(lifted.at[:, fields.index("w")].set(raised), change)
    turn = Reversal(zero[0], zero, zero[0])
    return PathState(
        level=system.unloaded(),
        rest=zero[0],
        target=zero[0],
        pressure=zero[0],
        turn=turn,
        change=change,
        along=jnp.full(2, EVENLY, zero.dtype),
        sound=jnp.asarray(True),
    )


def recover(scene: Scene, steps: Steps, path: LoadPath, solver: Newton, start: PathState) -> Steps:
    """Walk every failed step of a march in pieces and go on from there."""
    count = path.target.size
    while not bool(steps.state.sound[-1]):
        first = int(np.argmin(np.asarray(steps.state.sound)))
        origin = jax.tree.map(lambda a: a[first - 1], steps.state) if first else start  # noqa: B023
        pieces = _walk_in_pieces(scene, origin, jax.tree.map(lambda a: a[first], path), solver)  # noqa: B023
        if pieces is None:
            return steps
        joined = jax.tree.map(lambda a: a[-1], pieces)._replace(
            slip_work=jnp.sum(pieces.slip_work),
            iterations=steps.iterations[first] + jnp.sum(pieces.iterations),
            slipping=jnp.any(pieces.slipping, axis=0),
        )
        # Same shapes as the first march, so nothing compiles anew: the path's end is repeated.
        rest = jnp.minimum(jnp.arange(count) + first + 1, count - 1)
        tail = _march(scene, joined.state, jax.tree.map(lambda a: a[rest], path), solver)  # noqa: B023
        steps = jax.tree.map(
            lambda head, piece, end: jnp.concatenate(
                [head[:first], piece[None], end[: count - first - 1]]  # noqa: B023
            ),
            steps,
            joined,
            tail,
        )
    return steps


def _walk_in_pieces(scene: Scene, origin: PathState, to: LoadPath, solver: Newton) -> Steps | None:
    for count in PIECES:
        part = jnp.arange(1, count + 1) / count
        path = LoadPath(
            origin.target + part * (to.target - origin.target),
            origin.pressure + part * (to.pressure - origin.pressure),
            jnp.full_like(part, to.rough),
        )
        pieces = _march(scene, origin, path, solver)
        if bool(pieces.state.sound[-1]):
            return pieces
    return None

"""Load paths: Newton's method at every load level, one scan over the path, a History out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.closed_form import gross_slip_force
from jbeamshell.equilibrium import Drive, Level, System, V
from jbeamshell.errors import UnconvergedError
from jbeamshell.friction import plastic_slip
from jbeamshell.grid import ORDER
from jbeamshell.history import History, Status, closed_cycles
from jbeamshell.newton import Newton
from jbeamshell.parts import require
from jbeamshell.scene import Scene

SLIPS = 0.5  # a node slips in a step when more than this part of its motion is inelastic
NUDGE = 1e-6  # of the cap: elastic traction with which a reversed step starts
ROUNDING = 1e-9  # of the cap, or of gross slip: less than this is no difference
PIECES = (8, 64)  # a load step that fails is walked in so many pieces, or so many


class State(NamedTuple):
    """Where a path stands.

    Attributes
    ----------
    level : the level reached
    rest : u(L) after the pressure
    target, stride : the controlled load reached, and its last increment
    change : (blocks, size) the last increment of the unknowns
    sound : whether all steps so far found equilibrium
    """

    level: Level
    rest: Array
    target: Array
    stride: Array
    change: Array
    sound: Array


class Steps(NamedTuple):
    """What every step of a path leaves behind, stacked along the first axis; see `History`."""

    state: State
    displacement: Array
    slipping: Array
    slip_work: Array
    stored_energy: Array
    iterations: Array
    error: Array
    status: Array


def march(scene: Scene, start: State, targets: Array, rough: Array, solver: Newton) -> Steps:
    """Walk a load path in one scan.

    Parameters
    ----------
    scene : what is loaded
    start : where the path starts
    targets : (steps,) controlled load of every step
    rough : (steps,) 1 with friction, 0 for the pressure step
    solver : of one step
    """
    system = System(scene)

    def step(state: State, drive: tuple[Array, Array]) -> tuple[State, Steps]:
        return _step(system, state, Drive(drive[0], state.rest, drive[1]), solver)

    return lax.scan(step, start, (targets, rough))[1]


_march = eqx.filter_jit(march)


def _step(system: System, state: State, drive: Drive, solver: Newton) -> tuple[State, Steps]:
    before, active = state.level, len(system.model.active)
    padding = state.change.size - system.x.size * active

    def nodal(unknown: Array) -> Array:
        return unknown.ravel()[padding:].reshape(-1, active)

    def residual(unknown: Array) -> Array:
        balance = system.advance(nodal(unknown), before, drive)[1]
        return jnp.append(unknown.ravel()[:padding], balance.ravel()).reshape(unknown.shape)

    def limit(old: Array, new: Array) -> Array:
        slip, was = nodal(new)[:, V], nodal(old)[:, V]
        limited = jax.vmap(system.law.limit, in_axes=(0, 0, 0, 0, None))(
            was, slip, before.traction, before.cap, system.slip_stiffness
        )
        fields = nodal(new).at[:, V].set(jnp.where(drive.rough > 0.0, limited, slip))
        return jnp.append(new.ravel()[:padding], fields.ravel()).reshape(new.shape)

    stride = drive.target - state.target
    change, (iterations, error) = solver.solve(
        residual, limit, _guess(system, state, stride), state.sound
    )
    after, _ = system.advance(nodal(change), before, drive)
    sound = state.sound & (error <= solver.tolerance_for(system.x.dtype))
    end = system.end_displacement(after.q)
    rest = jnp.where(drive.rough > 0.0, state.rest, end)
    failure = jnp.where(jnp.isfinite(error), Status.MAX_ITERATIONS, Status.NOT_FINITE)
    status = jnp.where(state.sound, failure, Status.NOT_REACHED)
    motion = after.q[:, V] - before.q[:, V]
    inelastic = plastic_slip(motion, before.traction, after.traction, system.slip_stiffness)
    noticeable = system.slip_stiffness * jnp.abs(inelastic) > ROUNDING * after.cap
    kept = jax.tree.map(lambda new, old: jnp.where(sound, new, old), after, before)
    new = State(kept, rest, drive.target, stride, drive.rough * change, sound)
    return new, Steps(
        state=new,
        displacement=end - rest,
        slipping=noticeable & (jnp.abs(inelastic) > SLIPS * jnp.abs(motion)) & (drive.rough > 0.0),
        slip_work=drive.rough * system.slip_work(before, after),
        stored_energy=system.stored_energy(after),
        iterations=iterations,
        error=error,
        status=jnp.where(sound, Status.CONVERGED, status),
    )


def _guess(system: System, state: State, stride: Array) -> Array:
    """Continue the last increment; after a reversal only its direction, so that every node sticks.

    The direction matters: at the Coulomb cap, going on slips and going back sticks.
    """
    moving = state.stride != 0.0
    ratio = jnp.where(moving, stride / jnp.where(moving, state.stride, 1.0), 0.0)
    traction = system.slip_stiffness * jnp.max(jnp.abs(state.change))
    nudge = -NUDGE * jnp.mean(state.level.cap) / jnp.where(traction > 0.0, traction, 1.0)
    return lax.stop_gradient(jnp.where(ratio < 0.0, nudge, ratio) * state.change)


def solve(
    scene: Scene,
    path: ArrayLike | None = None,
    *,
    solver: Newton | None = None,
    throw: bool = True,
) -> History:
    """Press the strip down, walk a load path, and report what happened.

    Parameters
    ----------
    scene : what is loaded; may hold traced leaves, so `jax.grad` and `jax.vmap` go through
    path : (steps,) loads after zero, F or u(L) by ``scene.load.control``; None is the scene's own
        cycles
    solver : settings of Newton's method
    throw : whether a step without equilibrium raises; if not, read ``history.status``

    Returns
    -------
    History
        steps without equilibrium hold NaN.

    Raises
    ------
    InputError
        if the path makes no sense or exceeds gross slip under force control
    UnconvergedError
        if a step has no equilibrium, even when it is walked in smaller steps
    """
    solver = solver or Newton()
    targets, cycles = check(scene, path)
    traced = _is_traced(scene, targets)
    targets = jnp.append(jnp.zeros_like(targets[:1]), targets)
    rough = jnp.ones_like(targets).at[0].set(0.0)
    steps = _march(scene, _rest(scene), targets, rough, solver)
    if not traced and not bool(steps.state.sound[-1]):
        steps = _recover(scene, steps, targets, rough, solver)
    if throw:
        steps = _raise_if_failed(steps, targets, traced)
    return _history(scene, steps, cycles)


def check(
    scene: Scene, path: ArrayLike | None = None
) -> tuple[Array, tuple[tuple[int, int, int], ...]]:
    """The load path and its closed cycles; raises `InputError` where `solve` would."""
    targets, cycles = _targets(scene, path)
    if not _is_traced(scene, targets):
        _check_gross_slip(scene, targets)
    return targets, cycles


def _is_traced(scene: Scene, targets: Array) -> bool:
    return any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves((scene, targets)))


def compile_for(
    scene: Scene, path: ArrayLike | None = None, *, solver: Newton | None = None
) -> None:
    """Compile what `solve` needs, without solving anything."""
    targets, cycles = _targets(scene, path)
    targets = jnp.append(jnp.zeros_like(targets[:1]), targets)
    start = _rest(scene)._replace(sound=jnp.asarray(False))
    steps = _march(scene, start, targets, jnp.ones_like(targets), solver or Newton())
    jax.block_until_ready(_history(scene, steps, cycles))


def _targets(
    scene: Scene, path: ArrayLike | None
) -> tuple[Array, tuple[tuple[int, int, int], ...]]:
    if path is None:
        unit = scene.load.unit_path()
        return scene.load.amplitude * jnp.asarray(unit), closed_cycles(np.append(0.0, unit))
    dtype = scene.load.amplitude.dtype
    targets = jnp.asarray(path, dtype)
    require("path", np.shape(path), targets.ndim == 1 and targets.size > 0, "give a list of loads")
    if isinstance(targets, jax.core.Tracer):
        return targets, ()
    values = np.asarray(targets)
    good = bool(np.all(np.isfinite(values)))
    require("path", values[~np.isfinite(values)], good, "must hold finite loads only")
    return targets, closed_cycles(np.append(0.0, values))


def _check_gross_slip(scene: Scene, targets: Array) -> None:
    if scene.load.control != "force":
        return
    limit = float(_gross_slip(scene))
    largest = float(jnp.max(jnp.abs(targets)))
    require(
        "load.amplitude",
        largest,
        largest < (1.0 - ROUNDING) * limit,
        f"must stay below gross slip, mu F_N L = {limit:.6g}; "
        "set load.control to 'displacement' to go beyond",
    )


@eqx.filter_jit
def _gross_slip(scene: Scene) -> Array:
    system, length = System(scene), scene.strip.length
    mean = jnp.sum(system.tributary * system.pressure) / length
    return gross_slip_force(scene.contact.friction, mean, length)


def _rest(scene: Scene) -> State:
    model, dtype = scene.model, scene.strip.length.dtype
    nodes = jnp.zeros(model.nodes, dtype)
    level = Level(jnp.zeros((nodes.size, 4), dtype), nodes, nodes, nodes, nodes[0])
    # An element's later nodes share a block, so that blocks couple to their neighbours only.
    order = ORDER[model.grid]
    change = jnp.zeros(((model.nodes + order - 1) // order, order * len(model.active)), dtype)
    return State(level, nodes[0], nodes[0], nodes[0], change, jnp.asarray(True))


def _recover(scene: Scene, steps: Steps, targets: Array, rough: Array, solver: Newton) -> Steps:
    """Walk every failed step in pieces and go on from there."""
    while not bool(steps.state.sound[-1]):
        first = int(np.argmin(np.asarray(steps.state.sound)))
        if first == 0:  # the pressure step: there is no smaller one
            return steps
        origin = jax.tree.map(lambda a: a[first - 1], steps.state)  # noqa: B023
        pieces = _walk_in_pieces(scene, origin, targets[first - 1], targets[first], solver)
        if pieces is None:
            return steps
        joined = jax.tree.map(lambda a: a[-1], pieces)._replace(
            slip_work=jnp.sum(pieces.slip_work),
            iterations=steps.iterations[first] + jnp.sum(pieces.iterations),
            slipping=jnp.any(pieces.slipping, axis=0),
        )
        # Same shapes as the first march, so nothing compiles anew: the path's end is repeated.
        rest = jnp.minimum(jnp.arange(targets.size) + first + 1, targets.size - 1)
        tail = _march(scene, joined.state, targets[rest], rough[rest], solver)
        count = targets.size - first - 1
        steps = jax.tree.map(
            lambda head, piece, end: jnp.concatenate([head[:first], piece[None], end[:count]]),  # noqa: B023
            steps,
            joined,
            tail,
        )
    return steps


def _walk_in_pieces(
    scene: Scene, origin: State, begin: Array, end: Array, solver: Newton
) -> Steps | None:
    for count in PIECES:
        targets = begin + jnp.arange(1, count + 1) / count * (end - begin)
        pieces = _march(scene, origin, targets, jnp.ones_like(targets), solver)
        if bool(pieces.state.sound[-1]):
            return pieces
    return None


def _raise_if_failed(steps: Steps, targets: Array, traced: bool) -> Steps:
    advice = (
        "take more load.steps_per_half_cycle, a lower contact.stick_stiffness, or fewer model.nodes"
    )
    if traced:
        message = f"a load step found no equilibrium: {advice}"
        return eqx.error_if(steps, ~steps.state.sound[-1], message)
    sound = np.asarray(steps.state.sound)
    if sound.all():
        return steps
    first = int(np.argmin(sound))
    where = f"load step {first} of {sound.size - 1} (load {float(targets[first]):.6g})"
    where = where if first else "the pressure step"
    reason = Status(int(steps.status[first])).name.lower().replace("_", " ")
    error = float(steps.error[first])
    raise UnconvergedError(
        f"{where} found no equilibrium ({reason}, out of balance {error:.2g} of mu F_N L): {advice}"
    )


@eqx.filter_jit
def _history(scene: Scene, steps: Steps, cycles: Sequence[tuple[int, int, int]]) -> History:
    system = System(scene)
    sound, level = steps.state.sound, steps.state.level

    def masked(values: Array) -> Array:
        return jnp.where(sound.reshape(-1, *[1] * (values.ndim - 1)), values, jnp.nan)

    return History(
        scene=scene,
        x=system.x,
        tributary=system.tributary,
        force=masked(level.force),
        displacement=masked(steps.displacement),
        fields=masked(level.q),
        traction=masked(level.traction),
        reaction=masked(level.reaction),
        slipping=steps.slipping,
        slip_work=masked(steps.slip_work),
        stored_energy=masked(steps.stored_energy),
        iterations=steps.iterations,
        error=steps.error,
        status=steps.status,
        cycles=tuple(cycles),
    )

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
from jbeamshell.cycles import closed_cycles
from jbeamshell.equilibrium import Drive, Level, System, V
from jbeamshell.errors import UnconvergedError
from jbeamshell.friction import plastic_slip
from jbeamshell.grid import ORDER
from jbeamshell.history import History, Status
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
    target, pressure : the controlled load and the part of the pressures reached
    stride : their last increments
    change : (blocks, size) the last increment of the unknowns
    sound : whether all steps so far found equilibrium
    """

    level: Level
    rest: Array
    target: Array
    pressure: Array
    stride: Array
    change: Array
    sound: Array


class Path(NamedTuple):
    """What a path prescribes, (steps,) each.

    Attributes
    ----------
    target : the controlled load, F or u(L)
    pressure : part of the pressures that acts
    rough : 1 with friction, 0 while the strip is pressed down before it
    """

    target: Array
    pressure: Array
    rough: Array


class Steps(NamedTuple):
    """What every step of a path leaves behind, stacked along the first axis; see `History`."""

    state: State
    displacement: Array
    slipping: Array
    slip_work: Array
    stored_energy: Array
    sinking: Array
    iterations: Array
    error: Array
    status: Array


def march(scene: Scene, start: State, path: Path, solver: Newton) -> Steps:
    """Walk a load path in one scan.

    Parameters
    ----------
    scene : what is loaded
    start : where the path starts
    path : what is prescribed
    solver : of one step
    """
    system = System(scene)

    def step(state: State, to: Path) -> tuple[State, Steps]:
        return _step(system, state, Drive(to.target, to.pressure, state.rest, to.rough), solver)

    return lax.scan(step, start, path)[1]


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
        # A point without reaction slides freely.
        rubs = (drive.rough > 0.0) & (before.cap > 2.0 * system.cap_floor)
        fields = nodal(new).at[:, V].set(jnp.where(rubs, limited, slip))
        return jnp.append(new.ravel()[:padding], fields.ravel()).reshape(new.shape)

    stride = jnp.stack([drive.target - state.target, drive.pressure - state.pressure])
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
    rubbing = (drive.rough > 0.0) & (after.cap > 2.0 * system.cap_floor)
    kept = jax.tree.map(lambda new, old: jnp.where(sound, new, old), after, before)
    new = State(kept, rest, drive.target, drive.pressure, stride, change, sound)
    return new, Steps(
        state=new,
        displacement=end - rest,
        slipping=rubbing & noticeable & (jnp.abs(inelastic) > SLIPS * jnp.abs(motion)),
        slip_work=drive.rough * system.slip_work(before, after),
        stored_energy=system.stored_energy(after, drive.pressure),
        sinking=system.sinking(after.q),
        iterations=iterations,
        error=error,
        status=jnp.where(sound, Status.CONVERGED, status),
    )


def _guess(system: System, state: State, stride: Array) -> Array:
    """Continue the last increment; after a reversal only its direction, so that every node sticks.

    The direction matters: at the Coulomb cap, going on slips and going back sticks.  The increment
    of an earlier kind of load, pressure or end load, says nothing and is dropped.
    """
    moving = jnp.sum(state.stride**2)
    ratio = jnp.sum(stride * state.stride) / jnp.where(moving > 0.0, moving, 1.0)
    traction = system.slip_stiffness * jnp.max(jnp.abs(state.change))
    nudge = -NUDGE * jnp.mean(state.level.cap) / jnp.where(traction > 0.0, traction, 1.0)
    return lax.stop_gradient(jnp.where(ratio < 0.0, nudge, ratio) * state.change)


def solve(
    scene: Scene,
    path: ArrayLike | None = None,
    *,
    contact: ArrayLike | None = None,
    solver: Newton | None = None,
    throw: bool = True,
) -> History:
    """Press the strip down, walk a load path, and report what happened.

    Parameters
    ----------
    scene : what is loaded; may hold traced leaves, so `jax.grad` and `jax.vmap` go through
    path : loads after the pressing, (steps,): F or u(L) by ``scene.load.control``; or (steps, 2)
        with the part of the pressures that acts in the second column; None is the scene's own
        cycles
    contact : (n,) nodes from which the search for the contact starts; None is all of them
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
    whole, cycles = check(scene, path)
    traced = _is_traced(scene, whole)
    steps = _march(scene, _rest(scene, contact), whole, solver)
    if not traced and not bool(steps.state.sound[-1]):
        steps = _recover(scene, steps, whole, solver)
    if throw:
        steps = _raise_if_failed(steps, whole, traced)
    return _history(scene, steps, whole.pressure, cycles)


def check(
    scene: Scene, path: ArrayLike | None = None
) -> tuple[Path, tuple[tuple[int, int, int], ...]]:
    """The whole path and its closed cycles; raises `InputError` where `solve` would."""
    whole, cycles = _whole_path(scene, path)
    if not _is_traced(scene, whole):
        _check_gross_slip(scene, whole)
    return whole, cycles


def _is_traced(scene: Scene, path: Path) -> bool:
    return any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves((scene, path)))


def compile_for(
    scene: Scene, path: ArrayLike | None = None, *, solver: Newton | None = None
) -> None:
    """Compile what `solve` needs, without solving anything."""
    whole, cycles = _whole_path(scene, path)
    start = _rest(scene)._replace(sound=jnp.asarray(False))
    steps = _march(scene, start, whole, solver or Newton())
    jax.block_until_ready(_history(scene, steps, whole.pressure, cycles))


def _whole_path(
    scene: Scene, path: ArrayLike | None
) -> tuple[Path, tuple[tuple[int, int, int], ...]]:
    """The pressing, then the given loads or the scene's own; and the closed cycles among them."""
    dtype, pressing = scene.load.amplitude.dtype, scene.load.pressure_steps
    known: np.ndarray | None = scene.load.unit_path()
    if path is None:
        targets = scene.load.amplitude * jnp.asarray(known, dtype)
        pressures = jnp.ones_like(targets)
    else:
        loads = jnp.asarray(path, dtype)
        shaped = loads.size > 0 and (loads.ndim == 1 or (loads.ndim == 2 and loads.shape[1] == 2))
        require("path", np.shape(path), shaped, "give (steps,) loads, or (steps, 2) with pressures")
        targets, pressures = (loads, jnp.ones_like(loads)) if loads.ndim == 1 else loads.T
        known = None if isinstance(loads, jax.core.Tracer) else np.asarray(targets)
        if known is not None:
            values = np.asarray(loads)
            finite = np.isfinite(values)
            require("path", values[~finite], bool(np.all(finite)), "must hold finite loads only")
            pulling = np.asarray(pressures) < 0.0
            fix = "the part of the pressures that acts must not be negative"
            require("path", np.asarray(pressures)[pulling], not np.any(pulling), fix)
    before = jnp.arange(1, pressing + 1, dtype=dtype) / pressing
    whole = Path(
        jnp.append(jnp.zeros_like(before), targets),
        jnp.append(before, pressures),
        jnp.append(jnp.zeros_like(before), jnp.ones_like(targets)),
    )
    if known is None or known.size == 0:
        return whole, ()
    last = pressing - 1
    cycles = closed_cycles(np.append(0.0, known))
    return whole, tuple((a + last, b + last, c + last) for a, b, c in cycles)


def _check_gross_slip(scene: Scene, path: Path) -> None:
    if scene.load.control != "force" or float(scene.contact.friction) == 0.0:
        return
    limit = float(_gross_slip(scene))
    targets, limits = np.abs(path.target), limit * np.asarray(path.pressure)
    beyond = (targets > 0.0) & (targets >= (1.0 - ROUNDING) * limits)
    require(
        "load.amplitude",
        float(targets[beyond].max(initial=0.0)),
        not np.any(beyond),
        f"must stay below gross slip, mu F_N L = {limit:.6g}; "
        "set load.control to 'displacement' to go beyond",
    )


@eqx.filter_jit
def _gross_slip(scene: Scene) -> Array:
    system, length = System(scene), scene.strip.length
    mean = jnp.sum(system.load - system.bottom_load) / length
    return gross_slip_force(scene.contact.friction, mean, length)


def _rest(scene: Scene, contact: ArrayLike | None = None) -> State:
    model, dtype = scene.model, scene.strip.length.dtype
    nodes = jnp.zeros(model.nodes, dtype)
    level = Level(jnp.zeros((nodes.size, model.width), dtype), nodes, nodes, nodes, nodes[0])
    # An element's later nodes share a block, so that blocks couple to their neighbours only.
    order, width = ORDER[model.grid], len(model.active)
    blocks = (model.nodes + order - 1) // order
    change = jnp.zeros((blocks * order, width), dtype)
    stride = jnp.zeros(2, dtype)
    if contact is not None:
        touching = np.asarray(contact, dtype=bool)
        fits = touching.shape == nodes.shape and "w" in model.fields
        fix = f"give one truth for each of the {nodes.size} nodes, and w in model.fields"
        require("contact", touching.shape, fits, fix)
        raised = jnp.where(touching, 0.0, scene.strip.half_height)
        change = change.at[-nodes.size :, model.fields.index("w")].set(raised)
        stride = stride.at[1].set(1.0 / scene.load.pressure_steps)  # so that it is gone on with
    change = change.reshape(blocks, order * width)
    zero = nodes[0]
    return State(level, zero, zero, zero, stride, change, jnp.asarray(True))


def _recover(scene: Scene, steps: Steps, path: Path, solver: Newton) -> Steps:
    """Walk every failed step in pieces and go on from there."""
    count = path.target.size
    while not bool(steps.state.sound[-1]):
        first = int(np.argmin(np.asarray(steps.state.sound)))
        origin = jax.tree.map(lambda a: a[first - 1], steps.state) if first else _rest(scene)  # noqa: B023
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


def _walk_in_pieces(scene: Scene, origin: State, to: Path, solver: Newton) -> Steps | None:
    for count in PIECES:
        part = jnp.arange(1, count + 1) / count
        path = Path(
            origin.target + part * (to.target - origin.target),
            origin.pressure + part * (to.pressure - origin.pressure),
            jnp.full_like(part, to.rough),
        )
        pieces = _march(scene, origin, path, solver)
        if bool(pieces.state.sound[-1]):
            return pieces
    return None


def _raise_if_failed(steps: Steps, path: Path, traced: bool) -> Steps:
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
    where = f"load step {first} of {sound.size - 1} (load {float(path.target[first]):.6g})"
    if not path.rough[first]:
        where = f"pressing down (to {100.0 * float(path.pressure[first]):.3g} % of the pressure)"
    reason = Status(int(steps.status[first])).name.lower().replace("_", " ")
    error = float(steps.error[first])
    raise UnconvergedError(
        f"{where} found no equilibrium ({reason}, out of balance {error:.2g} of mu F_N L): {advice}"
    )


@eqx.filter_jit
def _history(
    scene: Scene, steps: Steps, pressure: Array, cycles: Sequence[tuple[int, int, int]]
) -> History:
    system = System(scene)
    sound, level = steps.state.sound, steps.state.level

    def masked(values: Array) -> Array:
        return jnp.where(sound.reshape(-1, *[1] * (values.ndim - 1)), values, jnp.nan)

    return History(
        scene=scene,
        x=system.x,
        middles=system.middles,
        tributary=system.tributary,
        load=system.load,
        force=masked(level.force),
        displacement=masked(steps.displacement),
        fields=masked(level.q),
        gap=masked(jax.vmap(system.gap)(level.q)),
        sections=jax.tree.map(masked, jax.vmap(system.section_forces)(level.q)),
        traction=masked(level.traction),
        reaction=masked(level.reaction),
        slipping=steps.slipping,
        slip_work=masked(steps.slip_work),
        stored_energy=masked(steps.stored_energy),
        pressure=pressure,
        sinking=masked(steps.sinking),
        iterations=steps.iterations,
        error=steps.error,
        status=steps.status,
        cycles=tuple(cycles),
    )

"""Newton's method at every load level of a path, one scan over the path."""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.equilibrium import Drive, Level, System, V
from jbeamshell.friction import plastic_slip
from jbeamshell.grid import ORDER
from jbeamshell.history import Status
from jbeamshell.newton import Newton
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


def walk(scene: Scene, start: State, path: Path, solver: Newton) -> Steps:
    """Walk a load path; a step that fails is walked again in pieces."""
    steps = _march(scene, start, path, solver)
    return steps if bool(steps.state.sound[-1]) else recover(scene, steps, path, solver, start)


def is_traced(*trees: object) -> bool:
    """Whether any leaf is traced."""
    return any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(trees))


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


def at_rest(scene: Scene, touching: ArrayLike | None = None) -> State:
    """The strip before anything acts on it.

    Parameters
    ----------
    scene : of which
    touching : (n,) nodes from which the search for the contact starts; None is all of them
    """
    model, dtype = scene.model, scene.strip.length.dtype
    nodes = jnp.zeros(model.nodes, dtype)
    level = Level(jnp.zeros((nodes.size, model.width), dtype), nodes, nodes, nodes, nodes[0])
    # An element's later nodes share a block, so that blocks couple to their neighbours only.
    order, width = ORDER[model.grid], len(model.active)
    blocks = (model.nodes + order - 1) // order
    change = jnp.zeros((blocks * order, width), dtype)
    stride = jnp.zeros(2, dtype)
    if touching is not None:
        raised = jnp.where(jnp.asarray(touching), 0.0, scene.strip.half_height)
        change = change.at[-nodes.size :, model.fields.index("w")].set(raised)
        stride = stride.at[1].set(1.0 / scene.load.pressure_steps)  # so that it is gone on with
    change = change.reshape(blocks, order * width)
    zero = nodes[0]
    return State(level, zero, zero, zero, stride, change, jnp.asarray(True))


def recover(scene: Scene, steps: Steps, path: Path, solver: Newton, start: State) -> Steps:
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

"""State of a strip on its load path, and the results of the steps."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.errors import Status
from jbeamshell.load_steps.prediction import SMALLEST_SHARE, Reversal
from jbeamshell.load_steps.system import LoadLevel, System, V
from jbeamshell.load_steps.tangent import in_blocks, zero_unknowns
from jbeamshell.mechanics.friction import plastic_slip
from jbeamshell.scene.scene import Scene

MOSTLY = 0.5  # a node slips in a step if more than this part of its motion is inelastic
EQUAL = 0.5**0.5  # both components of a direction that is as much displacement as force


class PathState(NamedTuple):
    """State of a strip after a step of its load path.

    Attributes
    ----------
    level : load level that is reached
    origin : u(L) after the pressure, from which displacements are counted
    target, pressure : controlled load and part of the pressures that are reached
    reversal : last reversal of the load
    change : (blocks, size) last increment of the unknowns
    direction : (2,) direction of the path in the plane of u(L) and F L/(E' 2H), for the arc length
    converged : True if all steps so far found equilibrium
    """

    level: LoadLevel
    origin: Array
    target: Array
    pressure: Array
    reversal: Reversal
    change: Array
    direction: Array
    converged: Array


class StepResults(NamedTuple):
    """Results of the steps of a path, stacked along the first axis; see `History`."""

    state: PathState
    displacement: Array
    slipping: Array
    slip_work: Array
    stored_energy: Array
    sinking: Array
    iterations: Array
    error: Array
    status: Array


def initial_state(scene: Scene, touching: ArrayLike | None = None) -> PathState:
    """State of a scene's strip before anything acts on it.

    Parameters
    ----------
    scene : strip, contact, load and model
    touching : (n,) True at the nodes that are in contact where the search for the contact starts;
        None starts with all of them
    """
    system, fields = System(scene), scene.plan.fields
    change, zero = zero_unknowns(system), jnp.zeros_like(system.x)
    if touching is not None:
        lift = jnp.where(jnp.asarray(touching), 0.0, scene.strip.half_height)
        active = jnp.zeros((zero.size, len(system.plan.active)), zero.dtype)
        change = in_blocks(active.at[:, fields.index("w")].set(lift), change)
    return PathState(
        level=system.unloaded(),
        origin=zero[0],
        target=zero[0],
        pressure=zero[0],
        reversal=Reversal(zero[0], zero, zero[0]),
        change=change,
        direction=jnp.full(2, EQUAL, zero.dtype),
        converged=jnp.asarray(True),
    )


def slipping_nodes(system: System, before: LoadLevel, after: LoadLevel, rough: Array) -> Array:
    """True at the nodes (n,) that slip in a step."""
    foundation, motion = system.foundation, after.q[:, V] - before.q[:, V]
    inelastic = plastic_slip(motion, before.traction, after.traction, foundation.slip_stiffness)
    noticeable = foundation.slip_stiffness * jnp.abs(inelastic) > SMALLEST_SHARE * after.cap
    acts = (rough > 0.0) & foundation.has_friction(after.cap)
    return acts & noticeable & (jnp.abs(inelastic) > MOSTLY * jnp.abs(motion))


def status_codes(converged: Array, converged_before: Array, error: Array) -> Array:
    """Codes of `Status`, from whether the path converged up to a step and up to that before it."""
    failure = jnp.where(jnp.isfinite(error), Status.MAX_ITERATIONS, Status.NOT_FINITE)
    failed = jnp.where(converged_before, failure, Status.NOT_REACHED)
    return jnp.where(converged, Status.CONVERGED, failed)

"""Cycles of Goodman's bar in closed form.

Under a first pull the bar slips from its end over the length F/q, with the friction q per length
(Goodman 1959).  Pull and push are the same, so the branches of a loop are the first pull, doubled
(Masing 1926): with the increments u(F) of a pull up to the amplitude A,

    u(A) - 2 u((A - F)/2) on the way down,    -u(A) + 2 u((A + F)/2) on the way up.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import Array

from jbeamshell.common.errors import Status
from jbeamshell.load_steps.path_state import PathState, StepResults, initial_state
from jbeamshell.load_steps.system import LoadLevel, System, V
from jbeamshell.mechanics.bar import bar_backbone, bar_force, bar_slip_length, bar_slip_profile
from jbeamshell.mechanics.friction import coulomb_cap
from jbeamshell.scene.load_path import LoadPath
from jbeamshell.scene.scene import Scene


def bar_cycles(scene: Scene, path: LoadPath) -> StepResults:
    """Results of the scene's own cycles; beyond gross slip only the pressing converges."""
    system, strip, load, contact = System(scene), scene.strip, scene.load, scene.contact
    half, stiffness = scene.plan.steps, strip.stretching_stiffness
    resistance = contact.friction * (contact.pressure - contact.bottom_pressure)
    part = jnp.arange(half + 1) / half  # of the amplitude in a first pull
    if load.control == "force":
        force = load.amplitude * part
        displacement = bar_backbone(force, stiffness, resistance)
    else:
        displacement = load.amplitude * part
        # The root of the part is taken alone, because its slope at zero is infinite.
        force = bar_force(load.amplitude, stiffness, resistance) * jnp.sqrt(part)
    slip_length = bar_slip_length(force, resistance)
    slip = jax.vmap(lambda f: bar_slip_profile(system.x, f, strip.length, stiffness, resistance))(
        force
    )
    traction = resistance * (system.x > strip.length - slip_length[:, None])
    work = jnp.diff(force**3 / (6.0 * stiffness * resistance))  # of q along the slip
    zeros = jnp.zeros(load.pressure_steps)  # of the pressing

    def along_path(pull: Array) -> Array:
        """Values (steps, ...) along the whole path from those of a first pull (half+1, ...)."""
        up = 2.0 * pull[1:] - pull[-1]
        pressing = jnp.zeros((zeros.size, *pull.shape[1:]), pull.dtype)
        return jnp.concatenate([pressing, pull[2::2], *[-up, up] * load.cycles])

    def per_step(pressing: Array, first: Array, branch: Array) -> Array:
        """Values of the steps of the pressing, the first pull and every branch, one by one."""
        return jnp.concatenate([pressing, first, *[branch] * (2 * load.cycles)])

    reaction = path.pressure[:, None] * ((system.load - system.bottom_load) / system.tributary)
    level = LoadLevel(
        q=along_path(jnp.zeros((*slip.shape, scene.plan.width)).at[..., V].set(slip)),
        traction=along_path(traction),
        cap=coulomb_cap(contact.friction, reaction),
        reaction=reaction,
        force=along_path(force),
    )
    sticks = slip_length[-1] < strip.length  # at the other end
    converged = (path.rough == 0.0) | sticks
    state: PathState = jax.tree.map(
        lambda a: jnp.broadcast_to(a, (converged.size, *a.shape)), initial_state(scene)
    )
    slips, zero = traction > 0.0, jnp.zeros_like(level.force)
    return StepResults(
        state=state._replace(
            level=level, target=path.target, pressure=path.pressure, converged=converged
        ),
        displacement=along_path(displacement),
        slipping=per_step(jnp.zeros((zeros.size, system.x.size), bool), slips[2::2], slips[1:]),
        slip_work=per_step(zeros, work[::2] + work[1::2], 2.0 * work),
        stored_energy=jax.vmap(system.stored_energy)(level, path.pressure),
        sinking=zero,
        iterations=zero.astype(int),
        error=zero,
        status=jnp.where(converged, Status.CONVERGED, Status.NOT_REACHED),
    )

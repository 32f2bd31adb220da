"""Prediction of slip: reversals of the load, and the slip that a bar would have since the last."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from jbeamshell.load_steps.system import System
from jbeamshell.scene.keys import ARC_LENGTH

# Length over H by which the slip zone of a strip is shorter than that of a bar, and the length over
# H within which this difference grows.
CORNER, REACH = 1.7, 0.4
SMALLEST_SHARE = 1e-9  # smallest difference of tractions that counts, over the cap


class Reversal(NamedTuple):
    """Reversal of the load.

    Attributes
    ----------
    target : controlled load at the reversal
    depth : (n,) increment of force since the reversal at which the slip reaches a node
    left : change of traction left at the loaded end up to the cap of the other sign
    """

    target: Array
    depth: Array
    left: Array


def last_reversal(system: System, state: Any, to: Any) -> Reversal:
    """Last reversal of the load, which may be at the start of this step.

    Parameters
    ----------
    system : equations of equilibrium
    state : `PathState` before the step
    to : target, pressure and roughness of the step
    """
    before, travel, rough = state.level, to.target - state.target, to.rough > 0.0
    direction = jnp.where(travel >= 0.0, 1.0, -1.0)
    # The end load's part of the cap changes sign with the load.
    mean = (
        system.foundation.friction
        * to.pressure
        * (system.load - system.bottom_load)
        / system.tributary
    )
    room = jnp.maximum(2.0 * mean - before.cap - direction * before.traction, 0.0)
    share = room * system.tributary
    depth = jnp.cumsum(share[::-1], axis=0)[::-1] - 0.5 * share
    distance = (system.x[-1] - system.x) / (REACH * system.half_height)
    corner = CORNER * system.half_height * (1.0 - jnp.exp(-distance))
    reversal = Reversal(state.target, depth + corner * room, room[-1])
    turns = rough & (travel * (state.target - state.reversal.target) <= 0.0)
    return jax.tree.map(lambda new, old: jnp.where(turns, new, old), reversal, state.reversal)


def first_to_slip(system: System, reversal: Reversal, target: Array) -> Array:
    """Directions (n,) in which nodes slip if the strip is a bar; zero for those that stick.

    A bar slips from the loaded end to the node where the load since the last reversal has used up
    the friction that was left.
    """
    rise = target - reversal.target
    direction, load = jnp.where(rise >= 0.0, 1.0, -1.0), jnp.abs(rise)
    if system.control != "force":  # by the bar's u = F^2/(2 E' 2H q)
        stretch = system.stiffness_scale * jnp.sum(system.tributary, axis=0)
        square = 2.0 * stretch * reversal.left
        load = square * load
        if system.control == ARC_LENGTH:  # the arc length is about the chord of u and F L/(E' 2H)
            soft = (square / system.stiffness_scale) ** 2 / 2.0
            load = load**2 / (soft + jnp.hypot(soft, load) + jnp.finfo(load.dtype).tiny)
        load = jnp.sqrt(load)
    return direction * (reversal.depth < load)

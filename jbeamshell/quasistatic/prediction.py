"""Where slip is expected: reversals of the load, and how deep a bar would slip since the last."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from jbeamshell.quasistatic.system import System
from jbeamshell.scene.keys import ARC_LENGTH

CORNER, REACH = 1.7, 0.4  # H by which a strip slips less deep than a bar, and over which it grows
SMALLEST_SHARE = 1e-9  # of the cap, or of gross slip: less than this is no difference


class Reversal(NamedTuple):
    """A reversal of the load.

    Attributes
    ----------
    target : the controlled load there
    depth : (n,) force since then that takes the slip to a node
    left : friction left at the loaded end, up to the cap of the other sign
    """

    target: Array
    depth: Array
    left: Array


class BeforeStep(NamedTuple):
    """What a reversal sees: traction and cap (n,), controlled load, and the reversal before."""

    traction: Array
    cap: Array
    target: Array
    turn: Reversal


def last_reversal(system: System, before: Any, to: Any) -> Reversal:
    """The last reversal of the load, which may be now.

    Parameters
    ----------
    system : its arrays may have lanes behind their nodes
    before : has the traction (n,), the cap (n,), the target and the turn of the step before
    to : has the target, the pressure and the roughness of this one
    """
    stride, rough = to.target - before.target, to.rough > 0.0
    along = jnp.where(stride >= 0.0, 1.0, -1.0)
    # What the end load has changed of the cap changes sign with it.
    mean = (
        system.foundation.friction
        * to.pressure
        * (system.load - system.bottom_load)
        / system.tributary
    )
    left = jnp.maximum(2.0 * mean - before.cap - along * before.traction, 0.0)
    share = left * system.tributary
    used = jnp.cumsum(share[::-1], axis=0)[::-1] - 0.5 * share
    away = (system.x[-1] - system.x) / (REACH * system.half_height)
    corner = CORNER * system.half_height * (1.0 - jnp.exp(-away))
    now = Reversal(before.target, used + corner * left, left[-1])
    back = rough & (stride * (before.target - before.turn.target) <= 0.0)
    return jax.tree.map(lambda new, old: jnp.where(back, new, old), now, before.turn)


def first_to_slip(system: System, turn: Reversal, target: Array) -> Array:
    """Directions (n,) in which those nodes slip that would if the strip were a bar, else zero.

    A bar slips from the loaded end to where the friction left at the last reversal is used up by
    the load since.
    """
    rise = target - turn.target
    along, load = jnp.where(rise >= 0.0, 1.0, -1.0), jnp.abs(rise)
    if system.control != "force":  # by the bar's u = F^2/(2 E' 2H q)
        stretch = system.stiffness_scale * jnp.sum(system.tributary, axis=0)
        square = 2.0 * stretch * turn.left
        load = square * load
        if system.control == ARC_LENGTH:  # the way is about the chord of u and F L/(E' 2H)
            soft = (square / system.stiffness_scale) ** 2 / 2.0
            load = load**2 / (soft + jnp.hypot(soft, load) + jnp.finfo(load.dtype).tiny)
        load = jnp.sqrt(load)
    return along * (turn.depth < load)

r"""Elastic slip as a rate law: friction whose memory is a state of a differential equation.

The virgin curve S(z) = z/(1+z^m)^(1/m) of `jbeamshell.mechanics.friction.ElasticSlip` obeys
S' = (1 - S^m)^(1+1/m), so at a constant cap the same loop is

    t_t = k_t v_t (1 - (abs(t)/cap)^m)^(1+1/m)    in loading, t v_t > 0,
    t_t = k_t v_t                                 in unloading,

continuous in t and in v_t.  Where the cap falls below abs(t), the traction follows it down with a
relaxation time that is short against everything else; what it does dissipates all the same.  The
same law moves the sliders of a network: a slider's force is its traction.
"""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import require
from jbeamshell.mechanics.friction import ElasticSlip, FrictionLaw, SharpSlip

SHARPEST = 16.0  # m in place of a sharp slider's, whose rate jumps


def exponent(law: FrictionLaw) -> Array:
    """The exponent m of a rate law that has the loops of a law.

    A sharp slider's rate jumps when it starts to slip, which no solver of differential equations
    may be given; `SHARPEST` takes its place.

    Raises
    ------
    InputError
        for a law that has no such rate
    """
    known = isinstance(law, SharpSlip | ElasticSlip)
    fix = "has no rate that time steps of any size agree on: take contact.law = 'elastic-slip'"
    require("contact.law", type(law).__name__, known, fix)
    return getattr(law, "smoothing", jnp.asarray(SHARPEST))


def traction_rate(
    t: Array, speed: Array, cap: Array, stiffness: ArrayLike, m: Array, floor: ArrayLike
) -> Array:
    """Rate of the traction, without the relaxation.

    Parameters
    ----------
    t : traction
    speed : v_t
    cap : mu R, or the force of a slider
    stiffness : k_t
    m : exponent
    floor : least cap that a ratio is taken of
    """
    loading = t * speed > 0.0
    ratio = jnp.abs(t) / jnp.maximum(cap, floor)
    part = jnp.where(loading, jnp.minimum(ratio, 1.0), 0.0)
    rest = jnp.maximum(1.0 - part**m, 0.0)
    positive = jnp.where(rest > 0.0, rest, 1.0)  # its power has no slope at zero
    slowing = jnp.where(rest > 0.0, positive ** (1.0 + 1.0 / m), 0.0)
    return jnp.multiply(stiffness, speed) * slowing


def relaxation_rate(t: Array, cap: Array, time: ArrayLike) -> Array:
    """What brings a traction back that a falling cap has left behind, traction per time."""
    room = jnp.maximum(cap, 0.0)
    return (jnp.clip(t, -room, room) - t) / time

r"""Rate law of friction with elastic slip, for solvers of ordinary differential equations.

The virgin curve S(z) = z/(1+z^m)^(1/m) of `jbeamshell.mechanics.friction.ElasticSlip` obeys
S' = (1 - S^m)^(1+1/m), so at a constant cap the same loop is

    t_t = k_t v_t (1 - (abs(t)/cap)^m)^(1+1/m)    in loading, t v_t > 0,
    t_t = k_t v_t                                 in unloading,

continuous in t and in v_t.  Where the cap falls below abs(t), the traction decays to the cap with
a relaxation time that is short compared with the vibration; this decay dissipates energy too.  The
same law holds for the sliders of a network, with a slider's force in place of the traction.
"""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import require
from jbeamshell.mechanics.friction import ElasticSlip, FrictionLaw, SharpSlip

SHARPEST = 16.0  # exponent m that replaces a sharp slider, whose rate jumps


def exponent(law: FrictionLaw) -> Array:
    """Exponent m of the rate law that has the loops of a friction law.

    The rate of a sharp slider jumps when it starts to slip, which solvers of differential equations
    do not accept; it is replaced by `SHARPEST`.

    Raises
    ------
    InputError
        for a law that has no such rate
    """
    known = isinstance(law, SharpSlip | ElasticSlip)
    fix = "depends on the size of the steps, so it has no rate: take 'elastic-slip'"
    require("contact.law", type(law).__name__, known, fix)
    return getattr(law, "smoothing", jnp.asarray(SHARPEST))


def traction_rate(
    t: Array, speed: Array, cap: Array, stiffness: ArrayLike, m: Array, floor: ArrayLike
) -> Array:
    """Rate of the traction at a constant cap; arrays of any one shape.

    Parameters
    ----------
    t : traction
    speed : rate v_t of the tangential displacement
    cap : cap mu R, or the slip force of a slider
    stiffness : slip stiffness k_t
    m : exponent
    floor : smallest cap that the traction is divided by
    """
    loading = t * speed > 0.0
    ratio = jnp.abs(t) / jnp.maximum(cap, floor)
    used = jnp.where(loading, jnp.minimum(ratio, 1.0), 0.0)
    reserve = jnp.maximum(1.0 - used**m, 0.0)
    positive = jnp.where(reserve > 0.0, reserve, 1.0)  # the power has no derivative at zero
    factor = jnp.where(reserve > 0.0, positive ** (1.0 + 1.0 / m), 0.0)
    return jnp.multiply(stiffness, speed) * factor


def relaxation_rate(t: Array, cap: Array, time: ArrayLike) -> Array:
    """Rate at which a traction beyond its cap decays to it, with a relaxation time."""
    limit = jnp.maximum(cap, 0.0)
    return (jnp.clip(t, -limit, limit) - t) / time

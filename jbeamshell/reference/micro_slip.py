r"""Energy of micro-slip over height: short formulas for a drawing and no test.

A bar dissipates D_1 = (2/3) F^3/(E' 2H q) in a cycle of force amplitude F, where q is friction per
length; it slips over s = F/q.  With the half height H the energy is D = g(s/H) D_1, and g depends
on where the pressed part ends:

    at the loaded end itself    g = (1 + (3.75 H/s)^2.72)^-1.62
    inside the strip            g = 1 - .49/(1 + (s/(5.22 H))^1.86)

so that the exponent of D ~ F^n is n = 3 + d ln g/d ln s.  At the loaded end n rises from 3 to 7.4
for small forces, and no power law holds over a decade of force: the stress of the stuck corner is
singular like r^(lambda - 1), from which n = 2/(1 - lambda) = 6.9 there (Williams 1952; nu = .3).
Where the pressed part ends inside the strip, as under a bolt, n is between 3 and 3.4.

The numbers were fitted to plane elasticity with nu = .3 at heights eta = 2H/L from .01 to .4, mu
from .05 to .2 and .1 to .95 of gross slip (`calibration/studies/four_parameters.py`), pulled and
pushed.

References
----------
Williams, M. L. (1952). Stress singularities resulting from various boundary conditions in angular
    corners of plates in extension. J. Appl. Mech. 19, 526-528.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import require_choice

EDGES = ("loaded-end", "inside")
CORNER, FALL, POWER = 3.75, 2.72, 1.62  # at the loaded end
DROP, REACH, RISE = 0.49, 5.22, 1.86  # inside


def height_factor(slip_over_height: ArrayLike, edge: str = "loaded-end") -> Array:
    """Factor g of a bar's energy per cycle; any shape.

    Parameters
    ----------
    slip_over_height : s/H, with the slipped length s = F/q of the bar
    edge : end of the pressed part: ``loaded-end``, or ``inside`` the strip, a length H or more
        before the load

    Raises
    ------
    InputError
        for another edge

    Notes
    -----
    Error of D to plane elasticity over the range above: at the loaded end 2 % (median), and 7 % in
    nine of ten cases; 21 % where slip reaches the far end of a strip of eta = .4, and 40 % where
    g < .03.  Inside 1.4 %, and 10 % in nine of ten; 45 % at worst, where s = H/3.  Beyond mu = .2
    the loaded corner lifts under a push, and small forces dissipate less, by factors.  With nu = 0
    or .45 the error is 11 % (median), and at the loaded end grows to factors where g < .1.
    """
    require_choice("edge", edge, EDGES)
    x = jnp.asarray(slip_over_height, jnp.result_type(float))
    if edge == "inside":
        return 1.0 - DROP / (1.0 + (x / REACH) ** RISE)
    return (1.0 + (CORNER / x) ** FALL) ** -POWER


def slip_energy(
    force: ArrayLike,
    friction_per_length: ArrayLike,
    axial_stiffness: ArrayLike,
    half_height: ArrayLike,
    edge: str = "loaded-end",
) -> Array:
    """Energy D lost per cycle of a force amplitude below gross slip; shapes broadcast.

    Parameters
    ----------
    force : F, per width
    friction_per_length : q = mu p
    axial_stiffness : E' 2H
    half_height : H
    edge : end of the pressed part, see `height_factor`

    Examples
    --------
    >>> slip_energy(0.7855, 1.0, 34000.0, 0.1126)  # the standard strip: 7.28e-6 by elasticity
    """
    f, q = jnp.asarray(force), jnp.asarray(friction_per_length)
    bar = 2.0 / 3.0 * f**3 / (axial_stiffness * q)
    return bar * height_factor(f / (q * half_height), edge)


def energy_exponent(slip_over_height: ArrayLike, edge: str = "loaded-end") -> Array:
    """Exponent n of the power law D ~ F^n that touches the energy at s/H; any shape."""
    x = jnp.asarray(slip_over_height, jnp.result_type(float))

    def log_factor(log_x: Array) -> Array:
        return jnp.log(height_factor(jnp.exp(log_x), edge))

    return 3.0 + jax.jvp(log_factor, (jnp.log(x),), (jnp.ones_like(x),))[1]

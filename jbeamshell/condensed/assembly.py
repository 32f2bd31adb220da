"""Assembly: pressing of a body with friction, as bolts are tightened.

The pressures grow together from zero, and the contact follows event by event.  Without a load the
contact would have no reaction at all, so that nothing could be said of its friction: it starts from
even reactions that are a millionth of the whole and fade while the pressures grow.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from jbeamshell.condensed.body import Body
from jbeamshell.condensed.branches import pressed
from jbeamshell.condensed.events import walk

FIRST = 1e-6  # part of the mean reaction from which the pressures grow


class Assembly(NamedTuple):
    """Contact under the pressures with friction; NaN if its events come to no end.

    Attributes
    ----------
    lift : (n,) lift w
    settled : (n,) tangential displacements
    reaction, traction : (n,) normal and tangential nodal forces of the base
    """

    lift: Array
    settled: Array
    reaction: Array
    traction: Array


def press_roughly(
    k_tt: Array, k_tn: Array, k_nn: Array, press_t: Array, press_n: Array, friction: Array
) -> Assembly:
    """Pressing of a body with friction; first derivatives are exact.

    Parameters
    ----------
    k_tt, k_tn, k_nn : (n, n) stiffness
    press_t, press_n : (n,) nodal forces of the base if nothing moved
    friction : mu
    """
    zero = jnp.zeros_like(press_n)
    even = jax.lax.stop_gradient(FIRST * jnp.mean(press_n)) + zero
    body = Body(
        x=zero,
        tributary=zero,
        K_tt=k_tt,
        K_tn=k_tn,
        K_nn=k_nn,
        f_t=-press_t,
        f_n=even - press_n,
        r_0=even,
        t_0=zero,
        c=jnp.ones_like(friction),
    )
    once = jnp.ones(1, bool)
    levels = walk(body, friction, pressed(body), jnp.ones_like(press_n[:1]), once)
    at = jax.tree.map(lambda part: jnp.where(levels.settled[0], part[0], jnp.nan), levels.state)
    lift = jnp.where(levels.settled[0], levels.lift[0], jnp.nan)
    return Assembly(lift, at.v, at.r_n, at.r_t)

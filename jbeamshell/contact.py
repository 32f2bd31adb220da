"""Unilateral contact of one point: w >= 0, R >= 0, w R = 0."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array


def complementarity(reaction: Array, lift: Array, stiffness: Array) -> Array:
    """Zero exactly where w >= 0, R >= 0 and w R = 0: the smaller of R and (stiffness times) w.

    Newton's method on it is the primal-dual active-set iteration (Hintermueller, Ito & Kunisch
    2002).

    Parameters
    ----------
    reaction : R, pressure of the foundation on the strip
    lift : w
    stiffness : weighs w against R, stress per length; it does not change the solution
    """
    return jnp.minimum(reaction, stiffness * lift)

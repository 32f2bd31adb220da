"""Law of one pair of nodes: unilateral contact and Coulomb friction in two directions.

With v = (v_1, v_2, v_n) the displacement of the upper node over the lower one, lambda the force
that the contact puts on the upper node, and s the slip so far, the excess of a displacement is

    e_t = v_t - s,      e_n = gap + v_n + h log(1 + lambda_n / F_0),

the last part for rough surfaces, whose heights are exponential (Greenwood and Williamson 1966).

A step is in equilibrium where, for any rho > 0,

    lambda_n = max(0, lambda_n - rho e_n),
    lambda_t = projection of (lambda_t - rho e_t) on the disc of radius mu lambda_n

(Alart and Curnier 1991).  Stick, slip and an open pair are one equation, without a penalty.  After
the step the slip is v_t, in a pair that sticks and in one that slides.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array


class Pairs(NamedTuple):
    """Numbers of the pairs of a face.

    Attributes
    ----------
    friction : (n,) Coulomb's coefficient mu
    gap : (n,) distance before anything presses
    roughness : (n, 2) h and F_0 of the surfaces; an h of 0 is smooth
    scale : (n, 2) rho, stiffness of the bodies at the pair, tangential and normal: both tangents
        share one, or friction would not point against the slip
    """

    friction: Array
    gap: Array
    roughness: Array
    scale: Array


def contact_force(force: Array, move: Array, slip: Array, pair: Pairs) -> Array:
    """Force (3,) of the contact law for a force (3,) and a displacement (3,) of one pair.

    Both agree in equilibrium.

    Parameters
    ----------
    force, move : lambda and v
    slip : (2,) s at the end of the last step
    pair : numbers of this pair
    """
    rho_t, rho_n = pair.scale
    height, reference = pair.roughness
    approach = height * jnp.log1p(jnp.maximum(force[2], 0.0) / reference)
    normal = jnp.maximum(force[2] - rho_n * (pair.gap + move[2] + approach), 0.0)
    trial = force[:2] - rho_t * (move[:2] - slip)
    square, radius = jnp.sum(trial**2), pair.friction * normal
    slides = square > radius**2
    size = jnp.sqrt(jnp.where(slides, square, 1.0))
    return jnp.append(jnp.where(slides, trial * (radius / size), trial), normal)

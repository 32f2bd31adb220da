"""Law of one pair of nodes: unilateral contact and Coulomb friction in two directions.

With w = (w_1, w_2, w_n) the displacement of the upper node over the lower one, lambda the force
that the contact puts on the upper node, s the slip so far, and c_t, c_n the softness of the pair
(zero for rigid contact), the excess of a displacement is

    e_t = w_t - s + c_t lambda_t,      e_n = gap + w_n + c_n lambda_n.

A step is in equilibrium where, for any rho > 0,

    lambda_n = max(0, lambda_n - rho e_n),
    lambda_t = projection of (lambda_t - rho e_t) on the disc of radius mu lambda_n

(Alart and Curnier 1991).  Stick, slip and an open pair are one equation, without a penalty.
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
    softness : (n, 2) displacement per force of the pair itself, tangential and normal; 0 is rigid
    scale : (n, 2) rho, stiffness of the bodies at the pair, tangential and normal: both tangents
        share one, or friction would not point against the slip
    """

    friction: Array
    gap: Array
    softness: Array
    scale: Array


def contact_force(force: Array, move: Array, slip: Array, pair: Pairs) -> Array:
    """Force (3,) of the contact law for a force (3,) and a displacement (3,) of one pair.

    Both agree in equilibrium.

    Parameters
    ----------
    force, move : lambda and w
    slip : (2,) s at the end of the last step
    pair : numbers of this pair
    """
    soft_t, soft_n = pair.softness
    rho_t, rho_n = pair.scale
    closing = force[2] - rho_n * (pair.gap + move[2] + soft_n * force[2])
    normal = jnp.maximum(closing, 0.0)
    trial = force[:2] - rho_t * (move[:2] - slip + soft_t * force[:2])
    square, radius = jnp.sum(trial**2), pair.friction * normal
    slides = square > radius**2
    size = jnp.sqrt(jnp.where(slides, square, 1.0))
    return jnp.append(jnp.where(slides, trial * (radius / size), trial), normal)


def slip_after(force: Array, move: Array, pair: Pairs) -> Array:
    """Slip s (2,) of one pair in equilibrium."""
    return move[:2] + pair.softness[0] * force[:2]

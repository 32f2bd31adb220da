"""Law of one contact point: unilateral contact and Coulomb friction in two directions, on springs.

With v = (v_1, v_2, v_n) the displacement of the upper body over the lower one, lambda the force
that the contact puts on the upper body, s the slip so far, and k_t and k_n the springs of the
point,

    lambda_n / k_n + h log(1 + lambda_n / F_0) = max(0, -(gap + v_n)),
    lambda_t = projection of -k_t (v_t - s) on the disc of radius mu lambda_n,

the logarithm for rough surfaces, whose heights are exponential (Greenwood and Williamson 1966).
After the step the slip is s = v_t + lambda_t / k_t.  What the springs give way by is taken out of
the bodies (`jbeamshell.bodies.face_springs`), so that they are no penalty (compare Alart and
Curnier 1991, where k is their rho).
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array, lax

NEWTON = 8  # iterations for the force of rough surfaces; six find 15 digits


class Points(NamedTuple):
    """Numbers of the contact points of a face.

    Attributes
    ----------
    friction : (q,) Coulomb's coefficient mu
    gap : (q,) distance before anything presses
    roughness : (q, 2) h and F_0 of the surfaces; an h of 0 is smooth
    springs : (q, 2) k_t and k_n: both tangents share one, or friction would not point against the
        slip
    """

    friction: Array
    gap: Array
    roughness: Array
    springs: Array


def contact_force(move: Array, slip: Array, point: Points) -> Array:
    """Force (3,) on the upper body at a displacement (3,) of one point.

    Parameters
    ----------
    move : v
    slip : (2,) s at the end of the last step
    point : numbers of this point
    """
    k_t, k_n = point.springs
    normal = _normal_force(-(point.gap + move[2]), k_n, *point.roughness)
    trial = -k_t * (move[:2] - slip)
    square, radius = jnp.sum(trial**2), point.friction * normal
    slides = square > radius**2
    size = jnp.sqrt(jnp.where(slides, square, 1.0))
    return jnp.append(jnp.where(slides, trial * (radius / size), trial), normal)


def _normal_force(depth: Array, spring: Array, height: Array, reference: Array) -> Array:
    """Normal force at a depth, from y = log(1 + force / F_0) by Newton's method.

    The left side is convex in y, and the search starts above the root, so that it never fails.
    """
    touches = depth >= 0.0
    depth = jnp.where(touches, depth, 0.0)

    def closer(y: Array, last: Array) -> Array:
        soft = reference / spring
        above = soft * jnp.expm1(last) + height * last - depth
        return y - above / lax.stop_gradient(soft * jnp.exp(last) + height)

    alone = jnp.log1p(depth * spring / reference)
    rough = height > 0.0
    y = jnp.where(rough, jnp.minimum(alone, depth / jnp.where(rough, height, 1.0)), alone)
    y = lax.stop_gradient(y)
    for _ in range(NEWTON):
        y = lax.stop_gradient(closer(y, y))
    # The last iteration has the slopes of the root.
    return jnp.where(touches, reference * jnp.expm1(closer(y, y)), 0.0)

"""Law of the contact points of a face: unilateral contact and Coulomb friction, on springs.

Each point hangs on springs k_t and k_n.  With v = (v_1, v_2, v_n) the displacement of the upper
body over the lower one and s that of the springs' other end, the contact puts the force

    lambda = k (s - v)

on the upper body.  It has

    lambda_n / k_n + h log(1 + lambda_n / F_0) = max(0, -(gap + v_n)),
    lambda_t = projection of k_t (s_t - v_t) on the disc of radius mu lambda_n,

the logarithm for rough surfaces, whose heights are exponential (Greenwood and Williamson 1966).
The slip s_t therefore stays where a point sticks, and s_n is -gap where a smooth one is closed: the
law only moves s where a point slides, opens or is rough.  What the springs give way by is taken out
of the bodies (`jbeamshell.bodies.face_springs`), so that they are no penalty (compare Alart and
Curnier 1991, where k is their rho).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jax import Array

from jbeamshell.common.numbers_of import numbers_of, without_slopes

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

    @property
    def stiffness(self) -> Array:
        """Stiffness (q, 3) of the springs in each direction."""
        return self.springs[:, np.array([0, 0, 1])]


def slip_at(move: Array, slip: Array, points: Points) -> Array:
    """Slip s (..., q, 3) of contact points: two tangential ones, and that of the normal.

    Parameters
    ----------
    move : v (..., q, 3)
    slip : s (..., q, 3) at the end of the last step, of which the law takes the tangential part
    points : numbers of the points
    """
    xp = numbers_of(move)
    force = _normal_force(-(points.gap + move[..., 2]), points)
    trial, size, radius, slides = _friction(move, slip, force, points)
    slid = move[..., :2] + trial * (radius / (points.springs[:, 0] * size))[..., None]
    tangential = xp.where(slides[..., None], slid, slip[..., :2])
    normal = move[..., 2] + force / points.springs[:, 1]
    closed = (points.roughness[:, 0] == 0.0) & (points.gap + move[..., 2] <= 0.0)
    normal = xp.where(closed, -points.gap, normal)  # to the last digit
    return xp.concatenate([tangential, normal[..., None]], axis=-1)


def slip_slopes(move: Array, slip: Array, points: Points) -> Array:
    """Slopes (q, 3, 3) of `slip_at` by v, zero where a smooth point sticks.

    They are written out because NumPy has no derivatives; a test compares them with JAX's.
    """
    xp = numbers_of(move)
    depth = -(points.gap + move[:, 2])
    touches, force = depth >= 0.0, _normal_force(depth, points)
    trial, size, radius, slides = _friction(move, slip, force, points)
    k_t, k_n = points.springs.T
    height, reference = points.roughness.T
    stiff = xp.where(touches, 1.0 / (1.0 / k_n + height / (reference + force)), 0.0)
    way = trial / size[:, None]
    across = np.eye(2) - way[:, :, None] * way[:, None, :]
    turned = np.eye(2) - (radius / size)[:, None, None] * across
    by_normal = -way * (points.friction * stiff / k_t)[:, None]
    top = xp.concatenate([turned, by_normal[:, :, None]], axis=2)
    top = xp.where(slides[:, None, None], top, 0.0)
    rough = xp.where(height == 0.0, xp.where(touches, 0.0, 1.0), 1.0 - stiff / k_n)
    bottom = rough[:, None, None] * np.array([0.0, 0.0, 1.0])
    return xp.concatenate([top, bottom], axis=1)


def _friction(
    move: Array, slip: Array, normal: Array, points: Points
) -> tuple[Array, Array, Array, Array]:
    """Force of the springs without slip, its size, its bound, and True where it is beyond."""
    xp = numbers_of(move)
    trial = points.springs[:, :1] * (slip[..., :2] - move[..., :2])
    square, radius = xp.sum(trial**2, axis=-1), points.friction * normal
    slides = square > radius**2
    return trial, xp.sqrt(xp.where(slides, square, 1.0)), radius, slides


def _normal_force(depth: Array, points: Points) -> Array:
    """Normal force at a depth (..., q), from y = log(1 + force / F_0) by Newton's method.

    The left side is convex in y, and the search starts above the root, so that it never fails.
    """
    xp = numbers_of(depth)
    spring, (height, reference) = points.springs[:, 1], points.roughness.T
    touches = depth >= 0.0
    depth = xp.where(touches, depth, 0.0)
    rough = height > 0.0
    if xp is np and not np.any(rough):  # most are smooth
        return depth * spring

    def closer(y: Array, last: Array) -> Array:
        soft = reference / spring
        above = soft * xp.expm1(last) + height * last - depth
        return y - above / without_slopes(soft * xp.exp(last) + height)

    alone = xp.log1p(depth * spring / reference)
    y = xp.where(rough, xp.minimum(alone, depth / xp.where(rough, height, 1.0)), alone)
    y = without_slopes(y)
    for _ in range(NEWTON):
        y = without_slopes(closer(y, y))
    # The last iteration has the slopes of the root.
    return xp.where(touches, reference * xp.expm1(closer(y, y)), 0.0)

r"""Kinematics of a beamshell: strains and positions from the fields of a section.

A section carries four fields: the tangential displacement ``v`` and the lift ``w`` of the contact
point (bottom face), the rotation ``beta`` and the squeeze strain ``psi``.  With the axes
T = (cos beta, sin beta) and B = (-sin beta, cos beta), the material point at height s in [-H, H] is

    x = X + v - (H+s)(1+psi) sin(beta),      y = w + (H+s)(1+psi) cos(beta),

and the reference curve s = 0 has the strains (Libai & Simmonds 1998; Brink 2015, eqs. 3.22-3.23,
with 3.39-3.40 extended by the lift and the squeeze strain)

    e = (1+u_x') cos(beta) + u_y' sin(beta) - 1,
    g = u_y' cos(beta) - (1+u_x') sin(beta),
    k = beta'.

With u_x = v - H(1+psi) sin(beta) and u_y = w + H(1+psi) cos(beta) - H these become

    e = v' cos(beta) + w' sin(beta) - 2 sin^2(beta/2) - H (1+psi) beta'
    g = w' cos(beta) - (1+v') sin(beta) + H psi'

where no terms of order one cancel.

A strip that is curved before loading has the angle alpha(X) and the curvature alpha' (Libai &
Simmonds 1998; Brink 2015, eqs. 2.25-2.28).  In the axes of the undeformed section, into which
`rotated` takes displacements and slopes, the strains are

    e = v' cos(beta) + w' sin(beta) - 2 (1+H alpha') sin^2(beta/2) - H (1+psi) beta' - H psi alpha'
    g = w' cos(beta) - (1+H alpha' + v') sin(beta) + H psi'

where primes are derivatives along the undeformed mid-height curve.

References
----------
Brink, A. R. (2015). Modeling complex contact phenomena with nonlinear beamshells. Dissertation,
    The University of Akron.
Libai, A. & Simmonds, J. G. (1998). The Nonlinear Theory of Elastic Shells. Cambridge University
    Press.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

FIELDS = ("v", "w", "beta", "psi")
Section = Array | Sequence[Array]  # the four fields of one section, or their derivatives along X


class Strains(NamedTuple):
    """Strains of one section.

    Attributes
    ----------
    e : extension of the reference curve, dimensionless
    g : shear, dimensionless
    k : bending, beta', 1/length
    psi : squeeze strain (relative change of height, positive when thickening), dimensionless
    dpsi : psi', 1/length
    """

    e: Array
    g: Array
    k: Array
    psi: Array
    dpsi: Array


def _rotation(beta: Array) -> tuple[Array, Array, Array]:
    """Sine, cosine and 1 - cosine of beta, the last by the half angle to avoid cancellation."""
    sin, cos = jnp.sin(0.5 * beta), jnp.cos(0.5 * beta)
    versine = 2.0 * sin * sin
    return 2.0 * sin * cos, 1.0 - versine, versine


def rotated(x: Array, y: Array, angle: ArrayLike) -> tuple[Array, Array]:
    """Components of the vector (x, y) in axes rotated counter-clockwise by an angle, rad."""
    sin, cos = jnp.sin(angle), jnp.cos(angle)
    return x * cos + y * sin, y * cos - x * sin


def exact_strains(
    section: Section, slope: Section, half_height: ArrayLike, curvature: ArrayLike | None = None
) -> Strains:
    """Geometrically exact strains of one section.

    Parameters
    ----------
    section : (4,) fields v, w, beta, psi
    slope : (4,) their derivatives along X, in the axes of the undeformed section
    half_height : half height H, length
    curvature : alpha' of the undeformed strip, 1/length; None for a straight strip
    """
    _, _, beta, psi = section
    dv, dw, dbeta, dpsi = slope
    sin, cos, versine = _rotation(beta)
    e = dv * cos + dw * sin - versine - half_height * (1.0 + psi) * dbeta
    g = dw * cos - (1.0 + dv) * sin + half_height * dpsi
    if curvature is not None:
        e = e - half_height * curvature * (versine + psi)
        g = g - half_height * curvature * sin
    return Strains(e, g, dbeta, psi, dpsi)


def linear_strains(
    section: Section, slope: Section, half_height: ArrayLike, curvature: ArrayLike | None = None
) -> Strains:
    """Strains of one section for small displacements and rotations; see `exact_strains`."""
    _, _, beta, psi = section
    dv, dw, dbeta, dpsi = slope
    e, g = dv - half_height * dbeta, dw - beta + half_height * dpsi
    if curvature is not None:
        e, g = e - half_height * curvature * psi, g - half_height * curvature * beta
    return Strains(e, g, dbeta, psi, dpsi)


def exact_position(
    section: Section, half_height: ArrayLike, height: ArrayLike
) -> tuple[Array, Array]:
    """Displacement (x, y) of the material point at ``height`` s above mid-height.

    Parameters
    ----------
    section : (4,) fields v, w, beta, psi; v, w and the result in the undeformed section's axes
    half_height : half height H, length
    height : s in [-H, H], length
    """
    v, w, beta, psi = section
    sin, _, versine = _rotation(beta)
    arm = half_height + height
    return v - arm * (1.0 + psi) * sin, w + arm * psi - arm * (1.0 + psi) * versine


def linear_position(
    section: Section, half_height: ArrayLike, height: ArrayLike
) -> tuple[Array, Array]:
    """Displacement (x, y) for small displacements and rotations; see `exact_position`."""
    v, w, beta, psi = section
    arm = half_height + height
    return v - arm * beta, w + arm * psi


class Kinematics(NamedTuple):
    """Strains and positions that belong together.

    Attributes
    ----------
    strains : function such as `exact_strains`
    position : function such as `exact_position`
    """

    strains: Callable[..., Strains]
    position: Callable[[Section, ArrayLike, ArrayLike], tuple[Array, Array]]


KINEMATICS = {
    "exact": Kinematics(exact_strains, exact_position),
    "linear": Kinematics(linear_strains, linear_position),
}

"""Stuck strip: rotation of a strip whose contact does not slip, and the force that makes it slip.

The strip of height 2 H lies on X in [0, L], is held at X = 0 and is pulled by the end force F at
X = L.  Forces are per unit width.  Functions are pure, built on `jax.numpy`, and can be
differentiated and vmapped.

References
----------
Brink, A. R. (2015). Modeling complex contact phenomena with nonlinear beamshells. Dissertation,
    The University of Akron.
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.mechanics.homogeneous import shear_coefficient

# (2 E' H^3 + D) / (E' H^3), and N(L) / F of the axial force at the loaded end
_STUCK_STRIP = {"consistent": (8 / 3, 3 / 4), "printed": (2 + 1 / 24, 1.0)}


def stuck_decay_rate(
    half_height: ArrayLike,
    youngs_plane_strain: ArrayLike,
    shear_modulus: ArrayLike,
    shear_coefficient: ArrayLike,
    bending_stiffness: ArrayLike | None = None,
) -> Array:
    """Decay rate along a fully stuck strip, ``lambda^2 = 2 kappa G H / (2 E' H^3 + D)``.

    Parameters
    ----------
    half_height : array_like, shape (...)
        H [length].
    youngs_plane_strain : array_like, shape (...)
        ``E' = E / (1 - nu^2)`` [stress].
    shear_modulus : array_like, shape (...)
        G [stress].
    shear_coefficient : array_like, shape (...)
        kappa [1].
    bending_stiffness : array_like, shape (...), optional
        D [force length]; ``(2/3) E' H^3`` when not given.

    Returns
    -------
    Array, shape (...)
        lambda [1 / length].

    Notes
    -----
    From ``(2 E' H^3 + D) beta'' = 2 kappa G H beta``: Brink 2015, section 3.5.4, for small strain.
    """
    stiffness = _stuck_stiffness(half_height, youngs_plane_strain, bending_stiffness)
    return jnp.sqrt(2 * shear_coefficient * shear_modulus * half_height / stiffness)


def stuck_rotation(
    x: ArrayLike,
    force: ArrayLike,
    length: ArrayLike,
    half_height: ArrayLike,
    youngs_plane_strain: ArrayLike,
    shear_modulus: ArrayLike,
    shear_coefficient: ArrayLike,
    bending_stiffness: ArrayLike | None = None,
) -> Array:
    """Rotation of a stuck strip, ``beta(X) = beta'(L) sinh(lambda X) / (lambda cosh(lambda L))``.

    Parameters
    ----------
    x : array_like, shape (...)
        Positions X in [0, length] [length].
    force : array_like, shape (...)
        End force F, spread evenly over the end face [force].
    length : array_like, shape (...)
        L [length].
    half_height : array_like, shape (...)
        H [length].
    youngs_plane_strain : array_like, shape (...)
        ``E' = E / (1 - nu^2)`` [stress].
    shear_modulus : array_like, shape (...)
        G [stress].
    shear_coefficient : array_like, shape (...)
        kappa [1].
    bending_stiffness : array_like, shape (...), optional
        D [force length]; ``(2/3) E' H^3`` when not given.

    Returns
    -------
    Array, shape (...)
        beta(X) [rad], negative under a pull.

    Notes
    -----
    The contact points do not move, the strain is small, ``beta(0) = 0``, and the natural end
    condition is ``(2 E' H^3 + D) beta'(L) = -F H``, with lambda of `stuck_decay_rate`. Brink 2015,
    section 3.5.4.
    """
    x = jnp.asarray(x)
    stiffness = _stuck_stiffness(half_height, youngs_plane_strain, bending_stiffness)
    decay = stuck_decay_rate(
        half_height, youngs_plane_strain, shear_modulus, shear_coefficient, bending_stiffness
    )
    end_slope = -jnp.multiply(force, half_height) / stiffness
    # sinh(a) / cosh(b) in decaying exponentials, because either alone overflows
    sinh_over_cosh = (
        jnp.exp(decay * (x - length))
        * -jnp.expm1(-2 * decay * x)
        / (1 + jnp.exp(-2 * decay * length))
    )
    return end_slope / decay * sinh_over_cosh


def first_slip_force(
    height_ratio: ArrayLike,
    *,
    length: ArrayLike = 2.0,
    friction: ArrayLike = 0.1,
    pressure: ArrayLike = 10.0,
    poisson_ratio: ArrayLike = 0.3,
    constants: str = "consistent",
) -> Array:
    """Pull that makes a strip slip, ``F = mu p H / (c (lambda H tanh(lambda L) + mu kappa r))``.

    Here ``r = G / E' = (1 - nu) / 2``, lambda is that of `stuck_decay_rate`, and ``c = N(L) / F``
    is the share of the end force that the fully stuck strip carries as axial force up to its end.

    Parameters
    ----------
    height_ratio : array_like, shape (...)
        ``eta = H / a > 0`` with ``a = L / 2`` [1].
    length : array_like, shape (...)
        L [length].
    friction : array_like, shape (...)
        Friction coefficient mu [1].
    pressure : array_like, shape (...)
        Pressure p on the top face [stress].
    poisson_ratio : array_like, shape (...)
        nu [1].
    constants : {'consistent', 'printed'}
        'consistent' takes ``D = (2/3) E' H^3`` and the natural end condition, hence ``c = 3/4``:
        the rest of F would be a point force at the corner, so some slip starts at once.
        'printed' takes ``D = E' H^3 / 24`` (Brink 2015, eq. 3.45) and ``N(L) = F``.

    Returns
    -------
    Array, shape (...)
        F per width [force / length].

    Raises
    ------
    ValueError
        If `constants` is not one of the choices.

    Notes
    -----
    The criterion is ``|t| = mu R`` at X = L, where the stuck strip of `stuck_rotation` comes
    nearest to slip: ``t = N'`` and ``R = p - Q'`` with ``N = -2 E' H^2 beta'`` and
    ``Q = -2 kappa G H beta``. Over the ten heights of Brink 2015, figure 3.11, 'printed' is close
    to the line ``1.767 eta - 0.0013`` of eq. 3.65.
    """
    if constants not in _STUCK_STRIP:
        raise ValueError(f"constants must be one of {sorted(_STUCK_STRIP)}, not {constants!r}")
    stiffness, end_share = _STUCK_STRIP[constants]
    half_height = jnp.asarray(height_ratio) * length / 2
    kappa, modulus_ratio = shear_coefficient(poisson_ratio), (1 - jnp.asarray(poisson_ratio)) / 2
    decay = stuck_decay_rate(
        half_height, 1.0, modulus_ratio, kappa, (stiffness - 2) * half_height**3
    )
    shear = half_height * decay * jnp.tanh(decay * length)
    relief = friction * kappa * modulus_ratio
    return jnp.multiply(friction, pressure) * half_height / (end_share * (shear + relief))


def _stuck_stiffness(
    half_height: ArrayLike, youngs_plane_strain: ArrayLike, bending_stiffness: ArrayLike | None
) -> Array:
    """Stiffness against beta' of a stuck strip, ``2 E' H^3 + D``: stretching and bending."""
    stretching = 2 * jnp.power(half_height, 3) * youngs_plane_strain
    return stretching + (stretching / 3 if bending_stiffness is None else bending_stiffness)

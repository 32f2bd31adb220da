"""Cantilever of two layers that slip on each other in bending (Goodman and Klumpp 1956).

Two equal layers of height h and length L are clamped at one end and pressed together by p.  A force
F bends them at the other end.  The shear between them, 3 F/(4 h) per width, is the same all along,
so that the whole interface starts to slip at once, at F_s = 4/3 mu p h.  From there on the layers
bend for themselves.  With S = E' h the stretching stiffness of a layer, per unit width,

    w = F L^3/(2 S h^2) + 3 (F - F_s) L^3/(2 S h^2),    D = 8 mu p (A - F_s) L^3/(S h)

are the deflection of a first loading (the second term from F_s on) and the energy lost in a cycle
between A and -A.

References
----------
Goodman, L. E. and Klumpp, J. H. (1956). Analysis of slip damping with reference to turbine-blade
    vibration. Journal of Applied Mechanics 23, 421-429.
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike


def layered_beam_slip_force(height: ArrayLike, shear_cap: ArrayLike) -> Array:
    """Force at which two layers slip, ``F_s = 4/3 mu p h``.

    Parameters
    ----------
    height : array_like, shape (...)
        Height h of one layer [length].
    shear_cap : array_like, shape (...)
        Largest friction mu p [stress].

    Returns
    -------
    Array, shape (...)
        F_s per width [force / width].
    """
    return 4 / 3 * jnp.asarray(shear_cap) * height


def layered_beam_deflection(
    force: ArrayLike,
    length: ArrayLike,
    height: ArrayLike,
    stretching: ArrayLike,
    shear_cap: ArrayLike,
) -> Array:
    """Deflection of the loaded end of two layers on first loading.

    Parameters
    ----------
    force : array_like, shape (...)
        F per width [force / width].
    length, height : array_like, shape (...)
        L, and h of one layer [length].
    stretching : array_like, shape (...)
        ``S = E' h`` of one layer [force / width].
    shear_cap : array_like, shape (...)
        Largest friction mu p [stress].

    Returns
    -------
    Array, shape (...)
        Deflection w [length].

    Notes
    -----
    Slender layers, without shear deformation: Goodman & Klumpp 1956.
    """
    size = jnp.abs(force)
    beyond = jnp.maximum(size - layered_beam_slip_force(height, shear_cap), 0)
    whole = jnp.power(length, 3) / stretching / jnp.power(height, 2) / 2
    return jnp.sign(force) * whole * (size + 3 * beyond)


def layered_beam_dissipation(
    amplitude: ArrayLike,
    length: ArrayLike,
    height: ArrayLike,
    stretching: ArrayLike,
    shear_cap: ArrayLike,
) -> Array:
    """Energy that two layers dissipate per full cycle, zero below the force at which they slip.

    Parameters
    ----------
    amplitude : array_like, shape (...)
        Largest force A per width [force / width].
    length, height, stretching, shear_cap : array_like, shape (...)
        As in `layered_beam_deflection`.

    Returns
    -------
    Array, shape (...)
        Dissipated energy D per width [force].

    Notes
    -----
    Goodman & Klumpp 1956.  In mu p it is largest at ``mu p = 3 A/(8 h)``, half of what holds.
    """
    beyond = jnp.maximum(amplitude - layered_beam_slip_force(height, shear_cap), 0)
    return 8 * jnp.asarray(shear_cap) * beyond * jnp.power(length, 3) / stretching / height

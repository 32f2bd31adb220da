r"""Cattaneo's and Mindlin's contact: cylinders and spheres that slip from the rim.

Two elastic bodies are pressed together by P and sheared by Q below mu P.  The rim slips; the part
c/a of the contact's half width a sticks.  Functions are pure, built on `jax.numpy`, and can be
differentiated and vmapped.

References
----------
Brink, A. R. (2015). Modeling complex contact phenomena with nonlinear beamshells. Dissertation,
    The University of Akron, eq. 2.47-2.49 and 3.1.
Cattaneo, C. (1938). Sul contatto di due corpi elastici: distribuzione locale degli sforzi. Rend.
    Accad. Naz. Lincei 27, 342-348, 434-436, 474-478.
Goodman, L. E. (1959). A review of progress in analysis of interfacial slip damping. In: Structural
    Damping, ASME, 35-48.
Johnson, K. L. (1985). Contact mechanics. Cambridge University Press, chapter 7.
Mindlin, R. D. (1949). Compliance of elastic bodies in contact. J. Appl. Mech. 16, 259-268.
Mindlin, R. D. & Deresiewicz, H. (1953). Elastic spheres in contact under varying oblique forces.
    J. Appl. Mech. 20, 327-344.
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import as_leaf, is_traced, require, require_choice
from jbeamshell.laws.mindlin import Mindlin

SHAPES = {"cylinder": 1.0 / 2.0, "sphere": 1.0 / 3.0}  # exponent of the part that sticks


def stuck_part(force_ratio: ArrayLike, shape: str = "cylinder") -> Array:
    """Part of the contact's half width that sticks, ``c/a = (1 - Q/(mu P))^(1/2 or 1/3)``.

    Parameters
    ----------
    force_ratio : array_like, shape (...)
        Shear force over that of gross slip, Q/(mu P) [1], between -1 and 1.
    shape : {'cylinder', 'sphere'}
        Shape of the bodies: exponent 1/2 or 1/3.

    Returns
    -------
    Array, shape (...)
        c/a [1]; NaN for traced ratios beyond gross slip.

    Raises
    ------
    InputError
        If the force exceeds gross slip, or for another shape.

    Notes
    -----
    Cattaneo 1938; Mindlin 1949; Brink 2015, eq. 2.47.
    """
    require_choice("shape", shape, tuple(SHAPES))
    ratio = jnp.abs(as_leaf(force_ratio, "force_ratio"))
    if not is_traced(ratio):
        fix = "is gross slip: give ratios of force between -1 and 1"
        require("force_ratio", force_ratio, not bool(jnp.any(ratio > 1.0)), fix)
    return (1.0 - ratio) ** SHAPES[shape]


def counter_slip_part(
    force_ratio: ArrayLike, amplitude_ratio: ArrayLike, shape: str = "cylinder"
) -> Array:
    """Part of the half width without counter-slip after unloading from an amplitude.

    Parameters
    ----------
    force_ratio : array_like, shape (...)
        Present shear force over that of gross slip, Q/(mu P) [1].
    amplitude_ratio : array_like, shape (...)
        The same at the turn, Q*/(mu P) [1].
    shape : {'cylinder', 'sphere'}
        Shape of the bodies.

    Returns
    -------
    Array, shape (...)
        ``(1 - (Q* - Q)/(2 mu P))^(1/2 or 1/3)`` [1]: `stuck_part` of half the change.

    Notes
    -----
    Mindlin & Deresiewicz 1953; Johnson 1985, section 7.3.
    """
    change = jnp.subtract(amplitude_ratio, force_ratio)
    return stuck_part(0.5 * change, shape)


def pair_compliance(
    shear_modulus: ArrayLike,
    poisson_ratio: ArrayLike,
    other_modulus: ArrayLike | None = None,
    other_ratio: ArrayLike | None = None,
) -> Array:
    """Shear compliance of two bodies, ``(2 - nu_1)/G_1 + (2 - nu_2)/G_2``.

    Parameters
    ----------
    shear_modulus, poisson_ratio : array_like, shape (...)
        G_1 [stress] and nu_1 [1].
    other_modulus, other_ratio : array_like, shape (...), optional
        G_2 and nu_2; those of the first body if not given, infinite ``other_modulus`` if rigid.

    Returns
    -------
    Array, shape (...)
        [1 / stress]
    """
    modulus = shear_modulus if other_modulus is None else other_modulus
    ratio = poisson_ratio if other_ratio is None else other_ratio
    one = (2.0 - jnp.asarray(poisson_ratio)) / shear_modulus
    return one + (2.0 - jnp.asarray(ratio)) / modulus


def sphere_law(slip_force: ArrayLike, radius: ArrayLike, compliance: ArrayLike) -> Mindlin:
    """Law of two spheres in contact: force over shift along any path.

    Parameters
    ----------
    slip_force : array_like, scalar
        mu P [force].
    radius : array_like, scalar
        Radius a of the contact [length].
    compliance : array_like, scalar
        `pair_compliance` of the two bodies [1 / stress].

    Returns
    -------
    Mindlin
        with the stiffness ``8 a/compliance`` and the shift ``3 mu P compliance/(16 a)`` at slip.

    Notes
    -----
    Mindlin 1949; Johnson 1985, eq. 7.42-7.43.
    """
    return Mindlin(as_leaf(slip_force), as_leaf(8.0 * jnp.asarray(radius) / compliance))


def mindlin_energy(
    force: ArrayLike, slip_force: ArrayLike, radius: ArrayLike, compliance: ArrayLike
) -> Array:
    r"""Energy that two spheres dissipate per cycle of shear.

    With x = Q/(mu P), of Mindlin and Deresiewicz:

        D = 9 (mu P)^2 C/(10 a) (1 - (1 - x)^(5/3) - (5/6) x (1 + (1 - x)^(2/3))).

    Parameters
    ----------
    force : array_like, shape (...)
        Amplitude Q of the shear force [force], up to gross slip.
    slip_force : array_like, shape (...)
        mu P [force].
    radius : array_like, shape (...)
        Radius a of the contact [length].
    compliance : array_like, shape (...)
        `pair_compliance` C [1 / stress].

    Returns
    -------
    Array, shape (...)
        D [force length]; `goodman_energy` for small forces, where this form cancels.

    Raises
    ------
    InputError
        If the force exceeds gross slip.

    Notes
    -----
    Mindlin & Deresiewicz 1953; Brink 2015, eq. 2.48.  The sum 1 + (1 - x)^(2/3) has a plus: with a
    minus the energy would not fall to Goodman's cube.
    """
    x = jnp.abs(jnp.asarray(force)) / slip_force
    stuck = stuck_part(x, "sphere")  # cube root of 1 - x
    scale = 0.9 * jnp.square(slip_force) * compliance / radius
    return scale * (1.0 - stuck**5 - 5.0 / 6.0 * x * (1.0 + stuck**2))


def goodman_energy(
    force: ArrayLike, slip_force: ArrayLike, radius: ArrayLike, compliance: ArrayLike
) -> Array:
    """Energy per cycle of two spheres at small forces, ``D = C Q^3/(36 a mu P)``.

    Parameters
    ----------
    force, slip_force, radius, compliance : array_like, shape (...)
        As for `mindlin_energy`.

    Returns
    -------
    Array, shape (...)
        D [force length].

    Notes
    -----
    Goodman 1959; Brink 2015, eq. 2.49 and 3.1.
    """
    return jnp.asarray(compliance) * jnp.power(force, 3) / (36.0 * radius * slip_force)

"""Exact references: the bar on a frictional foundation, Masing loops, and the stuck strip.

Every function is pure, built on `jax.numpy`, and can be differentiated and vmapped. Units are any
consistent set; a strip has unit width, so end forces are per width. A strip of height ``2 H`` lies
on X in [0, length], is held at X = 0 and is loaded by the end force at X = length, positive when
it pulls.

References
----------
Brink, A. R. (2015). Modeling complex contact phenomena with nonlinear beamshells. Dissertation,
    The University of Akron.
Cowper, G. R. (1966). The shear coefficient in Timoshenko's beam theory. J. Appl. Mech. 33,
    335-340.
Goodman, L. E. (1959). A review of progress in analysis of interfacial slip damping. In: Structural
    Damping, ASME, 35-48.
Masing, G. (1926). Eigenspannungen und Verfestigung beim Messing. Proc. 2nd Int. Congress of
    Applied Mechanics, Zurich, 332-335.
Segalman, D. J. (2005). A four-parameter Iwan model for lap-type joints. J. Appl. Mech. 72,
    752-760.
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.mechanics.bar import bar_backbone
from jbeamshell.mechanics.homogeneous import shear_coefficient

BackbonePoints = tuple[ArrayLike, ArrayLike]
"""Force and displacement of a monotonic loading, both of shape (n,), starting at the origin."""

# Of the stuck strip: (2 E' H^3 + D) / (E' H^3), and the axial force N(length) / F at its end.
_STUCK_STRIP = {"consistent": (8 / 3, 3 / 4), "printed": (2 + 1 / 24, 1.0)}


def bar_hysteresis(
    amplitude: ArrayLike,
    axial_stiffness: ArrayLike,
    friction_per_length: ArrayLike,
    points: int = 101,
) -> tuple[Array, Array]:
    """Steady closed loop of a bar between the end forces A and -A: its backbone doubled.

    Parameters
    ----------
    amplitude : array_like, scalar
        Largest end force A [force], below gross slip: ``A <= q length``.
    axial_stiffness : array_like, scalar
        EA [force].
    friction_per_length : array_like, scalar
        q [force / length].
    points : int
        Number of samples of each of the two branches.

    Returns
    -------
    force, displacement : Array, shape (2 points - 1,)
        The closed path [force], [length], laid out as by `masing_loop`.

    Notes
    -----
    Masing 1926; Brink 2015, eq. 3.13-3.14. Masing's rule is exact for this bar.
    """
    force = jnp.linspace(0, amplitude, points)
    return masing_loop(force, bar_backbone(force, axial_stiffness, friction_per_length))


def masing_loop(force: ArrayLike, displacement: ArrayLike) -> tuple[Array, Array]:
    """Steady closed loop of a backbone u(F), ``u = u(A) - 2 u((A - F) / 2)`` when unloading.

    Parameters
    ----------
    force : array_like, shape (n,)
        Backbone force, monotonic from 0 to the amplitude A [force].
    displacement : array_like, shape (n,)
        Backbone displacement u at these forces, starting at 0 [length].

    Returns
    -------
    force, displacement : Array, shape (2 n - 1,)
        The closed path [force], [length]: ``[:n]`` unloads from A to -A, ``[n - 1:]`` reloads.

    Raises
    ------
    ValueError
        If the table is not a pair of equal one-dimensional shapes.

    Notes
    -----
    Masing 1926; Segalman 2005; Brink 2015, eq. 3.13.
    """
    unloading = [column[-1] - 2 * column for column in _table(force, displacement)]
    force, displacement = (jnp.concatenate([down, -down[1:]]) for down in unloading)
    return force, displacement


def masing_dissipation(force: ArrayLike, displacement: ArrayLike) -> Array:
    """Area of the Masing loop of a backbone u(F), ``D = 4 A u(A) - 8 int_0^A u dF``.

    Parameters
    ----------
    force : array_like, shape (n,)
        Backbone force, monotonic from 0 to the amplitude A [force]; n is odd and at least 3.
    displacement : array_like, shape (n,)
        Backbone displacement u at these forces, starting at 0 [length].

    Returns
    -------
    Array, scalar
        D per full cycle [force length].

    Raises
    ------
    ValueError
        If the table is not a pair of equal one-dimensional shapes, or n is even or below 3.

    Notes
    -----
    Masing 1926; Segalman 2005. The integral is Simpson's rule with a parabola through each pair of
    intervals: exact for quadratics on any spacing, for cubics where the two intervals are equal.
    """
    force, displacement = _table(force, displacement)
    if force.size < 3 or force.size % 2 == 0:
        raise ValueError(f"a backbone needs an odd number of points, at least 3, not {force.size}")
    step = jnp.diff(force)
    left, right = step[::2], step[1::2]
    start, middle, end = displacement[:-2:2], displacement[1::2], displacement[2::2]
    parabola = (
        (2 - right / left) * start
        + (left + right) ** 2 / (left * right) * middle
        + (2 - left / right) * end
    )
    integral = jnp.sum((left + right) / 6 * parabola)
    return 4 * force[-1] * displacement[-1] - 8 * integral


def masing_pull_push(pull: BackbonePoints, push: BackbonePoints) -> Array:
    """Mean of the two Masing dissipations of a joint, ``D = (D_pull + D_push) / 2``.

    A pull and a push differ where the strip has height: they change the normal reaction, and with
    it the friction, in opposite ways.

    Parameters
    ----------
    pull : tuple of array_like, each of shape (n,)
        Force and displacement of the monotonic pull, as in `masing_dissipation`.
    push : tuple of array_like, each of shape (m,)
        The same of the push; both columns negative, or both as magnitudes.

    Returns
    -------
    Array, scalar
        D per full cycle [force length].

    Notes
    -----
    Exact when pull and push coincide and Masing's rule (Masing 1926) holds; otherwise an estimate.
    """
    return (masing_dissipation(*pull) + masing_dissipation(*push)) / 2


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


def gross_slip_force(friction: ArrayLike, mean_pressure: ArrayLike, length: ArrayLike) -> Array:
    """End force at which the whole contact slides, ``F = mu p L``.

    Parameters
    ----------
    friction : array_like, shape (...)
        Friction coefficient mu [1].
    mean_pressure : array_like, shape (...)
        Mean p of the pressure on the contact [stress].
    length : array_like, shape (...)
        L [length].

    Returns
    -------
    Array, shape (...)
        F per width [force / length].

    Notes
    -----
    Global balance under Coulomb friction; Brink 2015, eq. 3.12 with the whole length slipping.
    """
    return jnp.multiply(friction, mean_pressure) * length


def _stuck_stiffness(
    half_height: ArrayLike, youngs_plane_strain: ArrayLike, bending_stiffness: ArrayLike | None
) -> Array:
    """Stiffness against beta' of a stuck strip, ``2 E' H^3 + D``: stretching and bending."""
    stretching = 2 * jnp.power(half_height, 3) * youngs_plane_strain
    return stretching + (stretching / 3 if bending_stiffness is None else bending_stiffness)


def _table(force: ArrayLike, displacement: ArrayLike) -> tuple[Array, Array]:
    """Return the two columns of a backbone as arrays, refusing shapes that would broadcast."""
    force, displacement = jnp.asarray(force), jnp.asarray(displacement)
    if force.ndim != 1 or force.shape != displacement.shape:
        raise ValueError(
            f"a backbone is two columns of equal length, not {force.shape}, {displacement.shape}"
        )
    return force, displacement

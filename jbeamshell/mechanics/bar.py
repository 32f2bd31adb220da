"""Bar on a frictional foundation, in closed form (Goodman 1959).

A bar of axial stiffness EA lies on X in [0, L], is held at X = 0 and is pulled at X = L by F.
Friction of at most q per length resists, and EA v'' = sign(F) q where it slips:

    s = abs(F)/q,   u = F abs(F)/(2 EA q),   D = (2/3) A^3/(EA q)

are the slip length, the end displacement and the energy dissipated in a cycle between A and -A.

References
----------
Brink, A. R. (2015). Modeling complex contact phenomena with nonlinear beamshells. Dissertation,
    The University of Akron.
Goodman, L. E. (1959). A review of progress in analysis of interfacial slip damping. In: Structural
    Damping, ASME, 35-48.
"""

from typing import Any

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.numbers_of import numbers_of


def bar_backbone(
    force: ArrayLike, axial_stiffness: ArrayLike, friction_per_length: ArrayLike
) -> Array:
    """End displacement of the first loading of a bar, ``u = F |F| / (2 EA q)``.

    Parameters
    ----------
    force : array_like, shape (...)
        End force F [force], below gross slip: ``|F| <= q length``.
    axial_stiffness : array_like, shape (...)
        Axial stiffness EA [force]; ``2 H E'`` for a strip in plane strain.
    friction_per_length : array_like, shape (...)
        Friction force q [force / length]: friction coefficient times pressure.

    Returns
    -------
    Array, shape (...)
        End displacement u [length].

    Notes
    -----
    Goodman 1959; Brink 2015, eq. 3.11 with the slip length of eq. 3.12.
    """
    return jnp.abs(force) * force / axial_stiffness / friction_per_length / 2


def bar_force(displacement: Any, axial_stiffness: ArrayLike, friction_per_length: ArrayLike) -> Any:
    """End force of the first loading of a bar, ``F = sqrt(2 EA q u)``, for ``u >= 0``.

    Inverse of `bar_backbone`, for numbers and arrays of NumPy or of JAX.

    Parameters
    ----------
    displacement : array_like, shape (...)
        End displacement ``u >= 0`` [length], below gross slip.
    axial_stiffness : array_like, shape (...)
        Axial stiffness EA [force].
    friction_per_length : array_like, shape (...)
        Friction force q [force / length].

    Returns
    -------
    array_like, shape (...)
        End force F [force].
    """
    return (2.0 * axial_stiffness * friction_per_length * displacement) ** 0.5


def bar_slip_length(force: ArrayLike, friction_per_length: ArrayLike) -> Array:
    """Length of the slip zone at the loaded end of a bar, ``s = |F| / q``.

    Parameters
    ----------
    force : array_like, shape (...)
        End force F of a first loading [force].
    friction_per_length : array_like, shape (...)
        Friction force q [force / length].

    Returns
    -------
    Array, shape (...)
        Slip length s [length].

    Notes
    -----
    Goodman 1959; Brink 2015, eq. 3.12.
    """
    return jnp.abs(force) / friction_per_length


def bar_slip_profile(
    x: ArrayLike,
    force: ArrayLike,
    length: ArrayLike,
    axial_stiffness: ArrayLike,
    friction_per_length: ArrayLike,
) -> Array:
    """Displacement of a bar, ``v(X) = sign(F) q max(X - (length - s), 0)^2 / (2 EA)``.

    Parameters
    ----------
    x : array_like, shape (...)
        Positions X in [0, length] [length].
    force : array_like, shape (...)
        End force F of a first loading [force], below gross slip: ``|F| <= q length``.
    length : array_like, shape (...)
        Length of the bar [length].
    axial_stiffness : array_like, shape (...)
        Axial stiffness EA [force].
    friction_per_length : array_like, shape (...)
        Friction force q [force / length].

    Returns
    -------
    Array, shape (...)
        Displacement v(X) [length], zero outside the slip zone of length ``s = |F| / q``.

    Notes
    -----
    The solution of ``EA v'' = sign(F) q`` in the slip zone, with ``v = v' = 0`` at its inner end.
    Goodman 1959; Brink 2015, eq. 3.11 with the slip length of eq. 3.12.
    """
    slip_length = bar_slip_length(force, friction_per_length)
    depth = jnp.maximum(jnp.asarray(x) - length + slip_length, 0)
    return jnp.sign(force) * friction_per_length * depth**2 / axial_stiffness / 2


def cubic_law(
    amplitude: ArrayLike, axial_stiffness: ArrayLike, friction_per_length: ArrayLike
) -> Array:
    """Energy a bar dissipates per full cycle, ``D = (2/3) A^3 / (EA q)``.

    Parameters
    ----------
    amplitude : array_like, shape (...)
        Largest end force ``A >= 0`` [force], below gross slip: ``A <= q length``.
    axial_stiffness : array_like, shape (...)
        Axial stiffness EA [force].
    friction_per_length : array_like, shape (...)
        Friction force q [force / length].

    Returns
    -------
    Array, shape (...)
        Dissipated energy D [force length].

    Notes
    -----
    Goodman 1959.
    """
    cubed = numbers_of(amplitude).power(amplitude, 3)
    return 2 / 3 * cubed / axial_stiffness / friction_per_length


def lap_backbone(
    force: ArrayLike,
    upper: ArrayLike,
    lower: ArrayLike,
    length: ArrayLike,
    friction_per_length: ArrayLike,
) -> Array:
    """End displacement of the first loading of two bars that lap over a length L.

    The upper bar is pulled at X = L and the lower one held at X = 0.  Slip starts at both ends; the
    zones, F k_2/((k_1 + k_2) q) and F k_1/((k_1 + k_2) q) long, meet at gross slip, F = q L:

        u = F L/(k_1 + k_2) + F |F| (k_1^3 + k_2^3)/(2 q k_1 k_2 (k_1 + k_2)^2).

    Parameters
    ----------
    force : array_like, shape (...)
        End force F [force], below gross slip.
    upper, lower : array_like, shape (...)
        Axial stiffnesses k_1 and k_2 [force].
    length : array_like, shape (...)
        Length L of the overlap [length].
    friction_per_length : array_like, shape (...)
        Friction force q [force / length].

    Returns
    -------
    Array, shape (...)
        End displacement u [length].

    Notes
    -----
    The lap joint of Metherell, A. F. and Diller, S. V. (1968). Instantaneous energy dissipation
    rate in a lap joint: uniform clamping pressure. Journal of Applied Mechanics 35, 123-128.
    """
    stretch = jnp.asarray(force) * length / (upper + lower)
    return stretch + bar_backbone(force, _in_series(upper, lower), friction_per_length)


def lap_cubic_law(
    amplitude: ArrayLike, upper: ArrayLike, lower: ArrayLike, friction_per_length: ArrayLike
) -> Array:
    """Energy that two bars which lap dissipate per full cycle; see `lap_backbone`.

    Parameters
    ----------
    amplitude : array_like, shape (...)
        Largest end force ``A >= 0`` [force], below gross slip.
    upper, lower : array_like, shape (...)
        Axial stiffnesses k_1 and k_2 [force].
    friction_per_length : array_like, shape (...)
        Friction force q [force / length].

    Returns
    -------
    Array, shape (...)
        Dissipated energy ``D = (2/3) A^3 (k_1^3 + k_2^3)/(q k_1 k_2 (k_1 + k_2)^2)``.

    Notes
    -----
    Metherell & Diller 1968, as in `lap_backbone`.
    """
    return cubic_law(amplitude, _in_series(upper, lower), friction_per_length)


def _in_series(upper: ArrayLike, lower: ArrayLike) -> Array:
    """Stiffness of one bar that slips as much as two that lap."""
    k_1, k_2 = (numbers_of(k).asarray(k) for k in (upper, lower))
    return k_1 * k_2 * (k_1 + k_2) ** 2 / (k_1**3 + k_2**3)

"""Masing's rule: steady loops and their dissipation from a backbone u(F).

A branch of the loop is the backbone, doubled and turned: u = u(A) - 2 u((A - F)/2) when unloading
from the amplitude A.  Functions are pure, built on `jax.numpy`, and can be differentiated and
vmapped.

References
----------
Brink, A. R. (2015). Modeling complex contact phenomena with nonlinear beamshells. Dissertation,
    The University of Akron.
Masing, G. (1926). Eigenspannungen und Verfestigung beim Messing. Proc. 2nd Int. Congress of
    Applied Mechanics, Zurich, 332-335.
Segalman, D. J. (2005). A four-parameter Iwan model for lap-type joints. J. Appl. Mech. 72,
    752-760.
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.mechanics.bar import bar_backbone


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


def _table(force: ArrayLike, displacement: ArrayLike) -> tuple[Array, Array]:
    """Return the two columns of a backbone as arrays, refusing shapes that would broadcast."""
    force, displacement = jnp.asarray(force), jnp.asarray(displacement)
    if force.ndim != 1 or force.shape != displacement.shape:
        raise ValueError(
            f"a backbone is two columns of equal length, not {force.shape}, {displacement.shape}"
        )
    return force, displacement

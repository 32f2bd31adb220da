"""Bimetal strip: two layers that bend under a uniform squeeze.

References
----------
Brink, A. R. (2015). Modeling complex contact phenomena with nonlinear beamshells. Dissertation,
    The University of Akron.
Timoshenko, S. (1925). Analysis of bi-metal thermostats. J. Opt. Soc. Am. 11, 233-255.
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike


def bimetal_curvature(
    pressure: ArrayLike,
    height: ArrayLike,
    youngs_bottom: ArrayLike,
    youngs_top: ArrayLike,
    poisson_ratio: ArrayLike,
    plane: str = "strain",
) -> Array:
    """Curvature of a squeezed two-layer strip, ``k = 24 (e_b - e_t) / (h (14 + n + 1/n))``.

    Here ``n = E_top / E_bottom``, and e_b and e_t are what the layers would stretch on their own:
    ``nu p / E`` in plane stress, ``nu (1 + nu) p / E`` in plane strain.

    Parameters
    ----------
    pressure : array_like, shape (...)
        p on both faces [stress].
    height : array_like, shape (...)
        h of the two equally thick layers together [length].
    youngs_bottom, youngs_top : array_like, shape (...)
        Young's moduli E [stress].
    poisson_ratio : array_like, shape (...)
        nu of both layers [1].
    plane : {'strain', 'stress'}
        Plane strain or plane stress.

    Returns
    -------
    Array, shape (...)
        k [1 / length], positive if the strip bends up: towards a stiffer top.

    Raises
    ------
    ValueError
        If `plane` is not one of the choices.

    Notes
    -----
    Timoshenko 1925, with the squeezed layers' stretch in the place of the thermal one. The
    strip of Brink 2015, section 4.7.1.
    """
    if plane not in ("strain", "stress"):
        raise ValueError(f"plane must be 'strain' or 'stress', not {plane!r}")
    nu = jnp.asarray(poisson_ratio)
    stretch = jnp.asarray(pressure) * (nu * (1 + nu) if plane == "strain" else nu)
    ratio = jnp.divide(youngs_top, youngs_bottom)
    mismatch = stretch / youngs_bottom - stretch / youngs_top
    return 24 * mismatch / height / (14 + ratio + 1 / ratio)


def tip_deflection(curvature: ArrayLike, length: ArrayLike) -> Array:
    """Deflection of the free end of an evenly bent cantilever, ``k L^2 / 2``.

    Parameters
    ----------
    curvature : array_like, shape (...)
        k [1 / length].
    length : array_like, shape (...)
        L [length].

    Returns
    -------
    Array, shape (...)
        [length]; the slope there is ``k L``.
    """
    return jnp.asarray(curvature) * jnp.square(length) / 2

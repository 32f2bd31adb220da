"""Filon's exact plane elasticity of a squeezed strip.

A strip of height 2 H is pressed on both faces.  Distances along it are counted as t = (x - a)/H
from the edge x = a of the load, and wavenumbers as m = alpha H.  The load is positive where it
compresses; results are -sigma_y over the pressure p.  Functions are pure, built on `jax.numpy`, and
can be differentiated and vmapped.

References
----------
Filon, L. N. G. (1903). On an approximate solution for the bending of a beam of rectangular
    cross-section under any system of load. Phil. Trans. R. Soc. A 201, 63-155.
"""

import functools

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

FAR_WAVENUMBER = 45.0  # exp(-m) is below the rounding of 1 from here on
_FAR_DISTANCE = 18.0  # a step response is constant to rounding from here on


def filon_average(wavenumber: ArrayLike) -> Array:
    """Mean of -sigma_y / p under ``p cos(alpha x)``, ``4 sinh^2 m / (m (sinh 2m + 2m))``.

    Parameters
    ----------
    wavenumber : array_like, shape (...)
        ``m = alpha H`` of the pressure on both faces [1].

    Returns
    -------
    Array, shape (...)
        Amplitude of the mean through the height [1]: ``1 - m^4 / 45`` for long waves, ``2 / m``
        for short ones.

    Notes
    -----
    Filon 1903. There is no m^2 term, so the psi model cannot follow it at long waves.
    """
    m = jnp.abs(wavenumber)
    return 2 * _mean_decay(2 * m) ** 2 / (_mean_decay(4 * m) + jnp.exp(-2 * m))


def filon_midplane(wavenumber: ArrayLike) -> Array:
    """Mid-plane -sigma_y / p under ``p cos(alpha x)``, ``2 (sinh m + m cosh m)/(sinh 2m + 2m)``.

    Parameters
    ----------
    wavenumber : array_like, shape (...)
        ``m = alpha H`` of the pressure on both faces [1].

    Returns
    -------
    Array, shape (...)
        Amplitude at mid-height [1]: ``1 - m^4 / 24`` for long waves, ``2 m exp(-m)`` for short
        ones.

    Notes
    -----
    Filon 1903. The mid-plane carries no shear, so this is also the reaction of a rigid
    frictionless base that the strip's upper half, of height H, is bonded to.
    """
    m = jnp.abs(wavenumber)
    twice = jnp.exp(-2 * m)
    return jnp.exp(-m) * (2 * _mean_decay(2 * m) + 1 + twice) / (2 * (_mean_decay(4 * m) + twice))


def filon_average_step(distance: ArrayLike) -> Array:
    """Mean of -sigma_y / p at a load edge, ``1/2 - (1/pi) int_0^inf T(m) sin(m t) / m dm``.

    T is `filon_average`. The pressure p acts on both faces of an infinite strip where t < 0.

    Parameters
    ----------
    distance : array_like, shape (...)
        ``t = (x - a) / H`` from the edge of the load [1].

    Returns
    -------
    Array, shape (...)
        From 1 under the load through 1/2 at its edge to 0; negative (tension) from t = 0.85.

    Notes
    -----
    Filon 1903. The slope at t = 0 is infinite, like ``log |t|``; there autodiff returns a large
    finite number. In double precision the quadrature is exact to 1e-14.
    """
    t = _near(distance)
    m, weights = _half_line(t)
    # 2 (1 - exp(-2 m)) / m has the tail of T, and a sine transform in closed form
    smooth = filon_average(m) - 4 * _mean_decay(2 * m)
    tiny = jnp.finfo(t.dtype).tiny
    logarithm = jnp.log(t**2 + 4) - jnp.log(jnp.maximum(t**2, tiny))
    tail = t * logarithm + 4 * jnp.arctan(t / 2)
    return 0.5 - (_sine_transform(t, smooth * weights) + tail) / jnp.pi


def filon_midplane_step(distance: ArrayLike) -> Array:
    """Mid-plane -sigma_y / p at a load edge, ``1/2 - (1/pi) int_0^inf T(m) sin(m t) / m dm``.

    T is `filon_midplane`. The pressure p acts on both faces of an infinite strip where t < 0.

    Parameters
    ----------
    distance : array_like, shape (...)
        ``t = (x - a) / H`` from the edge of the load [1].

    Returns
    -------
    Array, shape (...)
        From 1 under the load through 1/2 at its edge to 0; negative (tension) from t = 0.90.

    Notes
    -----
    Filon 1903. In double precision the quadrature is exact to 1e-14.
    """
    t = _near(distance)
    m, weights = _half_line(t)
    return 0.5 - _sine_transform(t, filon_midplane(m) * weights) / jnp.pi


def _mean_decay(x: Array) -> Array:
    """``(1 - exp(-x)) / x`` for x >= 0, with the derivatives it has at 0."""
    small = x < 0.1
    near, far = jnp.where(small, x, 0), jnp.where(small, 1, x)
    series = jnp.zeros_like(near)
    for k in range(10, 0, -1):
        series = (1 - series) * near / (k + 1)
    return jnp.where(small, 1 - series, -jnp.expm1(-far) / far)


def _near(distance: ArrayLike) -> Array:
    """Distances as floats, clipped to the range in which a step response changes."""
    t = jnp.asarray(distance)
    return jnp.clip(t.astype(jnp.result_type(t, float)), -_FAR_DISTANCE, _FAR_DISTANCE)


@functools.cache
def gauss_legendre(end: float) -> tuple[np.ndarray, np.ndarray]:
    """Gauss nodes and weights on [0, end], in panels: 512 nodes of NumPy in one lose digits."""
    panels = 16
    nodes, weights = np.polynomial.legendre.leggauss(32)
    width = end / panels
    starts = width * np.arange(panels)[:, None]
    return (starts + width * (nodes + 1) / 2).ravel(), np.tile(weights * width / 2, panels)


def _half_line(like: Array) -> tuple[Array, Array]:
    """Wavenumbers and weights to integrate a decay as exp(-m), in the precision of ``like``."""
    m, weights = gauss_legendre(FAR_WAVENUMBER)
    return jnp.asarray(m, like.dtype), jnp.asarray(weights, like.dtype)


def _sine_transform(t: Array, weighted: Array) -> Array:
    """``int_0^inf f(m) sin(m t) / m dm`` of the weighted samples of f."""
    m, _ = _half_line(t)
    return jnp.sum(jnp.sin(t[..., None] * m) * (weighted / m), axis=-1)

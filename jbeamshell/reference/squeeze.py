"""Squeeze strain psi of the beamshell beside exact elasticity: decay length, load edge, kappa_s.

The psi model is the shell with one squeeze strain per section (Brink 2015, chapter IV), in plane
strain and with free ends, so that N = 0.  Its balance xi' - chi + 2 H p = 0 makes psi decay from a
load edge over the length lambda, which the squeeze-shear factor kappa_s decides.  Distances along
the strip are t = (x - a)/H from the edge of the load, wavenumbers m = alpha H.

References
----------
Brink, A. R. (2015). Modeling complex contact phenomena with nonlinear beamshells. Dissertation,
    The University of Akron.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from scipy.optimize import brentq

from jbeamshell.reference.filon import filon_average, gauss_legendre


def squeeze_decay_length(
    half_height: ArrayLike, kappa_s: ArrayLike, poisson_ratio: ArrayLike
) -> Array:
    """Decay length of the psi model, ``lambda = H sqrt(kappa_s (1 - nu) / 6)``.

    Parameters
    ----------
    half_height : array_like, shape (...)
        H [length].
    kappa_s : array_like, shape (...)
        Squeeze-shear factor [1].
    poisson_ratio : array_like, shape (...)
        nu [1].

    Returns
    -------
    Array, shape (...)
        lambda [length], in plane strain.

    Notes
    -----
    ``lambda^2 = S / (2 H E')`` with ``S = (2/3) kappa_s G H^3`` and ``G = E' (1 - nu) / 2``.
    Brink 2015, chapter IV, with the shear strain ``s psi'``.
    """
    ratio = jnp.sqrt(jnp.multiply(kappa_s, 1 - jnp.asarray(poisson_ratio)) / 6)
    return jnp.asarray(half_height) * ratio


def squeeze_step(distance: ArrayLike, decay_ratio: ArrayLike) -> Array:
    """Mean of -sigma_y / p at a load edge, ``exp(-t H / lambda) / 2`` for t > 0, psi model.

    Parameters
    ----------
    distance : array_like, shape (...)
        ``t = (x - a) / H`` from the edge of the load [1].
    decay_ratio : array_like, shape (...)
        ``lambda / H``, from `squeeze_decay_length` [1].

    Returns
    -------
    Array, shape (...)
        ``1 - exp(t H / lambda) / 2`` under the load; never negative, unlike `filon_average_step`.

    Notes
    -----
    Brink 2015, chapter IV.
    """
    t = jnp.asarray(distance)
    outside = t >= 0
    return jnp.where(
        outside,
        0.5 * jnp.exp(-jnp.where(outside, t, 0) / decay_ratio),
        1 - 0.5 * jnp.exp(jnp.where(outside, 0, t) / decay_ratio),
    )


def best_decay_ratio(match: str = "step") -> float:
    """Find lambda / H of the psi model that comes nearest to elasticity at a load edge.

    Parameters
    ----------
    match : {'step', 'shear'}
        'step' minimises the squared error of the mean sigma_y, integrated along the strip:
        ``int T(m) / (1 + (lambda m / H)^2)^2 dm = (3 pi / 16) H / lambda``, T of `filon_average`.
        'shear' meets the peak of ``xi = int s tau ds``, which lies at the load edge:
        ``lambda / H = (2 / pi) int (1 - T(m)) / m^2 dm``.

    Returns
    -------
    float
        lambda / H [1]: 0.2268 for 'step', 0.1920 for 'shear'.

    Raises
    ------
    ValueError
        If `match` is not one of the choices.

    Notes
    -----
    The first follows from Parseval's theorem for `filon_average_step` less `squeeze_step`. For the
    second, ``xi = 2 H^2 p int_0^inf f(t) dt`` at the load edge, with f either step response.
    """
    with jax.ensure_compile_time_eval():
        angle, weights = gauss_legendre(np.pi / 2)
        if match == "step":
            weights = weights * np.cos(angle) ** 2

            def slope(ratio: float) -> float:
                average = filon_average(np.tan(angle) / ratio)  # the substitution m = tan / ratio
                return float(jnp.sum(average * weights)) - 3 * np.pi / 16

            return brentq(slope, 0.05, 1.0)
        if match == "shear":
            missing = 1 - filon_average(np.tan(angle))
            return 2 / np.pi * float(jnp.sum(missing / np.sin(angle) ** 2 * weights))
    raise ValueError(f"match must be 'step' or 'shear', not {match!r}")


def best_kappa_s(poisson_ratio: ArrayLike, match: str = "step") -> Array:
    """Squeeze-shear factor nearest to elasticity, ``6 (lambda / H)^2 / (1 - nu)``.

    Parameters
    ----------
    poisson_ratio : array_like, shape (...)
        nu [1].
    match : {'step', 'shear'}
        As in `best_decay_ratio`.

    Returns
    -------
    Array, shape (...)
        kappa_s [1]: ``0.309 / (1 - nu)`` for 'step' and ``0.221 / (1 - nu)`` for 'shear', in
        plane strain.

    Raises
    ------
    ValueError
        If `match` is not one of the choices.
    """
    return 6.0 * best_decay_ratio(match) ** 2 / (1.0 - jnp.asarray(poisson_ratio))


def reaction_jump(
    pressure_jump: ArrayLike, kappa_s: ArrayLike, shear_coefficient: ArrayLike
) -> Array:
    """Jump of the reaction where the pressure jumps, ``[p] (kappa_s-3 kappa)/(kappa_s+3 kappa)``.

    Parameters
    ----------
    pressure_jump : array_like, shape (...)
        Jump [p] of the pressure on the top face of the psi model, in contact below [stress].
    kappa_s : array_like, shape (...)
        Squeeze-shear factor [1].
    shear_coefficient : array_like, shape (...)
        kappa [1].

    Returns
    -------
    Array, shape (...)
        [R] [stress], the wrong way if ``kappa_s < 3 kappa``; zero would be right, because the
        reaction of elasticity is smooth.

    Notes
    -----
    Where p jumps, psi, psi', beta and beta' do not: ``(S + 2 kappa G H^3) [psi''] = 2 H [p]`` and
    ``[R] = [p] - 2 kappa G H^2 [psi'']`` with ``S = (2/3) kappa_s G H^3``.
    """
    three_kappa = 3 * jnp.asarray(shear_coefficient)
    share = (kappa_s - three_kappa) / (kappa_s + three_kappa)
    return jnp.asarray(pressure_jump) * share

"""Exact plane elasticity of squeezed strips and of receding contact, beside the psi model's answer.

Every function is pure, built on `jax.numpy`, and can be differentiated and vmapped. Units are any
consistent set, and forces are per unit width. A squeezed strip has the height ``2 H``; distances
along it are counted as ``t = (x - a) / H`` and wavenumbers as ``m = alpha H``. Pressures and forces
that compress are positive, stresses that pull are positive, psi > 0 thickens. A strip in
receding contact has the height h and is pressed onto its base by one force.

The psi model is the shell with one squeeze strain psi per section (Brink 2015, chapter IV), in
plane strain and with free ends, so that N = 0.

References
----------
Brink, A. R. (2015). Modeling complex contact phenomena with nonlinear beamshells. Dissertation,
    The University of Akron.
Coker, E. G. & Filon, L. N. G. (1931). A Treatise on Photo-Elasticity. Cambridge University Press.
Filon, L. N. G. (1903). On an approximate solution for the bending of a beam of rectangular
    cross-section under any system of load. Phil. Trans. R. Soc. A 201, 63-155.
Gladwell, G. M. L. (1976). On some unbonded contact problems in plane elasticity theory. J. Appl.
    Mech. 43, 263-267.
Timoshenko, S. (1925). Analysis of bi-metal thermostats. J. Opt. Soc. Am. 11, 233-255.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from scipy.optimize import brentq

# Past either, what is left of an exponential decay is below the rounding of 1.
_FAR_WAVENUMBER, _FAR_DISTANCE = 45.0, 18.0

_BEAM_CONTACT = {"printed": 1.845, "recomputed": 1.22452}
_STRIP_CONTACT = {"quoted": 1.35, "rigid": 0.85699, "elastic": 1.32417}


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


def squeeze_symbol(wavenumber: ArrayLike, decay_ratio: ArrayLike) -> Array:
    """Mean of -sigma_y / p under ``p cos(alpha x)``, ``1 / (1 + lambda^2 alpha^2)``, psi model.

    Parameters
    ----------
    wavenumber : array_like, shape (...)
        ``m = alpha H`` of the pressure on both faces [1].
    decay_ratio : array_like, shape (...)
        ``lambda / H``, from `squeeze_decay_length` [1].

    Returns
    -------
    Array, shape (...)
        Amplitude of ``chi / (2 H p)`` [1].

    Notes
    -----
    From ``xi' - chi + 2 H p_z = 0`` with ``xi = (2/3) kappa_s G H^3 psi'`` and
    ``chi = 2 H E' psi`` at N = 0. Brink 2015, chapter IV.
    """
    return 1 / (1 + jnp.square(jnp.multiply(wavenumber, decay_ratio)))


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


def squeeze_kappa_s(
    decay_length: ArrayLike, half_height: ArrayLike, poisson_ratio: ArrayLike
) -> Array:
    """Squeeze-shear factor of a decay length, ``kappa_s = 6 (lambda / H)^2 / (1 - nu)``.

    Parameters
    ----------
    decay_length : array_like, shape (...)
        lambda [length].
    half_height : array_like, shape (...)
        H [length].
    poisson_ratio : array_like, shape (...)
        nu [1].

    Returns
    -------
    Array, shape (...)
        kappa_s [1]: the inverse of `squeeze_decay_length`.
    """
    return 6 * jnp.square(jnp.divide(decay_length, half_height)) / (1 - jnp.asarray(poisson_ratio))


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
        angle, weights = _gauss_legendre(np.pi / 2)
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
    return squeeze_kappa_s(best_decay_ratio(match), 1.0, poisson_ratio)


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


def beam_contact_length(
    height: ArrayLike,
    youngs_beam: ArrayLike,
    poisson_beam: ArrayLike,
    youngs_base: ArrayLike,
    poisson_base: ArrayLike,
    coefficient: str = "recomputed",
) -> Array:
    """Contact of a point-loaded beam with a half-plane, ``c = C h (E1' / E2')^(1/3)``.

    Parameters
    ----------
    height : array_like, shape (...)
        h of the weightless beam that the base cannot pull on [length].
    youngs_beam, poisson_beam : array_like, shape (...)
        E1 [stress] and nu1 [1]; ``E1' = E1 / (1 - nu1^2)``.
    youngs_base, poisson_base : array_like, shape (...)
        E2 [stress] and nu2 [1] of the half-plane.
    coefficient : {'recomputed', 'printed'}
        'recomputed' takes ``C = 1.22452``, 'printed' takes ``C = 1.845``.

    Returns
    -------
    Array, shape (...)
        c [length] from the load to the end of contact, whatever the load.

    Raises
    ------
    ValueError
        If `coefficient` is not one of the choices.

    Notes
    -----
    1.845 is how Brink 2015, eq. 2.50, quotes Gladwell 1976. It does not come back from the problem
    as it is told there: an Euler-Bernoulli beam, ``E1' h^3 w'''' / 12 = P delta(x) - R``, smooth on
    a half-plane of ``u' = -(2 / (pi E2')) pv int R(y) / (x - y) dy``. Two methods give 1.2245: the
    singular integral equation for R, with square roots at both ends, in Gauss-Chebyshev
    quadrature, whose C settles at 1.22452, and unilateral contact of small elements.
    """
    if coefficient not in _BEAM_CONTACT:
        raise ValueError(f"coefficient must be one of {sorted(_BEAM_CONTACT)}, not {coefficient!r}")
    beam = jnp.divide(youngs_beam, 1 - jnp.square(poisson_beam))
    base = jnp.divide(youngs_base, 1 - jnp.square(poisson_base))
    return _BEAM_CONTACT[coefficient] * jnp.asarray(height) * jnp.cbrt(beam / base)


def strip_contact_length(height: ArrayLike, case: str = "rigid") -> Array:
    """Contact of a point-loaded strip with its base, ``c = C h``.

    Parameters
    ----------
    height : array_like, shape (...)
        h of the weightless strip [length].
    case : {'rigid', 'elastic', 'bilateral', 'quoted'}
        'rigid': on a rigid frictionless base that cannot pull, ``C = 0.85699``.
        'elastic': on a frictionless half-plane of the same E' that cannot pull,
        ``C = 1.32417``.
        'bilateral': where the reaction of a rigid base that can pull changes sign; C is computed
        from `filon_midplane`, 1.338.
        'quoted': ``C = 1.35``.

    Returns
    -------
    Array, shape (...)
        c [length] from the load to the end of contact, whatever the load.

    Raises
    ------
    ValueError
        If `case` is not one of the choices.

    Notes
    -----
    1.35 is from Coker & Filon 1931; Brink 2015, section 2.4, quotes it as the contact on an elastic
    foundation. It is Filon's (1903) bilateral value: on the mid-plane of a strip of height 2 h that
    two opposite forces P squeeze, ``-sigma_y = P / (pi h) int_0^inf T(m) cos(m x / h) dm``.
    0.85699 and 1.32417 were computed for this library by the methods that `beam_contact_length`
    names, with Filon's strip in the place of the beam.
    """
    if case == "bilateral":
        return _bilateral_zero() * jnp.asarray(height)
    if case not in _STRIP_CONTACT:
        raise ValueError(
            f"case must be one of {sorted([*_STRIP_CONTACT, 'bilateral'])}, not {case!r}"
        )
    return _STRIP_CONTACT[case] * jnp.asarray(height)


def _bilateral_zero() -> float:
    """Zero of Filon's mid-plane stress between two opposite forces, over half the height."""
    with jax.ensure_compile_time_eval():
        m, weights = _gauss_legendre(_FAR_WAVENUMBER)
        weighted = np.asarray(filon_midplane(m)) * weights
        return brentq(lambda t: np.cos(m * t) @ weighted, 1.0, 2.0)


def _mean_decay(x: Array) -> Array:
    """``(1 - exp(-x)) / x`` for x >= 0, with the derivatives it has at 0."""
    small = x < 0.1
    near, far = jnp.where(small, x, 0), jnp.where(small, 1, x)
    series = jnp.zeros_like(near)
    for k in range(10, 0, -1):
        series = (1 - series) * near / (k + 1)
    return jnp.where(small, 1 - series, -jnp.expm1(-far) / far)


def _near(distance: ArrayLike) -> Array:
    """Floating-point distances, held where a step response is not yet constant."""
    t = jnp.asarray(distance)
    return jnp.clip(t.astype(jnp.result_type(t, float)), -_FAR_DISTANCE, _FAR_DISTANCE)


@functools.cache
def _gauss_legendre(end: float) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on [0, end]; panels, because numpy's own weights lose digits at 512."""
    panels = 16
    nodes, weights = np.polynomial.legendre.leggauss(32)
    width = end / panels
    starts = width * np.arange(panels)[:, None]
    return (starts + width * (nodes + 1) / 2).ravel(), np.tile(weights * width / 2, panels)


def _half_line(like: Array) -> tuple[Array, Array]:
    """Wavenumbers and weights for what decays as exp(-m), in the precision of `like`."""
    m, weights = _gauss_legendre(_FAR_WAVENUMBER)
    return jnp.asarray(m, like.dtype), jnp.asarray(weights, like.dtype)


def _sine_transform(t: Array, weighted: Array) -> Array:
    """``int_0^inf f(m) sin(m t) / m dm`` of the weighted samples of f."""
    m, _ = _half_line(t)
    return jnp.sum(jnp.sin(t[..., None] * m) * (weighted / m), axis=-1)

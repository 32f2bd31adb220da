"""Receding contact: how far a beam or a strip touches its base under a point load.

The body has the height h and is weightless; the base cannot pull.  The length of contact does not
depend on the load (Gladwell 1976).

References
----------
Brink, A. R. (2015). Modeling complex contact phenomena with nonlinear beamshells. Dissertation,
    The University of Akron.
Coker, E. G. & Filon, L. N. G. (1931). A Treatise on Photo-Elasticity. Cambridge University Press.
Filon, L. N. G. (1903). On an approximate solution for the bending of a beam of rectangular
    cross-section under any system of load. Phil. Trans. R. Soc. A 201, 63-155.
Gladwell, G. M. L. (1976). On some unbonded contact problems in plane elasticity theory. J. Appl.
    Mech. 43, 263-267.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from scipy.optimize import brentq

from jbeamshell.reference.filon import FAR_WAVENUMBER, filon_midplane, gauss_legendre

_BEAM_CONTACT = {"printed": 1.845, "recomputed": 1.22452}
_STRIP_CONTACT = {"quoted": 1.35, "rigid": 0.85699, "elastic": 1.32417}


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
    Brink 2015, eq. 2.50, quotes 1.845 from Gladwell 1976. The problem as stated there does not
    give it: an Euler-Bernoulli beam, ``E1' h^3 w'''' / 12 = P delta(x) - R``, smooth on
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
        m, weights = gauss_legendre(FAR_WAVENUMBER)
        weighted = np.asarray(filon_midplane(m)) * weights
        return brentq(lambda t: np.cos(m * t) @ weighted, 1.0, 2.0)

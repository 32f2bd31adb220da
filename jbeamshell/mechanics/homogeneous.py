r"""Strain energy of a homogeneous section per unit length, Phi(e, g, k, psi, psi').

With the constants of bending and squeeze-shear made consistent (Brink 2015, eqs. 4.59-4.68),

    Phi = H C11 (e + nu' psi)^2 + H E' psi^2 + kappa G H g^2 + D k^2/2 + S psi'^2/2
    D = (2/3) E' H^3,   S = (2/3) kappa_s G H^3,   kappa = 10(1+nu)/(12+11nu)   (Cowper 1966)

with C11 = E'/(1-nu'^2).  E' = E/(1-nu^2) and nu' = nu/(1-nu) in plane strain; E' = E and nu' = nu
in plane stress.  Without a squeeze field, sigma_y = 0 gives (Brink 2015, chapter III)

    Phi = H E' e^2 + kappa G H g^2 + D k^2/2.

A strain energy is any JAX function of five scalars that returns a scalar.  Automatic
differentiation of it gives the section `forces` and the solver's tangent.

References
----------
Brink, A. R. (2015). Modeling complex contact phenomena with nonlinear beamshells. Dissertation,
    The University of Akron.
Cowper, G. R. (1966). The shear coefficient in Timoshenko's beam theory. J. Appl. Mech. 33,
    335-340.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.numbers_of import numbers_of
from jbeamshell.mechanics.kinematics import Strains

Energy = Callable[[Array, Array, Array, Array, Array], Array]

CONSTANTS = ("consistent", "printed")
PLANES = ("strain", "stress")


class Homogeneous(eqx.Module):
    """Strain energy of a homogeneous section.

    Attributes
    ----------
    half_height : half height H, length
    plane_modulus : E', stress: E/(1-nu^2) in plane strain, E in plane stress
    poisson_ratio : Poisson's ratio nu
    kappa_s : squeeze-shear factor
    squeeze : True if psi is a field; if not, sigma_y = 0
    constants : "consistent", or "printed" for those of Brink 2015: a bending stiffness of 1/16
        (eq. 3.45) and a squeeze-shear stiffness of 24 times (eq. 4.73) the consistent one
    plane : "strain" or "stress"

    Examples
    --------
    >>> section = Homogeneous(half_height=0.1, plane_modulus=1.5e5, poisson_ratio=0.3, kappa_s=0.44)
    >>> normal_force = forces(section, Strains(e=1e-3, g=0.0, k=0.0, psi=0.0, dpsi=0.0)).e
    """

    half_height: Array = eqx.field(converter=jnp.asarray)
    plane_modulus: Array = eqx.field(converter=jnp.asarray)
    poisson_ratio: Array = eqx.field(converter=jnp.asarray)
    kappa_s: Array = eqx.field(converter=jnp.asarray)
    squeeze: bool = eqx.field(static=True, default=True)
    constants: str = eqx.field(static=True, default="consistent")
    plane: str = eqx.field(static=True, default="strain")

    @property
    def shear_modulus(self) -> Array:
        """Shear modulus G = E/(2(1+nu)), stress."""
        return shear_modulus(self.plane_modulus, self.poisson_ratio, self.plane)

    @property
    def bending_stiffness(self) -> Array:
        """Bending stiffness D per unit width, force times length."""
        factor = 2.0 / 3.0 if self.constants == "consistent" else 1.0 / 24.0
        return factor * self.plane_modulus * self.half_height**3

    @property
    def squeeze_stiffness(self) -> Array:
        """Squeeze-shear stiffness S per unit width, force times length."""
        factor = 2.0 / 3.0 if self.constants == "consistent" else 16.0
        return factor * self.kappa_s * self.shear_modulus * self.half_height**3

    def __call__(self, e: Array, g: Array, k: Array, psi: Array, dpsi: Array) -> Array:
        """Strain energy Phi of one section, per unit length and width."""
        h, nu, plane = self.half_height, self.poisson_ratio, self.plane_modulus
        shear = shear_coefficient(nu) * self.shear_modulus * h * g**2
        bending = 0.5 * self.bending_stiffness * k**2
        if not self.squeeze:
            return h * plane * e**2 + shear + bending
        coupling, c11 = plane_stiffness(plane, nu, self.plane)
        squeeze = h * plane * psi**2 + 0.5 * self.squeeze_stiffness * dpsi**2
        return h * c11 * (e + coupling * psi) ** 2 + squeeze + shear + bending


def shear_modulus(plane_modulus: Any, poisson_ratio: Any, plane: str) -> Any:
    """Shear modulus G from E' and nu, stress."""
    if plane == "strain":
        return 0.5 * (1.0 - poisson_ratio) * plane_modulus
    return 0.5 * plane_modulus / (1.0 + poisson_ratio)


def youngs_modulus(plane_modulus: Any, poisson_ratio: Any, plane: str) -> Any:
    """Young's modulus E from the plane modulus E' and nu, stress; any shapes that broadcast."""
    return plane_modulus if plane == "stress" else plane_modulus * (1.0 - poisson_ratio**2)


def plane_modulus(youngs_modulus: Any, poisson_ratio: Any, plane: str) -> Any:
    """Plane modulus E' from Young's modulus E and nu, stress; inverse of `youngs_modulus`."""
    return youngs_modulus if plane == "stress" else youngs_modulus / (1.0 - poisson_ratio**2)


def plane_stiffness(plane_modulus: Array, poisson_ratio: Array, plane: str) -> tuple[Array, Array]:
    """Contraction nu' and stiffness C11 of sigma_x = C11 (eps_x + nu' eps_y), C11 a stress."""
    nu = poisson_ratio
    coupling = nu / (1.0 - nu) if plane == "strain" else nu
    return coupling, plane_modulus / (1.0 - coupling**2)


class _Plain(eqx.Module):
    """Strain energy whose functions are static parts of its pytree."""

    numbers: Any
    functions: Any = eqx.field(static=True)

    def __call__(self, e: Array, g: Array, k: Array, psi: Array, dpsi: Array) -> Array:
        energy: Energy = eqx.combine(self.numbers, self.functions)
        return energy(e, g, k, psi, dpsi)


def as_energy(energy: Any) -> Any:
    """Strain energy as a pytree of numbers; plain functions in it become static parts."""
    if not any(map(callable, jax.tree.leaves(energy))):
        return energy
    return _Plain(*eqx.partition(energy, lambda leaf: not callable(leaf)))


def forces(energy: Energy, strains: Strains) -> Strains:
    """Section forces N, Q, M, chi and xi, the derivatives of Phi.

    Parameters
    ----------
    energy : Phi(e, g, k, psi, psi')
    strains : strains of one section, scalars

    Returns
    -------
    Strains
        (N, Q, M, chi, xi) in the places of (e, g, k, psi, psi'), per unit width.
    """
    return Strains(*jax.grad(lambda s: energy(*s))(strains))


def contraction(energy: Energy, zero: Array) -> Array:
    """Contraction -de/dpsi at constant N, Phi_epsi/Phi_ee of small strains.

    Parameters
    ----------
    energy : Phi(e, g, k, psi, psi')
    zero : scalar zero, for its precision
    """
    rest = Strains(zero, zero, zero, zero, zero)
    stiffness = jax.jacfwd(lambda s: forces(energy, s).e)(rest)
    return stiffness.psi / stiffness.e


def shear_coefficient(nu: ArrayLike) -> Array:
    """Shear coefficient of a rectangular section, ``kappa = 10 (1 + nu) / (12 + 11 nu)``.

    Parameters
    ----------
    nu : array_like, shape (...)
        Poisson's ratio [1].

    Returns
    -------
    Array, shape (...)
        kappa [1], 0.85 at ``nu = 0.3``.

    Notes
    -----
    Cowper 1966; Brink 2015, eq. 3.53.
    """
    given: Array = numbers_of(nu).asarray(nu)
    return 10 * (1 + given) / (12 + 11 * given)

r"""Strain energy of a laminated section per unit length, Phi(e, g, k, psi, psi').

Layers that press on each other share the stress sigma_y, not the squeeze strain (Reuss 1929).  With
sigma_y = q uniform over the height h and psi the mean of eps_y, eliminating q gives

    Phi = A e^2/2 - B e k + D k^2/2 + (h psi + P0 e - P1 k)^2/(2 F) + shear,
    A, B, D = int Eb (1, s, s^2) ds,   P0, P1 = int nb (1, s) ds,   F = int (1 - nb^2)/Eb ds,
    q = (h psi + P0 e - P1 k)/F,   chi = h q,
    shear = int G (sqrt(kappa) g + sqrt(kappa_s) s psi')^2/2 ds,

with eps_x = e - s k, gamma = g + s psi', s from -h/2 at the bottom to h/2 at the top, and per layer
Eb = E, nb = nu in plane stress, Eb = E/(1-nu^2), nb = nu/(1-nu) in plane strain.  The shear energy
is an integral of squares, hence never negative; its coupling factor is sqrt(kappa kappa_s).

If all layers share one psi instead (Brink 2015, eqs. 4.79-4.86), eps_y = psi in every layer:

    Phi = int C11 (eps_x^2 + 2 nb eps_x psi + psi^2)/2 ds + shear,   C11 = Eb/(1 - nb^2).

Such a laminate stays straight under a uniform squeeze if all its nu are equal, whatever its
moduli, because every layer would lengthen by the same -nb psi.

References
----------
Brink, A. R. (2015). Modeling complex contact phenomena with nonlinear beamshells. Dissertation,
    The University of Akron. Section 4.7.1, eqs. 4.74-4.95.
Cowper, G. R. (1966). The shear coefficient in Timoshenko's beam theory. J. Appl. Mech. 33,
    335-340.
Reuss, A. (1929). Berechnung der Fließgrenze von Mischkristallen auf Grund der
    Plastizitätsbedingung für Einkristalle. Z. Angew. Math. Mech. 9, 49-58. (Uniform stress.)
Timoshenko, S. (1925). Analysis of bi-metal thermostats. J. Opt. Soc. Am. 11, 233-255.
"""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.errors import InputError
from jbeamshell.mechanics.homogeneous import CONSTANTS, PLANES, plane_modulus, shear_coefficient
from jbeamshell.mechanics.kinematics import Strains


class Laminate(eqx.Module):
    """Strain energy of a laminated section.

    The strains are those of the mid-height curve.

    Attributes
    ----------
    layers : (n, 3) rows from the bottom to the top: thickness (length), E (stress), nu
    kappa_s : squeeze-shear factor, positive
    plane : "strain" or "stress"
    squeeze : True if psi is a field; if not, sigma_y = q = 0
    constants : "consistent", or "printed" for one psi shared by all layers (Brink 2015, eqs.
        4.79-4.86), no coupling of g and psi' (eq. 4.80) and a squeeze-shear stiffness 24 times
        larger; without psi both are the same

    Raises
    ------
    InputError
        If `plane` or `constants` is not one of the choices.

    Examples
    --------
    >>> layers = [[1.0, 2.1e3, 0.3], [1.0, 2.1e5, 0.3]]
    >>> Laminate(layers, kappa_s=0.44, plane="stress").uniform_squeeze(50.0).k
    """

    layers: Array = eqx.field(converter=jnp.asarray)
    kappa_s: Array = eqx.field(converter=jnp.asarray)
    plane: str = eqx.field(static=True, default="strain")
    squeeze: bool = eqx.field(static=True, default=True)
    constants: str = eqx.field(static=True, default="consistent")

    def __check_init__(self) -> None:
        for name, choices in (("plane", PLANES), ("constants", CONSTANTS)):
            value = getattr(self, name)
            if value not in choices:
                fix = " or ".join(map(repr, choices))
                raise InputError(f"{name} = {value!r}: choose {fix}")

    @property
    def height(self) -> Array:
        """Height h, the sum of the thicknesses, length."""
        return self.layers[:, 0].sum()

    @property
    def stretching_stiffness(self) -> Array:
        """Stretching stiffness A = int Eb ds, force per unit width; 2 H E' for a single layer."""
        return (self.layers[:, 0] * self._in_plane[0]).sum()

    @property
    def bending_stiffness(self) -> Array:
        """Bending stiffness about the neutral line, per unit width, force times length."""
        modulus = self._in_plane[0]
        return self._integrals(modulus, self._neutral(modulus))[2]

    @property
    def mean_shear_modulus(self) -> Array:
        """Mean of the shear modulus G = E/(2(1+nu)) over the height, stress."""
        return (self.layers[:, 0] * self._shear_moduli).sum() / self.height

    @property
    def shear_coefficient(self) -> Array:
        """Shear coefficient kappa (Cowper 1966) at the mean of nu, weighted by shear stiffness."""
        weights = self.layers[:, 0] * self._shear_moduli
        return shear_coefficient((weights * self.layers[:, 2]).sum() / weights.sum())

    def __call__(self, e: Array, g: Array, k: Array, psi: Array, dpsi: Array) -> Array:
        """Strain energy Phi of one section, per unit length and width."""
        modulus, contraction = self._in_plane
        if not self.squeeze:
            mean = 0.5 * self.shear_coefficient * self.mean_shear_modulus * self.height * g**2
            return self._bending(modulus, e, k) + mean
        if self.constants == "printed":
            c11 = modulus / (1.0 - contraction**2)
            p0, p1, _ = self._integrals(c11 * contraction)
            energy = self._bending(c11, e, k) + 0.5 * self._integrals(c11)[0] * psi**2
            return energy + (p0 * e - p1 * k) * psi + self._shear(g, dpsi)
        p0, p1, _ = self._integrals(contraction)
        closure = self.height * psi + p0 * e - p1 * k
        squeeze = 0.5 * closure**2 / self._compliance
        return self._bending(modulus, e, k) + squeeze + self._shear(g, dpsi)

    def uniform_squeeze(self, pressure: ArrayLike) -> Strains:
        """Strains under the same pressure on both faces, without end force and moment.

        They solve [A, -B; -B, D] (e, k) = p (P0, -P1), with psi from q = -p.

        Parameters
        ----------
        pressure : array_like, scalar
            Pressure p, stress, positive in compression.

        Returns
        -------
        Strains
            Strains of the mid-height curve; k > 0, for a stiffer top, bends the end at X = L up.

        Notes
        -----
        The section is taken as consistent and with psi, whatever `constants` and `squeeze` are.
        For two layers of equal thickness and n = E_top/E_bottom this is the bimetal strip of
        Timoshenko (1925), k = 24 (eps_b - eps_t)/(h (14 + n + 1/n)), with the free strains
        eps = nb p/Eb in place of the thermal ones.
        """
        modulus, contraction = self._in_plane
        neutral = self._neutral(modulus)
        stretching, _, bending = self._integrals(modulus, neutral)
        p0, p1, _ = self._integrals(contraction)
        k = -jnp.asarray(pressure) * (p1 - neutral * p0) / bending
        e = neutral * k + pressure * p0 / stretching
        psi = (p1 * k - p0 * e - pressure * self._compliance) / self.height
        zero = jnp.zeros_like(k)
        return Strains(e=e, g=zero, k=k, psi=psi, dpsi=zero)

    @property
    def _in_plane(self) -> tuple[Array, Array]:
        """Modulus Eb and contraction nb of every layer: sigma_x = Eb eps_x, eps_y = -nb eps_x."""
        nu = self.layers[:, 2]
        modulus = plane_modulus(self.layers[:, 1], nu, self.plane)
        return modulus, nu if self.plane == "stress" else nu / (1.0 - nu)

    @property
    def _shear_moduli(self) -> Array:
        """Shear modulus G of every layer."""
        return 0.5 * self.layers[:, 1] / (1.0 + self.layers[:, 2])

    @property
    def _compliance(self) -> Array:
        """Compliance F = int ds/C11, length/stress."""
        modulus, contraction = self._in_plane
        return (self.layers[:, 0] * (1.0 - contraction**2) / modulus).sum()

    def _integrals(self, values: Array, about: ArrayLike = 0.0) -> Array:
        """Integrals over s of a value per layer times (1, s - about, (s - about)^2)."""
        thickness = self.layers[:, 0]
        middle = jnp.cumsum(thickness) - 0.5 * thickness - 0.5 * self.height - about
        powers = jnp.stack([jnp.ones_like(middle), middle, middle**2 + thickness**2 / 12.0])
        return (powers * thickness * values).sum(axis=-1)

    def _neutral(self, modulus: Array) -> Array:
        """Height s of the neutral line, which pure bending does not stretch."""
        stretching, coupling, _ = self._integrals(modulus)
        return coupling / stretching

    def _bending(self, modulus: Array, e: Array, k: Array) -> Array:
        """Energy int modulus eps_x^2/2 ds, written about the neutral line as a sum of squares."""
        neutral = self._neutral(modulus)
        stretching, _, bending = self._integrals(modulus, neutral)
        return 0.5 * stretching * (e - neutral * k) ** 2 + 0.5 * bending * k**2

    def _shear(self, g: Array, dpsi: Array) -> Array:
        """Shear energy of a section with psi."""
        mean = jnp.sqrt(self.shear_coefficient) * g
        squeeze = jnp.sqrt(self.kappa_s) * dpsi
        zeroth, first, second = self._integrals(self._shear_moduli)
        if self.constants == "printed":
            first, second = 0.0, 24.0 * second
        return 0.5 * zeroth * mean**2 + first * mean * squeeze + 0.5 * second * squeeze**2

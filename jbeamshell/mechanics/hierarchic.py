r"""Hierarchic section: displacements of order p through the height, without shear factors.

The section of a beamshell stays straight; that of order p bends.  It adds to the four fields v, w,
beta and psi, for j = 2 ... p, the displacements a_j along X and b_j across, times the integrated
Legendre polynomials N_j of t = s/H (Szabo & Babuska 1991, section 6.2),

    N_j(t) = (P_j(t) - P_{j-2}(t)) / sqrt(2 (2j-1)).

They vanish on both faces, so contact, friction and pressures stay those of the beamshell.  In the
axes T and B of `jbeamshell.mechanics.kinematics`, the material point at height s moves to

    x = X + v - (H+s)(1+psi) sin(beta) + a cos(beta) - b sin(beta),      a = sum a_j N_j,
    y = w + (H+s)(1+psi) cos(beta) + a sin(beta) + b cos(beta),          b = sum b_j N_j,

and the energy is that of plane elasticity, integrated over s:

    Phi = int C11 (eps_x + nu' eps_y)^2/2 + E' eps_y^2/2 + G gamma^2/2 ds.

Exact kinematics take the strains of Green and Lagrange, hence the material of St. Venant and
Kirchhoff.  Linear kinematics take the symmetric part of the displacement gradient.  p = 1 is the
beamshell with kappa = kappa_s = 1 and shear that varies over the height.  p to infinity is plane
elasticity.

References
----------
Szabo, B. & Babuska, I. (1991). Finite Element Analysis. Wiley.
"""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.mechanics.homogeneous import plane_stiffness, shear_modulus
from jbeamshell.mechanics.kinematics import FIELDS, KINEMATICS, Section, Strains


class Hierarchic(eqx.Module):
    """Homogeneous section of order p; its fields are v, w, beta, psi, a_2, b_2, ..., a_p, b_p.

    Attributes
    ----------
    half_height : half height H, length
    plane_modulus : E', stress: E/(1-nu^2) in plane strain, E in plane stress
    poisson_ratio : Poisson's ratio nu
    order : order p, from 1 up
    kinematics : "exact" or "linear"
    plane : "strain" or "stress"
    """

    half_height: Array = eqx.field(converter=jnp.asarray)
    plane_modulus: Array = eqx.field(converter=jnp.asarray)
    poisson_ratio: Array = eqx.field(converter=jnp.asarray)
    order: int = eqx.field(static=True)
    kinematics: str = eqx.field(static=True, default="exact")
    plane: str = eqx.field(static=True, default="strain")

    def energy(self, section: Section, slope: Section) -> Array:
        """Strain energy of one section, per unit length and width.

        Parameters
        ----------
        section : (2p+2,) fields of the section
        slope : (2p+2,) their derivatives along X
        """
        # Exact for the product of two gradients of order p.  Exact strains have products of four,
        # whose quadrature error is as small as the strains.
        points, weights = np.polynomial.legendre.leggauss(
            self.order + (2 if self.kinematics == "exact" else 1)
        )
        density = jax.vmap(lambda t: self._density(section, slope, t))(jnp.asarray(points))
        return self.half_height * jnp.sum(weights * density)

    def forces(self, section: Section, slope: Section) -> Strains:
        """Section forces N, Q, M, chi and xi, conjugate to the strains of the straight part.

        They are exact for small rotations.  The parameters are those of `energy`.
        """
        of_section, of_slope = jax.grad(self.energy, argnums=(0, 1))(section, slope)
        normal, shear, base_moment, squeeze = (of_slope[field] for field in range(len(FIELDS)))
        # From e = v' - H beta', k = beta' and g = w' - beta + H psi' by the chain rule.
        return Strains(
            normal,
            shear,
            base_moment + self.half_height * normal,
            of_section[FIELDS.index("psi")],
            squeeze - self.half_height * shear,
        )

    def displacement(self, section: Section, height: Array) -> tuple[Array, Array]:
        """Displacement (x, y) of the material point at ``height`` s above mid-height."""
        straight, bubbles = section[: len(FIELDS)], section[len(FIELDS) :]
        x, y = KINEMATICS[self.kinematics].position(straight, self.half_height, height)
        if self.order == 1:
            return x, y
        shapes = [jnp.polyval(c, height / self.half_height) for c in _bubbles(self.order)]
        along = sum(shape * a for shape, a in zip(shapes, bubbles[::2], strict=True))
        across = sum(shape * b for shape, b in zip(shapes, bubbles[1::2], strict=True))
        if self.kinematics == "linear":
            return x + along, y + across
        sin, cos = jnp.sin(straight[2]), jnp.cos(straight[2])
        return x + along * cos - across * sin, y + along * sin + across * cos

    def mean_displacement(self, section: Section) -> Array:
        """Mean displacement along X over the height, conjugate to a uniform traction."""
        points, weights = np.polynomial.legendre.leggauss(self.order + 1)
        displacements = jax.vmap(lambda t: self.displacement(section, t * self.half_height)[0])
        return 0.5 * jnp.sum(weights * displacements(jnp.asarray(points)))

    def _density(self, section: Section, slope: Section, t: Array) -> Array:
        """Strain energy per area at t = s/H."""
        height = t * self.half_height

        def displacement(section: Section, height: Array) -> Array:
            return jnp.stack(self.displacement(section, height))

        zero = jax.tree.map(jnp.zeros_like, section)
        along = jax.jvp(displacement, (section, height), (slope, jnp.zeros_like(height)))[1]
        across = jax.jvp(displacement, (section, height), (zero, jnp.ones_like(height)))[1]
        (ux_x, uy_x), (ux_y, uy_y) = along, across
        exx, eyy, shear = ux_x, uy_y, ux_y + uy_x
        if self.kinematics == "exact":
            exx = exx + 0.5 * (ux_x**2 + uy_x**2)
            eyy = eyy + 0.5 * (ux_y**2 + uy_y**2)
            shear = shear + ux_x * ux_y + uy_x * uy_y
        nu = self.poisson_ratio
        coupling, c11 = plane_stiffness(self.plane_modulus, nu, self.plane)
        stretch = 0.5 * c11 * (exx + coupling * eyy) ** 2 + 0.5 * self.plane_modulus * eyy**2
        modulus = shear_modulus(self.plane_modulus, nu, self.plane)
        return stretch + 0.5 * modulus * shear**2


def _bubbles(order: int) -> list[np.ndarray]:
    """Coefficients of N_2 ... N_p, the highest power of t first."""
    bubbles = []
    for j in range(2, order + 1):
        series = np.zeros(j + 1)
        series[[j, j - 2]] = 1.0, -1.0
        bubbles.append(np.polynomial.legendre.leg2poly(series)[::-1] / np.sqrt(2 * (2 * j - 1)))
    return bubbles

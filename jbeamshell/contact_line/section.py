"""Section of a scene as a quadratic form: plane elasticity, beamshell or bar.

A bar is a section that stretches and shears but does not turn.  Its w is a field of the form, as
the contact's equations need one, and stays zero: the pressures go straight to the base.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.numbers_of import numbers_of
from jbeamshell.mechanics.homogeneous import plane_modulus, plane_stiffness, shear_modulus
from jbeamshell.mechanics.kinematics import FIELDS, KINEMATICS, Section, linear_strains
from jbeamshell.mechanics.layered import Material, layered_form
from jbeamshell.mechanics.section_form import SectionForm, section_stiffness, squeeze_at_even_force
from jbeamshell.scene.scene import Scene

V, W, BETA, PSI = range(len(FIELDS))


def section_form(scene: Scene) -> SectionForm:
    """Form of the section of a scene: its own, or that of plane elasticity."""
    return _plane(scene) if scene.plan.elastic else _beam(scene)


def thicknesses(scene: Scene) -> Array:
    """Thickness of each layer from the bottom up; that of a homogeneous strip is its height."""
    layers, height = scene.strip.layers, 2.0 * scene.strip.half_height
    return numbers_of(height).reshape(height, 1) if layers is None else layers[:, 0]


def _plane(scene: Scene) -> SectionForm:
    """Section of plane elasticity, homogeneous or layered."""
    strip = scene.strip
    if strip.layers is None:
        given = strip.plane_modulus, strip.poisson_ratio
        modulus, nu = (numbers_of(given).reshape(number, 1) for number in given)
    else:
        _, youngs, nu = strip.layers.T
        modulus = plane_modulus(youngs, nu, strip.plane)
    coupling, stiffness = plane_stiffness(modulus, nu, strip.plane)
    shear = shear_modulus(modulus, nu, strip.plane)
    return layered_form(Material(thicknesses(scene), stiffness, coupling * stiffness, shear))


def _beam(scene: Scene) -> SectionForm:
    """Section of the beamshell (homogeneous, layered, of a quadratic Phi) or of a bar.

    The elements are those of the finite differences of `jbeamshell.mechanics.elements`.
    """
    plan, half_height = scene.plan, scene.strip.half_height
    phi, still = scene.strain_energy(), jnp.zeros(len(FIELDS), half_height.dtype)
    active = np.union1d(plan.active, [V, W])

    def energy(fields: Section, slopes: Section) -> Array:
        return phi(*linear_strains(fields, slopes, half_height))

    def moved(fields: Array, height: Array) -> Array:
        return jnp.stack(KINEMATICS["linear"].position(fields, half_height, height))

    def along(fields: Array) -> Array:  # conjugate to the end load
        return moved(fields, 0.0 * half_height)[0]

    parts = jax.jacfwd(moved)  # (2, m) displacements of a material point per field
    stiffness = section_stiffness(energy, still)
    free = squeeze_at_even_force(stiffness)
    # The squares of psi at an element's nodes have another mean than the square of its mean.
    spread = jnp.zeros((still.size, still.size), still.dtype).at[PSI, PSI].set(0.25 * free)
    held = np.isin(np.arange(still.size), [V, BETA])
    modes = jnp.zeros((5, 2, still.size), still.dtype)
    modes = modes.at[[0, 1, 2, 3, 4], [1, 1, 1, 0, 1], [V, W, BETA, PSI, PSI]].set(1.0)
    modes = modes.at[2, 1, V].set(half_height).at[4, 1, W].set(-half_height)
    modes = jnp.where(np.isin([V, W, BETA, PSI, PSI], active)[:, None, None], modes, 0.0)

    thickness = thicknesses(scene)
    points, weights = np.polynomial.legendre.leggauss(2)
    bottom = jnp.cumsum(thickness) - thickness - half_height
    heights = bottom[:, None] + 0.5 * thickness[:, None] * (1.0 + points)
    shapes = jax.vmap(jax.vmap(lambda height: parts(still, height)))(heights)
    masses = jnp.einsum("l,p,lpai,lpaj->lij", 0.5 * thickness, weights, shapes, shapes)
    moment = jnp.einsum("l,p,lp,lpi->i", 0.5 * thickness, weights, heights, shapes[:, :, 0])
    turn = -moment / (2.0 * half_height**3 / 3.0)

    pick = np.ix_(active, active)
    return SectionForm(
        values=stiffness[0, :, 0][pick],
        mixed=stiffness[0, :, 1][pick],
        slopes=stiffness[1, :, 1][pick],
        pull=jax.grad(along)(still)[active],
        turn=turn[active],
        press=parts(still, half_height)[1, active],
        held=held[active],
        further=jnp.eye(still.size, dtype=still.dtype)[2:, active],
        modes=modes[..., active],
        spread=spread[pick],
        masses=masses[:, active][..., active],
        top=int(np.flatnonzero(active == PSI)[0]) if PSI in active else 0,
    )

"""Check of a user's strain energy for a linear section: a quadratic form with stiffness."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.mechanics.homogeneous import Energy, forces
from jbeamshell.mechanics.kinematics import Strains

SIZES = (1e-4, 1e-2, -1e-2, 0.3)  # of the strains at which the forces must be proportional to them
WEAKEST = 1e-8  # stiffness over the largest one that counts as none


def is_quadratic(energy: Energy, half_height: Array, squeeze: bool) -> bool:
    """True if a strain energy is a quadratic form of its strains with stiffness against all.

    Parameters
    ----------
    energy : Phi(e, g, k, psi, psi')
    half_height : H, by which k and psi' are made strains
    squeeze : True if psi is a field; psi' may have no stiffness
    """
    with jax.ensure_compile_time_eval():
        stiffness, strains, stresses = map(np.asarray, _probe(energy, half_height))
    if not (np.all(np.isfinite(stiffness)) and np.all(np.isfinite(stresses))):
        return False
    tolerance = np.sqrt(np.finfo(stresses.dtype).eps) * np.abs(strains) @ np.abs(stiffness)
    quadratic = bool(np.all(np.abs(stresses - strains @ stiffness) <= tolerance))
    fields = stiffness[:4, :4] if squeeze else stiffness[:3, :3]
    least, most = np.linalg.eigvalsh(fields)[[0, -1]]
    strong = bool(least > WEAKEST * most)
    if squeeze:
        strong = strong and bool(np.linalg.eigvalsh(stiffness)[0] > -WEAKEST * most)
    return quadratic and strong


@eqx.filter_jit
def _probe(energy: Energy, half_height: Array) -> tuple[Array, Array, Array]:
    """Stiffness (5, 5) at zero, strains (n, 5) and forces (n, 5) there; k and psi' times H."""
    unit = jnp.ones((), half_height.dtype)
    scale = jnp.stack([unit, unit, 1.0 / half_height, unit, 1.0 / half_height])

    def scaled(strains: Array) -> Array:
        return scale * jnp.stack(forces(energy, Strains(*(scale * strains))))

    pattern = np.cos(np.arange(1, 5 * len(SIZES) + 1) ** 2).reshape(-1, 5)
    probes = jnp.asarray(pattern * np.array(SIZES)[:, None], half_height.dtype)
    return jax.jacfwd(scaled)(jnp.zeros_like(scale)), probes, jax.vmap(scaled)(probes)

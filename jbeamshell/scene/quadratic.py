"""Check of a user's strain energy for a linear section: a quadratic form with stiffness."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.checks import require
from jbeamshell.mechanics.homogeneous import Energy, forces
from jbeamshell.mechanics.kinematics import Strains

SIZES = (1e-4, 1e-2, -1e-2, 0.3)  # of the strains at which the forces must be proportional to them
WEAKEST = 1e-8  # stiffness over the largest one that counts as none


def check_quadratic(energy: Energy, half_height: Array, squeeze: bool, fix: str) -> None:
    """Raise `InputError` for a strain energy that is not quadratic, or without stiffness.

    Parameters
    ----------
    energy : Phi(e, g, k, psi, psi')
    half_height : H, by which k and psi' are made strains
    squeeze : True if psi is a field
    fix : the model to take instead
    """
    with jax.ensure_compile_time_eval():
        stiffness, at, found = map(np.asarray, _probed(energy, half_height))
    finite = bool(np.all(np.isfinite(stiffness)) and np.all(np.isfinite(found)))
    require("energy", energy, finite, "has derivatives that are not finite: mend it")
    close = np.sqrt(np.finfo(found.dtype).eps) * np.abs(at) @ np.abs(stiffness)
    quadratic = bool(np.all(np.abs(found - at @ stiffness) <= close))
    require("energy", energy, quadratic, f"is not quadratic in the strains: {fix}")
    fields = stiffness[:4, :4] if squeeze else stiffness[:3, :3]
    least, most = np.linalg.eigvalsh(fields)[[0, -1]]
    strong = bool(least > WEAKEST * most)
    if squeeze:  # psi' may have none
        strong = strong and bool(np.linalg.eigvalsh(stiffness)[0] > -WEAKEST * most)
    fix = "has strains without stiffness: make it positive definite in e, g, k and psi"
    require("energy", energy, strong, fix)


@eqx.filter_jit
def _probed(energy: Energy, half_height: Array) -> tuple[Array, Array, Array]:
    """Stiffness (5, 5) at zero, strains (n, 5) and forces (n, 5) there; k and psi' times H."""
    unit = jnp.ones((), half_height.dtype)
    scale = jnp.stack([unit, unit, 1.0 / half_height, unit, 1.0 / half_height])

    def scaled(strains: Array) -> Array:
        return scale * jnp.stack(forces(energy, Strains(*(scale * strains))))

    pattern = np.cos(np.arange(1, 5 * len(SIZES) + 1) ** 2).reshape(-1, 5)
    at = jnp.asarray(pattern * np.array(SIZES)[:, None], half_height.dtype)
    return jax.jacfwd(scaled)(jnp.zeros_like(scale)), at, jax.vmap(scaled)(at)

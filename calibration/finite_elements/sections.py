r"""Sections of the beamshell fitted to the displacements of finite elements.

beta is the slope of the least-squares line through u_x over the height, psi the change of height
over 2H; at the middles of quadratic elements both are interpolated.  Section forces follow exactly
from the displacements, for small rotations: with int the integral over s from -H to H and [ ] the
difference between top and bottom face,

    N   = C11 (int u_x)' + lam [u_y],           chi = lam (int u_x)' + C11 [u_y],
    -M  = C11 (int s u_x)' + lam ([s u_y] - int u_y),
    Q   = G ((int u_y)' + [u_x]),               xi  = G ((int s u_y)' + [s u_x] - int u_x).
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from calibration.finite_elements.mesh import Mesh, weights
from jbeamshell.mechanics.homogeneous import plane_stiffness, shear_modulus
from jbeamshell.scene.scene import Scene


def fitted(mesh: Mesh, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and squeeze strain of the columns, (levels, m) each, of u (levels, m, k, 2)."""
    ends, height = u[:, :: mesh.order], mesh.y[-1]
    across, s = weights(mesh.rows, mesh.order), mesh.y - 0.5 * height
    slope = ends[..., 0] @ (s * across) / (s**2 @ across)
    squeeze = (ends[..., -1, 1] - ends[..., 0, 1]) / height
    return _between(mesh, -np.arctan(slope)), _between(mesh, squeeze)


def section_forces(scene: Scene, mesh: Mesh, u: np.ndarray) -> tuple[np.ndarray, ...]:
    """N, Q, M, chi and xi of every element along X, (levels, nx) each, of u (levels, m, k, 2)."""
    strip = scene.strip
    modulus, nu = strip.plane_modulus, jnp.asarray(strip.poisson_ratio)
    coupling, c11 = (float(c) for c in plane_stiffness(modulus, nu, strip.plane))
    shear, lam = float(shear_modulus(modulus, nu, strip.plane)), coupling * c11
    across, s = weights(mesh.rows, mesh.order), mesh.y - float(strip.half_height)
    ux, uy = np.moveaxis(u[:, :: mesh.order], -1, 0)  # (levels, nx + 1, k)

    def mean(column: np.ndarray) -> np.ndarray:
        return 0.5 * (column[:, 1:] + column[:, :-1])

    def slope(column: np.ndarray) -> np.ndarray:
        return np.diff(column, axis=1) / np.diff(mesh.columns)

    def jump(values: np.ndarray) -> np.ndarray:
        return mean(values[..., -1] - values[..., 0])

    stretch, bend = slope(ux @ across), slope(ux @ (s * across))
    squeeze, couple = jump(uy), jump(s * uy) - mean(uy @ across)
    return (
        c11 * stretch + lam * squeeze,
        shear * (slope(uy @ across) + jump(ux)),
        -(c11 * bend + lam * couple),
        lam * stretch + c11 * squeeze,
        shear * (slope(uy @ (s * across)) + jump(s * ux) - mean(ux @ across)),
    )


def _between(mesh: Mesh, ends: np.ndarray) -> np.ndarray:
    """Values (levels, nx + 1) at the elements' ends, at all columns."""
    if mesh.order == 1:
        return ends
    middles = 0.5 * (ends[:, 1:] + ends[:, :-1])
    return np.insert(ends, np.arange(1, ends.shape[1]), middles, axis=1)

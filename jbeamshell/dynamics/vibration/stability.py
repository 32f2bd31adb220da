r"""Stability of periodic motions, by Hill's method.

Two motions of a structure whose joints are networks of sliders never move apart: each slider's
force f = k (u - z) slips so that (f_1 - f_2) (z_1' - z_2') >= 0, and the energy of the difference
of two motions,

    (x_t^T M x_t + x^T K x + sum f^2/k)/2,

does not grow.  Every steady motion of such a structure is stable, the only one under its load, and
its response curve has no folds.  Cubic springs have folds.  Small deviations
exp(s t) sum_k p_k exp(i k omega t) then satisfy an eigenvalue problem in s (von Groll & Ewins
2001); s with a positive real part is unstable.  The force of sliders in a deviation is that of a
periodic one, which is exact at folds, s = 0.  One real s changes its sign at each fold, so that
beyond an odd number of them a curve that began stable is unstable.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import NDArray

from jbeamshell.dynamics.vibration.balance import Balance, Point
from jbeamshell.dynamics.vibration.periodic import Wave, lost_forces
from jbeamshell.dynamics.vibration.reduction import Reduced

MOST_MODES = 6  # in which deviations move
MORE = 2  # harmonics of deviations beyond those of the motion
MARGIN = 1e-7  # growth that counts, over the frequency


def are_stable(
    model: Reduced, balance: Balance, points: Point, folds: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """True where small deviations from the points (k, ...) of a curve do not grow, (k,)."""
    count = points.p.shape[0]
    if not np.any(np.asarray(model.laws.cubic)):
        return np.ones(count, bool)
    growth = np.array([_growth(a) for a in np.asarray(_matrices(model, balance, points))])
    stable = growth <= MARGIN
    passed = np.searchsorted(folds, np.arange(count))
    return stable & ~(stable[0] & (passed % 2 == 1))


@partial(jax.jit, static_argnums=1)
def _matrices(model: Reduced, balance: Balance, points: Point) -> Array:
    """Matrices (k, m, m) whose eigenvalues are s/omega of deviations."""
    return lax.map(partial(_matrix, model, balance), points)


def _matrix(model: Reduced, balance: Balance, at: Point) -> Array:
    modes = _modes(model)
    mass, damping, stiffness = (
        modes.T @ a @ modes for a in (model.mass, model.damping, model.stiffness)
    )
    directions, omega = modes.T @ model.directions, at.p[0]
    most = balance.harmonics[-1] + MORE
    number, size = np.arange(-most, most + 1), mass.shape[0]
    count = number.size
    coupling = _coupling(model, balance, at, most)
    full = jnp.einsum("aj,lkj,bj->lakb", directions, coupling, directions)
    rate = 1j * number[:, None, None] * omega
    own = stiffness + rate * damping + rate**2 * mass
    zero = full.at[np.arange(count), :, np.arange(count), :].add(own)
    one = (
        jnp.zeros_like(zero)
        .at[np.arange(count), :, np.arange(count), :]
        .set(damping + 2.0 * rate * mass)
    )
    left = (a.reshape(count * size, count * size) for a in (zero / omega**2, one / omega))
    inverse = jnp.kron(jnp.eye(count), jnp.linalg.inv(mass))
    below = [-(inverse @ a) for a in left]
    identity = jnp.eye(count * size) + 0j
    return jnp.block([[jnp.zeros_like(identity), identity], below])


def _modes(model: Reduced) -> Array:
    """Lowest modes (r, m) with all elements stuck."""
    lower = jnp.linalg.cholesky(model.mass)
    half = jnp.linalg.solve(lower, model.stiffness)
    _, vectors = jnp.linalg.eigh(jnp.linalg.solve(lower, half.T))
    return jnp.linalg.solve(lower.T, vectors[:, :MOST_MODES])


def _coupling(model: Reduced, balance: Balance, at: Point, most: int) -> Array:
    """Harmonics (l, k, J) of the force lost in deviations exp(i k theta) of each element."""
    whole = Wave(np.arange(most + 1), balance.samples)
    motion = at.x @ model.directions
    values = jnp.zeros((most + 1, motion.shape[1]), motion.dtype)
    base = whole.samples(values.at[np.array(balance.harmonics)].set(motion))
    joints = motion.shape[1]

    def deviation(value: Array, rate: Array) -> Array:
        ways = tuple(jnp.broadcast_to(a[:, None], (a.size, joints)) for a in (value, rate))
        return jax.jvp(partial(lost_forces, model.laws, whole), base, ways)[1]

    real = jax.vmap(deviation, (1, 1))(*map(jnp.real, (whole.value, whole.rate)))
    imaginary = jax.vmap(deviation, (1, 1))(*map(jnp.imag, (whole.value, whole.rate)))
    number = np.arange(-most, most + 1)
    way = np.sign(number)[:, None, None]
    answer = real[abs(number)] + 1j * way * imaginary[abs(number)]  # (k, P, J)
    angle = whole.step * np.arange(1, whole.value.shape[0] + 1)
    onto = np.exp(-1j * np.outer(number, angle)) / angle.size
    return jnp.einsum("lp,kpj->lkj", onto, answer)


def _growth(matrix: NDArray[Any]) -> float:
    """Largest real part of the exponents within half a frequency of zero."""
    values = np.linalg.eigvals(matrix)
    return float(np.max(values.real[np.abs(values.imag) <= 0.5 + 1e-9]))

"""Reduction of a body with mass to some of its nodes and a few of its own modes.

With b what is retained and i the rest, Phi the modes of the body with b clamped,

    q_i = Psi q_b + Phi eta,    Psi = -K_ii^-1 K_ib

(Craig and Bampton 1968).  Loads on b have exact displacements in statics; the frequencies of the
body on others come from above, and close in on the true ones with more modes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import SuperLU, eigsh


def reduced(
    stiffness: scipy.sparse.csc_array,
    mass: scipy.sparse.csc_array,
    kept: NDArray[np.bool_],
    factors: SuperLU | None,
    modes: int,
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Stiffness and mass of what is retained, in its order, and of the modes after it.

    Parameters
    ----------
    stiffness, mass : (N, N)
    kept : (N,) True for what is retained
    factors : of the stiffness of the rest; None if there is none
    modes : how many
    """
    b, i = np.flatnonzero(kept), np.flatnonzero(~kept)
    k, m = stiffness[b][:, b].toarray(), mass[b][:, b].toarray()
    if factors is None:
        return k, m
    across = stiffness[i][:, b].toarray()
    static = -factors.solve(across)
    inner, k = mass[i][:, i], k + across.T @ static
    coupled = mass[b][:, i] @ static
    m = m + coupled + coupled.T + static.T @ (inner @ static)
    values, shapes = _modes(stiffness[i][:, i], inner, modes)
    mixed = (mass[b][:, i] + static.T @ inner) @ shapes
    none = np.zeros_like(mixed)
    k = np.block([[k, none], [none.T, np.diag(values)]])
    m = np.block([[m, mixed], [mixed.T, np.eye(modes)]])
    return 0.5 * (k + k.T), 0.5 * (m + m.T)


def _modes(
    stiffness: scipy.sparse.csc_array, mass: scipy.sparse.csc_array, count: int
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Squared angular frequencies (count,) and modes (N, count) of unit modal mass."""
    if count == 0:
        return np.zeros(0), np.zeros((int(stiffness.shape[0]), 0))
    start = np.ones(int(stiffness.shape[0]))  # the same digits in every run
    values, shapes = eigsh(stiffness, count, mass, sigma=0.0, v0=start)
    return values, shapes

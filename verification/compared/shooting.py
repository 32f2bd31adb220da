r"""Shooting: integrate from one end, correct the start until the other end is right.

The strip's equations are of first order in its fields y = (v, beta, psi) and their conjugates
p = dPhi/dy'.  With the strains E = B0 y + B1 y' and Phi = E.C E/2, on a foundation k_t v,

    y' = P^-1 (p - Q y),  p' = Q^T y' + (B0^T C B0 + K) y,   P = B1^T C B1,  Q = B1^T C B0,

of which the solutions are exponentials: half of them grow from X = 0 and half decay.  Whatever is
unknown at X = 0 is multiplied by the fastest growth on its way to X = L, and so is its rounding:
exact integration does not help.  The squeeze alone, psi'' = psi/lambda^2 with
lambda^2 = kappa_s H^2 (1-nu)/6, grows by exp(L/lambda): e^440 for the 200 x 2 mm strip of Brink
(2015, section 4.7.2), who shoots.
"""

from __future__ import annotations

import contextlib
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

import jbeamshell as jb
from jbeamshell.mechanics.kinematics import linear_strains
from verification.compared.strips import stiffness_of_section

DIGITS = -np.log10(np.finfo(float).eps)
CORRECTIONS = 5
PIECES = 200
UNKNOWN = [2, 3, 4]  # psi, N and M at X = 0, where v = beta = 0 and xi = 0


class Shot(NamedTuple):
    """Result of shooting.

    Attributes
    ----------
    growth : log10 of the fastest solution's growth over the strip
    spread : log10 of how much the fastest grows more than the slowest
    condition : of the matrix from the unknown start to the conditions at the end
    residual : left at the end, of the load
    error : of the end displacement, relative
    path_error : largest of v when the strip is integrated from what was found, over u(L)
    """

    growth: float
    spread: float
    condition: float
    residual: float
    error: float
    path_error: float


def equations(scene: jb.Scene, slip_stiffness: float) -> np.ndarray:
    """The matrix A of z' = A z, z = (v, beta, psi and their conjugates), (6, 6)."""
    half_height, section = float(scene.strip.half_height), stiffness_of_section(scene)
    v, beta, psi, dv, dbeta, dpsi = np.eye(6)
    none = np.zeros(6)
    strains = np.array(linear_strains((v, none, beta, psi), (dv, none, dbeta, dpsi), half_height))
    matrix = strains.T @ section @ strains
    here, mixed, slopes = matrix[:3, :3].copy(), matrix[3:, :3], matrix[3:, 3:]
    here[0, 0] += slip_stiffness
    inverse = np.linalg.inv(slopes)
    return np.block(
        [[-inverse @ mixed, inverse], [here - mixed.T @ inverse @ mixed, mixed.T @ inverse]]
    )


def exponents(scene: jb.Scene, slip_stiffness: float) -> np.ndarray:
    """Characteristic exponents of the strip that grow from X = 0, (3,), the fastest first.

    They come in pairs of either sign; of complex ones it is the real part that grows.  A strip that
    slips has a double zero among them.
    """
    found = np.linalg.eigvals(equations(scene, slip_stiffness)).real
    return np.maximum(np.sort(found)[:2:-1], 0.0)


@np.errstate(over="ignore", invalid="ignore")
def shoot(scene: jb.Scene, slip_stiffness: float, force: float = 1.0) -> Shot:
    """Pull a stuck strip of v, beta, psi by shooting, beside the solution that does not grow."""
    matrix = equations(scene, slip_stiffness)
    length, half_height = float(scene.strip.length), float(scene.strip.half_height)
    units = _units(matrix, scene)
    matrix = matrix * units / units[:, None]  # else the condition would be that of the units
    load = force * np.array([1.0, -half_height, 0.0]) / units[3:]
    rates = exponents(scene, slip_stiffness) * length / np.log(10.0)
    growth, spread = float(rates[0]), float(rates[0] - rates[-1])
    ends = _integrated(matrix, length, np.eye(6)[:, UNKNOWN])[-1, 3:]
    if not np.all(np.isfinite(ends)):
        return Shot(growth, spread, *[np.inf] * 4)
    start = np.zeros(3)
    with contextlib.suppress(np.linalg.LinAlgError):  # singular to the last digit: nothing is found
        for _ in range(CORRECTIONS):
            start = start - np.linalg.solve(ends, ends @ start - load)
    path = _integrated(matrix, length, np.eye(6)[:, UNKNOWN] @ start[:, None])[..., 0]
    exact = bounded(matrix, length, load)
    stretch = np.array([1.0, -half_height * units[1] / units[0]])
    shot, true = path[-1, :2] @ stretch, exact[-1, :2] @ stretch
    return Shot(
        growth,
        spread,
        float(np.linalg.cond(ends)),
        float(np.max(np.abs(path[-1, 3:] - load)) / np.max(np.abs(load))),
        float(abs(shot / true - 1.0)),
        float(np.max(np.abs(path[:, 0] - exact[:, 0])) / abs(true)),
    )


def _units(matrix: np.ndarray, scene: jb.Scene) -> np.ndarray:
    """Units of the six, in which all of them are alike."""
    half_height, stiffness = float(scene.strip.half_height), float(scene.strip.stretching_stiffness)
    return np.array([half_height, 1.0, 1.0, stiffness, *[stiffness * half_height] * 2])


def _integrated(matrix: np.ndarray, length: float, start: np.ndarray) -> np.ndarray:
    """Solutions from X = 0 to L, (PIECES + 1, 6, k), exact but for rounding."""
    piece, path = expm(matrix * length / PIECES), [start]
    for _ in range(PIECES):
        path.append(piece @ path[-1])
    return np.array(path)


def bounded(matrix: np.ndarray, length: float, load: np.ndarray) -> np.ndarray:
    """The same problem by solutions that are never larger than 1, (PIECES + 1, 6)."""
    rates, modes = np.linalg.eig(matrix)
    x = np.linspace(0.0, length, PIECES + 1)[:, None]
    # Each exponential counts from the end at which it is largest.
    shapes = np.exp(np.where(rates.real > 0.0, rates * (x - length), rates * x))
    first, last = modes * shapes[0], modes * shapes[-1]
    conditions = np.vstack([first[[0, 1, 5]], last[3:]])
    parts = np.linalg.solve(conditions, np.concatenate([np.zeros(3), load]).astype(complex))
    return np.asarray(((modes * parts) @ shapes.T).T.real)


class Squeeze(NamedTuple):
    """Squeezed strip by shooting.

    Attributes
    ----------
    length : L over H
    growth : log10 of the growth, L/(lambda ln 10)
    error : largest of psi along the strip, of psi under the load
    condition : of the end's xi from the start's psi, both of order 1 under the load
    """

    length: float
    growth: float
    error: float
    condition: float


def squeeze_length(kappa_s: float, poisson_ratio: float) -> float:
    """Decay length of the squeeze over H, sqrt(kappa_s (1-nu)/6), of a free strip."""
    return float(np.sqrt(kappa_s * (1.0 - poisson_ratio) / 6.0))


def shoot_squeeze(length: float, kappa_s: float = 0.44, poisson_ratio: float = 0.3) -> Squeeze:
    """Squeeze a free strip over its first half, by shooting from X = 0; lengths are over H.

    In units of psi under the load: lambda^2 psi'' = psi + 1 there, psi beyond, psi' = 0 at both
    ends, psi(0) unknown.
    """
    decay = squeeze_length(kappa_s, poisson_ratio)
    piece = 0.5 * length / decay / PIECES
    step = np.array([[np.cosh(piece), np.sinh(piece)], [np.sinh(piece), np.cosh(piece)]])

    def path(start: float) -> np.ndarray:
        at, found = np.array([start, 0.0]), []
        for load in np.repeat([-1.0, 0.0], PIECES):
            at = step @ (at - [load, 0.0]) + [load, 0.0]
            found.append(at)
        return np.array(found)

    start, (none, one) = -1.0, (path(value)[-1, 1] for value in (0.0, 1.0))
    slope = one - none
    for _ in range(CORRECTIONS):
        start = start - path(start)[-1, 1] / slope
    x = np.linspace(0.0, length, 2 * PIECES + 1)[1:] / decay
    half, whole = 0.5 * length / decay, length / decay
    # cosh and sinh over sinh of the whole, by exponentials that do not grow
    inner = -1.0 + _ratio(x, whole) * 0.5 * -np.expm1(-2.0 * (whole - half)) * np.exp(whole - half)
    outer = -_ratio(whole - x, whole) * 0.5 * -np.expm1(-2.0 * half) * np.exp(half)
    exact = np.where(x <= half, inner, outer)
    error = float(np.max(np.abs(path(start)[:, 0] - exact)))
    return Squeeze(length, whole / np.log(10.0), error, float(abs(slope)))


def _ratio(x: np.ndarray, whole: float) -> np.ndarray:
    """cosh(x)/sinh(whole), for x up to the whole."""
    return np.exp(x - whole) * (1.0 + np.exp(-2.0 * x)) / -np.expm1(-2.0 * whole)

r"""Quadrature of an element: one point, all points, and the mixture of the library.

Linear elements of the four fields with linear kinematics, small enough to be dense matrices.  With
full quadrature (two Gauss points are exact for all products) thin strips lock: beta is linear and
w' constant within an element, so g = w' - beta + H psi' vanishes throughout only if beta' does, and
an element of length l bends 1 + (l/H)^2 kappa G/(2E') times too stiffly.  One point for all strains
frees that, but does not see a psi that alternates from node to node; psi is therefore taken at the
nodes, which keeps the squeeze's matrix an M-matrix.  There e differs from its mean so that N does
not vary with psi, or thin strips would lock as nu nears 1/2.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

import jbeamshell as jb
from calibration.strip import in_load_steps
from jbeamshell.mechanics.kinematics import FIELDS, linear_strains
from verification.compared.strips import stiffness_of_section

GAUSS = 0.5 + 0.5 / np.sqrt(3.0) * np.array([-1.0, 1.0])


class Rule(NamedTuple):
    """Points on [0, 1] of an element, two of weight 1/2 each: of psi itself, and of the others.

    If ``even`` is True, e follows psi so that N is even.
    """

    squeeze: np.ndarray
    others: np.ndarray
    even: bool = False


MIDDLE, NODES = np.array([0.5, 0.5]), np.array([0.0, 1.0])
LIBRARY = "one point, squeeze at nodes"  # its finite differences
RULES = {
    LIBRARY: Rule(NODES, MIDDLE, even=True),
    "one point": Rule(MIDDLE, MIDDLE),
    "full": Rule(GAUSS, GAUSS),
    "squeeze full, others one point": Rule(GAUSS, MIDDLE),
}


def stiffness(scene: jb.Scene, x: np.ndarray, rule: Rule) -> np.ndarray:
    """Matrix (4n, 4n) of the strip alone, v, w, beta, psi of one node after the other."""
    half_height, section = float(scene.strip.half_height), stiffness_of_section(scene)
    size = np.diff(x)
    first, last = np.eye(8)[:, None].reshape(2, 4, 8, 1)  # fields of both ends, per unknown
    slope = (last - first) / size
    parts = np.zeros((size.size, 8, 8))
    for squeeze, other in zip(rule.squeeze, rule.others, strict=True):
        at, inside = (first + place * (last - first) + 0.0 * slope for place in (other, squeeze))
        strains = np.array(linear_strains((*at[:3], inside[3]), tuple(slope), half_height))
        if rule.even:
            strains[0] -= section[0, 3] / section[0, 0] * (inside[3] - 0.5 * (first + last)[3])
        parts += np.einsum("s,iks,ij,jls->skl", 0.5 * size, strains, section, strains)
    whole = np.zeros([len(FIELDS) * x.size] * 2)
    places = len(FIELDS) * np.arange(x.size - 1)[:, None] + np.arange(8)
    np.add.at(whole, (places[:, :, None], places[:, None, :]), parts)
    return whole


def solved(matrix: np.ndarray, load: np.ndarray, held: list[int]) -> np.ndarray:
    """Fields (n, 4) under nodal loads, with some unknowns held at zero."""
    free = np.setdiff1d(np.arange(load.size), held)
    found = np.zeros(load.size)
    found[free] = np.linalg.solve(matrix[np.ix_(free, free)], load[free])
    return found.reshape(-1, len(FIELDS))


def cantilever(height_ratio: float, name: str, nodes: int = 21, **strip: Any) -> float:
    """Deflection of a clamped strip without foundation under a force at its tip, over the exact.

    The exact one is L^3/(3D) + L/(2 kappa G H), with psi = -nu' e = 0 at mid-height.
    """
    values = {f"strip.{key}": value for key, value in strip.items()}
    scene = in_load_steps().replace({"strip.height_ratio": height_ratio} | values)
    length, section = float(scene.strip.length), stiffness_of_section(scene)
    x = np.linspace(0.0, length, nodes)
    load = np.zeros(len(FIELDS) * nodes)
    load[-3] = 1.0
    w = solved(stiffness(scene, x, RULES[name]), load, [0, 1, 2])[-1, 1]
    _, shear, bending, *_ = np.diag(section)
    return float(w / (length**3 / (3.0 * bending) + length / shear))


def squeezed(elements_per_height: float, name: str, kappa_s: float = 0.44) -> float:
    """Overshoot of the squeeze at the edge of a load over the left half of a strip.

    It is in parts of the squeeze under the load, 0 without oscillation; elements are over H.
    """
    scene = in_load_steps().replace({"strip.kappa_s": kappa_s, "strip.half_height": 1.0 / 8.0})
    half_height, length = float(scene.strip.half_height), float(scene.strip.length)
    count = 2 * round(0.5 * length / half_height * elements_per_height)
    x = np.linspace(0.0, length, count + 1)
    size = length / count
    share = np.where(np.arange(count + 1) < count // 2, size, 0.0)
    share[[0, count // 2]] = 0.5 * size
    load = np.zeros((count + 1, len(FIELDS)))
    load[:, 3] = -2.0 * half_height * share  # of a unit pressure on both faces
    matrix = stiffness(scene, x, RULES[name])
    psi = solved(matrix, load.ravel(), [0, 1, 2])[:, 3] * float(scene.strip.plane_modulus)
    return float(max(-1.0 - np.min(psi), np.max(psi)))

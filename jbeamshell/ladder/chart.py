"""The map of the rungs' errors: strips that finite elements and every rung have solved.

`measured.json` holds strips drawn at random over eta, A/(mu F_N a), mu and nu, with the ratio of
every candidate's answer to that of plane-strain finite elements (`calibration/map_ladder.py`).  The
error at another strip is read off its nearest neighbours: a local plane through the logarithms of
their ratios, and what they scatter about it.
"""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jbeamshell.ladder.candidates import Candidate
from jbeamshell.mechanics.friction import ElasticSlip, SharpSlip
from jbeamshell.scene.scene import Scene

# Distances over which errors change alike: of log(A/eta), A, log(mu) and nu.
SCALES = np.array([0.15, 0.5, 0.7, 0.3])
NEIGHBOURS = 14
CAUTION = 2.5  # how many times their scatter is taken for granted
RANGES = {
    "eta": (0.008, 0.45),
    "A/(mu F_N a)": (0.08, 1.95),
    "mu": (0.045, 0.55),
    "nu": (0.0, 0.455),
}
KAPPA_S = (0.4, 0.48)  # of the beamshell with a squeeze strain: measured at .44
STIFFEST, SMOOTHEST = 200.0, 16.0  # alpha and m below which the contact's compliance shows
QUANTITIES = {
    "dissipation": {"dissipation": 1},
    "secant_stiffness": {"secant_stiffness": 1},
    "loss_factor": {"dissipation": 1, "secant_stiffness": 1},  # D k / (pi A^2)
}


class Chart(NamedTuple):
    """The map.

    Attributes
    ----------
    strips : (n, 4) their eta, A/(mu F_N a), mu and nu
    ratios : (n,) to finite elements, by candidate and quantity
    linear_ms : time of a warm run with linear kinematics, by candidate
    exact_over_linear : how much longer it takes with exact ones, by rung
    """

    strips: np.ndarray
    ratios: dict[str, dict[str, np.ndarray]]
    linear_ms: dict[str, float]
    exact_over_linear: dict[str, float]


@functools.cache
def chart() -> Chart:
    """The map that ships."""
    record = json.loads(Path(__file__).with_name("measured.json").read_text(encoding="utf-8"))
    strips = np.array([record["strips"][key] for key in ("eta", "A", "mu", "nu")]).T
    ratios = {
        name: {quantity: np.array(values) for quantity, values in own.items()}
        for name, own in record["ratios"].items()
    }
    return Chart(strips, ratios, record["linear_ms"], record["exact_over_linear"])


def place(scene: Scene) -> np.ndarray | str:
    """Where a scene is on the map, its (4,) numbers; or why it is not."""
    strip, contact, load = scene.strip, scene.contact, scene.load
    sharp = isinstance(contact.law, SharpSlip) or (
        isinstance(contact.law, ElasticSlip) and float(contact.smoothing) >= SMOOTHEST
    )
    reasons = {
        "an energy of its own": scene.energy is not None,
        "layers": strip.layers is not None,
        "a curvature": strip.curvature is not None,
        "a far end that is not held": strip.far_end != "held",
        "a pressure that varies": contact.pressure.ndim > 0,
        "a pressure from below": contact.bottom_pressure.ndim > 0 or contact.bottom_pressure != 0,
        "a contact that is not rigid": contact.normal != "rigid",
        "a strip that may lift off": "w" in scene.model.fields,
        "displacement control": load.control != "force",
        "fewer than two cycles": load.cycles < 2,
        "a smooth friction law": not sharp,
        "a soft contact": float(contact.stick_stiffness) < STIFFEST,
        "constants of its own": scene.model.constants != "consistent",
        "an assumed squeeze strain": scene.model.squeeze != "field",
    }
    for reason, holds in reasons.items():
        if holds:
            return reason
    half = 0.5 * float(strip.length)
    mu, nu = float(contact.friction), float(np.asarray(strip.poisson_ratio))
    if strip.plane == "stress":  # as plane strain with the ratio that has the same E'/G
        nu = nu / (1.0 + nu)
    amplitude = float(load.amplitude) / max(mu * float(contact.pressure) * half, 1e-300)
    here = np.array([float(strip.height_ratio), amplitude, mu, nu])
    for (name, (low, high)), value in zip(RANGES.items(), here, strict=True):
        if not low <= value <= high:
            return f"{name} = {value:.4g}, beyond {low:g} to {high:g}"
    return here


def estimates(here: np.ndarray, quantity: str) -> dict[str, float]:
    """Estimated relative error of every candidate at a place of the map."""
    known = chart()
    at, strips = _coordinates(here[None])[0], _coordinates(known.strips)
    distance = np.linalg.norm(strips - at, axis=1)
    near = np.argsort(distance)[:NEIGHBOURS]
    reach = distance[near]
    weight = np.maximum(1.0 - (reach / reach[-1]) ** 2, 1e-3)
    design = np.column_stack([np.ones(NEIGHBOURS), strips[near] - at])
    root = np.sqrt(weight)[:, None]
    powers = QUANTITIES[quantity]
    logs = np.column_stack(
        [sum(np.log(own[q][near]) * p for q, p in powers.items()) for own in known.ratios.values()]
    )
    planes, *_ = np.linalg.lstsq(root * design, root * logs, rcond=1e-6)
    left = logs - design @ planes
    freedom = NEIGHBOURS / (NEIGHBOURS - design.shape[1])
    scatter = np.sqrt(freedom * np.sum(weight[:, None] * left**2, axis=0) / np.sum(weight))
    errors = np.abs(np.expm1(planes[0])) + CAUTION * scatter
    return dict(zip(known.ratios, map(float, errors), strict=True))


def suits(candidate: Candidate, scene: Scene) -> bool:
    """Whether the map's figures of a candidate hold for a scene's constants."""
    if candidate.section != "squeeze":
        return True
    return KAPPA_S[0] <= float(scene.strip.kappa_s) <= KAPPA_S[1]


def _coordinates(strips: np.ndarray) -> np.ndarray:
    eta, amplitude, mu, nu = strips.T
    ratio = np.log(amplitude / eta)
    return np.stack([ratio, amplitude, np.log(mu), nu], axis=1) / SCALES

"""Map of the rungs' errors: strips that were solved by finite elements and by every rung.

`measured.json` holds strips drawn at random over eta, A/(mu F_N a), mu and nu, with the ratio of
every candidate's figure to that of plane-strain finite elements (`calibration/map_ladder.py`).  The
error at another strip follows from its nearest neighbours: a local plane through the logarithms of
their ratios, and their scatter about it.
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

# Distances of log(A/eta), A, log(mu) and nu over which errors change by about as much.
SCALES = np.array([0.15, 0.5, 0.7, 0.3])
NEIGHBOURS = 14
CAUTION = 2.5  # multiple of the scatter that is added to an error or to a doubt
RANGES = {
    "eta": (0.008, 0.45),
    "A/(mu F_N a)": (0.08, 1.95),
    "mu": (0.045, 0.55),
    "nu": (0.0, 0.455),
}
KAPPA_S = (0.4, 0.48)  # range of kappa_s for which the map, measured at .44, holds
DOUBTS = (1e-4, 10.0)  # range within which estimated errors matter
LEAST_STIFFNESS, LEAST_SMOOTHING = 200.0, 16.0  # alpha, m below which the contact is too soft
QUANTITIES = {
    "dissipation": {"dissipation": 1},
    "secant_stiffness": {"secant_stiffness": 1},
    "loss_factor": {"dissipation": 1, "secant_stiffness": 1},  # D k / (pi A^2)
}


class ErrorMap(NamedTuple):
    """Strips of the map, the errors of all candidates on them, and their times.

    Attributes
    ----------
    strips : (n, 4) eta, A/(mu F_N a), mu and nu of the strips
    ratios : (n,) ratios to finite elements, by candidate and quantity
    doubts : (n,) errors of the dissipation by which runs doubt themselves, by candidate
    linear_ms : time of a warm run with linear kinematics [ms], by candidate
    exact_over_linear : ratio of the times with exact and linear kinematics, by rung
    """

    strips: np.ndarray
    ratios: dict[str, dict[str, np.ndarray]]
    doubts: dict[str, np.ndarray]
    linear_ms: dict[str, float]
    exact_over_linear: dict[str, float]


@functools.cache
def load() -> ErrorMap:
    """Map in the file `measured.json`."""
    record = json.loads(Path(__file__).with_name("measured.json").read_text(encoding="utf-8"))
    strips = np.array([record["strips"][key] for key in ("eta", "A", "mu", "nu")]).T
    ratios = {
        name: {quantity: np.array(values) for quantity, values in own.items()}
        for name, own in record["ratios"].items()
    }
    doubts = {name: np.clip(values, *DOUBTS) for name, values in record["doubts"].items()}
    return ErrorMap(strips, ratios, doubts, record["linear_ms"], record["exact_over_linear"])


def place(scene: Scene) -> np.ndarray | str:
    """Coordinates (4,) of a scene on the map, eta, A/(mu F_N a), mu and nu; or why it is off."""
    strip, contact, load = scene.strip, scene.contact, scene.load
    sharp = isinstance(contact.law, SharpSlip) or (
        isinstance(contact.law, ElasticSlip) and float(contact.smoothing) >= LEAST_SMOOTHING
    )
    reasons = {
        "an energy of its own": scene.energy is not None,
        "layers": strip.layers is not None,
        "a curvature": strip.curvature is not None,
        "a second member": scene.member.support != "none",
        f"load.entry = {scene.load.entry}": scene.load.entry != "traction",
        "a far end that is not guided": strip.far_end != "guided",
        "a pressure that varies": contact.pressure.ndim > 0,
        "a pressure from below": contact.bottom_pressure.ndim > 0 or contact.bottom_pressure != 0,
        "a contact that is not rigid": contact.normal != "rigid",
        "a strip that may lift off": "w" in scene.model.given("fields"),
        "displacement control": load.control != "force",
        "fewer than two cycles": load.cycles < 2,
        "a smooth friction law": not sharp,
        "a soft contact": float(contact.stick_stiffness) < LEAST_STIFFNESS,
        "constants of its own": scene.model.constants != "consistent",
        "an assumed squeeze strain": scene.model.squeeze != "field",
    }
    for reason, holds in reasons.items():
        if holds:
            return reason
    half = 0.5 * float(strip.length)
    mu, nu = float(contact.friction), float(np.asarray(strip.poisson_ratio))
    if strip.plane == "stress":  # equals plane strain with the Poisson's ratio of the same E'/G
        nu = nu / (1.0 + nu)
    amplitude = float(load.amplitude) / max(mu * float(contact.pressure) * half, 1e-300)
    coordinates = np.array([float(strip.height_ratio), amplitude, mu, nu])
    for (name, (low, high)), value in zip(RANGES.items(), coordinates, strict=True):
        if not low <= value <= high:
            return f"{name} = {value:.4g}, beyond {low:g} to {high:g}"
    return coordinates


def estimates(coordinates: np.ndarray, quantity: str) -> dict[str, float]:
    """Estimated relative error of every candidate at coordinates (4,) of the map."""
    known, powers = load(), QUANTITIES[quantity]
    logs = [sum(np.log(own[q]) * p for q, p in powers.items()) for own in known.ratios.values()]
    value, scatter = _at(coordinates, np.column_stack(logs))
    errors = np.abs(np.expm1(value)) + CAUTION * scatter
    return dict(zip(known.ratios, map(float, errors), strict=True))


def doubts(coordinates: np.ndarray) -> dict[str, float]:
    """Error by which a run of every candidate is likely to doubt itself, at coordinates (4,)."""
    known = load()
    value, scatter = _at(coordinates, np.log(np.column_stack(list(known.doubts.values()))))
    return dict(zip(known.doubts, map(float, np.exp(value + CAUTION * scatter)), strict=True))


def _at(coordinates: np.ndarray, logs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values at coordinates (4,) of quantities (n, m) known on the map's strips, and scatter."""
    at, strips = _scaled(coordinates[None])[0], _scaled(load().strips)
    distance = np.linalg.norm(strips - at, axis=1)
    near = np.argsort(distance)[:NEIGHBOURS]
    reach = distance[near]
    weight = np.maximum(1.0 - (reach / reach[-1]) ** 2, 1e-3)
    design = np.column_stack([np.ones(NEIGHBOURS), strips[near] - at])
    root = np.sqrt(weight)[:, None]
    planes, *_ = np.linalg.lstsq(root * design, root * logs[near], rcond=1e-6)
    residual = logs[near] - design @ planes
    freedom = NEIGHBOURS / (NEIGHBOURS - design.shape[1])
    scatter = np.sqrt(freedom * np.sum(weight[:, None] * residual**2, axis=0) / np.sum(weight))
    return planes[0], scatter


def suits(candidate: Candidate, scene: Scene) -> bool:
    """True if the errors of a candidate on the map hold for a scene's constants."""
    if candidate.section != "squeeze":
        return True
    return KAPPA_S[0] <= float(scene.strip.kappa_s) <= KAPPA_S[1]


def _scaled(strips: np.ndarray) -> np.ndarray:
    """Coordinates (n, 4) in which equal distances mean similar changes of the errors."""
    eta, amplitude, mu, nu = strips.T
    ratio = np.log(amplitude / eta)
    return np.stack([ratio, amplitude, np.log(mu), nu], axis=1) / SCALES

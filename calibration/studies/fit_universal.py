"""One pair (kappa_s, alpha) for strips of any height, fitted to their dissipation.

The friction is known.  The logarithm of the dissipation of five strips by finite elements, at
amplitudes of 0.3 and more, is fitted with one squeeze-shear factor and one stick stiffness for all
strips, for several smoothings m of Coulomb's law: a smooth law imitates a corner that slips a
little at any load.  A sixth strip that is not fitted checks the result.  Takes some minutes.
"""

from typing import Any

import numpy as np
from tqdm import tqdm

import jbeamshell as jb
from calibration.strip import in_load_steps
from calibration.tables import energies
from jbeamshell import identify
from jbeamshell.measured.curves import DissipationCurve
from jbeamshell.measured.example import HEIGHT_RATIOS

FREE = ("strip.kappa_s", "contact.stick_stiffness")
START = {"strip.kappa_s": 1.0, "contact.stick_stiffness": 8.0}
SMOOTHINGS = (4.0, 6.0, 8.0, 11.0, 16.0)
CHOSEN = 8.0
UNSEEN = 0.01
LEAST_AMPLITUDE = 0.3
STRONG = 0.3  # of the cubic law: strips that dissipate more are what a joint is about


def curve(height_ratio: float) -> tuple[DissipationCurve, np.ndarray]:
    """Dissipation of a strip by finite elements, and its ratio to the cubic law."""
    own = [
        [row[name] for name in ("A", "D", "ratio")]
        for (eta, amplitude), row in energies().items()
        if eta == height_ratio and amplitude >= LEAST_AMPLITUDE
    ]
    amplitude, dissipation, ratio = np.transpose(own)
    return DissipationCurve(amplitude, dissipation, label=f"eta = {height_ratio:g}"), ratio


def specimen(height_ratio: float, values: dict[str, float]) -> identify.Specimen:
    """Strip with its curve; linear kinematics change the dissipation by 0.1 %."""
    base = {"model.kinematics": "linear", "strip.height_ratio": height_ratio}
    return identify.Specimen(
        in_load_steps().replace(base | values), curve(height_ratio)[0], f"eta = {height_ratio:g}"
    )


def errors(fit: identify.Fit) -> np.ndarray:
    """Logarithm of the model's dissipation over that of finite elements, (strips, amplitudes)."""
    pairs = zip(fit.model, fit.data, strict=True)
    return np.array([np.log(m.dissipation / d.dissipation) for m, d in pairs])


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def study(smoothing: float) -> dict[str, Any]:
    """Fit all strips together with one smoothing."""
    values = START | {"contact.smoothing": smoothing}
    fit = identify.fit([specimen(eta, values) for eta in HEIGHT_RATIOS], free=FREE, throw=False)
    error = errors(fit)
    strong = np.array([curve(eta)[1] for eta in HEIGHT_RATIOS]) > STRONG
    unseen = specimen(UNSEEN, fit.values | {"contact.smoothing": smoothing})
    return fit.figures() | {
        "smoothing": smoothing,
        "rms_all": rms(error),
        "rms_strong": rms(error[strong]),
        "worst_strong": float(np.abs(error[strong]).max()),
        "cells": [int(error.size), int(strong.sum())],
        "log_error": dict(zip(map(str, HEIGHT_RATIOS), error.tolist(), strict=True)),
        "rms_unseen": rms(predicted(unseen)),
    }


def predicted(strip: identify.Specimen) -> np.ndarray:
    """Logarithm of the model's dissipation over that of finite elements, without a fit."""
    data = strip.data
    model = [
        float(jb.solve(strip.scene.replace({"load.amplitude": float(a)})).dissipation)
        for a in data.amplitude
    ]
    return np.log(model / data.dissipation)


def measure() -> dict[str, Any]:
    """Fit with all smoothings."""
    fits = [study(smoothing) for smoothing in tqdm(SMOOTHINGS, disable=None, unit="fit")]
    return {"chosen_smoothing": CHOSEN, "unseen": UNSEEN, "fits": fits}


def tell(record: dict[str, Any]) -> str:
    """Values and errors, a line for each smoothing."""
    lines = []
    for one in record["fits"]:
        kappa_s, alpha = (one["values"][key]["value"] for key in FREE)
        every, strong = one["cells"]
        lines.append(
            f"m = {one['smoothing']:<4g} kappa_s = {kappa_s:.3f}, alpha = {alpha:.3f}: rms error "
            f"of log D {100 * one['rms_all']:.1f} % ({every} cells), {100 * one['rms_strong']:.2f} "
            f"% where D exceeds {STRONG:g} of the cubic law ({strong}), unseen strip "
            f"{100 * one['rms_unseen']:.2f} %; {one['status']}"
        )
    return "\n".join(lines)

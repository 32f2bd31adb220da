"""Fits of the squeeze-shear factor kappa_s to a squeezed strip.

kappa_s alone is fitted to the mean sigma_y of a strip squeezed over its middle (finite elements;
Brink 2015, section 4.7.2), for both sets of constants, several windows and several grids.  What
loops of friction tell of it is seen in fit_finite_elements and recover_under_noise.
"""

from typing import Any

import numpy as np
from tqdm import tqdm

from jbeamshell import identify
from jbeamshell.measured.curves import SqueezeCurve
from jbeamshell.measured.example import data_folder
from jbeamshell.reference import squeeze_decay_length
from jbeamshell.scene import library

EDGE = 50.0  # mm, where the pressure ends
START = {"consistent": 1.0, "printed": 0.05}
WINDOW = 5.0  # mm, to either side of the edge
WINDOWS = (1.0, 2.0, 10.0, 20.0)
GRIDS = (201, 401, 801)


def squeezed_curve() -> SqueezeCurve:
    """Mean sigma_y of the squeezed strip by finite elements."""
    path = data_folder() / "squeeze" / "b2.csv"
    table = np.genfromtxt(path, delimiter=",", names=True)
    return SqueezeCurve(table["x_mm"], table["sy_avg"], label="finite elements")


def fitted(half_window: float, nodes: int, constants: str) -> dict[str, Any]:
    """Figures of a fit in a window around the edge of the load."""
    start = {"strip.kappa_s": START[constants], "model.constants": constants, "model.nodes": nodes}
    scene = library.squeezed().replace(start)
    curve = squeezed_curve().between(EDGE - half_window, EDGE + half_window)
    fit = identify.fit(curve, scene, ["strip.kappa_s"])
    kappa_s, strip = fit.values["strip.kappa_s"], scene.strip
    per_consistent = 1.0 if constants == "consistent" else 24.0
    decay = squeeze_decay_length(strip.half_height, per_consistent * kappa_s, strip.poisson_ratio)
    return {
        "constants": constants,
        "half_window_mm": half_window,
        "nodes": nodes,
        "points": curve.x.size,
        "kappa_s": kappa_s,
        "error": fit.errors["strip.kappa_s"],
        "rms_MPa": fit.misfit * float(np.ptp(curve.stress)),
        "decay_length_mm": float(decay),
        "status": fit.status.name.lower(),
        "model_runs": fit.model_runs,
    }


def measure() -> dict[str, Any]:
    """Run all fits."""
    cases = [(WINDOW, nodes, constants) for constants in START for nodes in GRIDS]
    cases += [(window, GRIDS[-1], "consistent") for window in WINDOWS]
    return {"squeeze": [fitted(*case) for case in tqdm(cases, disable=None, unit="fit")]}


def tell(record: dict[str, Any]) -> str:
    """Figures, a line for each fit."""
    return "\n".join(
        f"{row['constants']:10s} {row['nodes']} nodes, {EDGE:g} +- {row['half_window_mm']:g} mm: "
        f"kappa_s = {row['kappa_s']:.5f} +- {row['error']:.5f}, "
        f"lam = {row['decay_length_mm']:.4f} mm, rms {row['rms_MPa']:.3f} MPa"
        for row in record["squeeze"]
    )

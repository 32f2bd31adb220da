"""Segalman's four parameters from geometry alone, over height, friction, nu and pressure patch.

    python calibration/four_parameters.py

writes four_parameters.json beside this file (a quarter of an hour).  Every scene is plane
elasticity in steady cycles of .1 to .95 of gross slip.  A row holds the exponents of D ~ F^n, the
parameters of the four-parameter Iwan model that is nearest to the scene's displacement and
dissipation, those of the short formula of `jbeamshell.laws.iwan4_of_strip`, the errors of both, and
those of `jbeamshell.reference.slip_energy`.
`python -m calibration.charts.four_parameters` draws it.
"""

import json
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from provenance import provenance  # noqa: E402

import jbeamshell as jb  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.dynamics import four_parameters  # noqa: E402

HERE = Path(__file__).parent
HEIGHTS = (0.01, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4)
FRICTIONS = (0.05, 0.1, 0.3)
CURVES = ("force", "displacement", "dissipation", "exponents", "energy_errors")
EDGES = {"even": ("loaded-end", 1.0), "middle": ("inside", 0.5)}  # and the pressed part of L
P = 10.0
PATCHES: dict[str, Any] = {
    "even": P,
    "middle": [[0, 0.0], [0.5, 0.0], [0.5, 2 * P], [1.5, 2 * P], [1.5, 0.0], [2, 0.0]],
    "tapered": [[0, 0.1 * P], [1, 1.9 * P], [2, 0.1 * P]],
}


def scenes() -> Iterator[tuple[dict[str, Any], jb.Scene]]:
    """Varied numbers of a row, and its scene."""
    for patch, pressure in PATCHES.items():
        scene = jb.library.standard().replace(
            {"model.section": "plane", "contact.pressure": pressure}
        )
        for eta in HEIGHTS:
            cases = [(mu, 0.3) for mu in FRICTIONS]
            cases += [(0.1, nu) for nu in (0.0, 0.45) if eta in (0.05, 0.2, 0.4)]
            for mu, nu in cases:
                given = {"strip.height_ratio": eta, "contact.friction": mu}
                about = {"patch": patch, "eta": eta, "mu": mu, "nu": nu}
                yield about, scene.replace(given | {"strip.poisson_ratio": nu})
    lap = jb.library.single_lap().replace({"model.section": "plane"})
    for eta in (0.05, 0.1, 0.2, 0.3):
        for mu in (0.1, 0.3):
            given = {"strip.height_ratio": eta, "contact.friction": mu}
            yield {"patch": "single lap", "eta": eta, "mu": mu, "nu": 0.3}, lap.replace(given)


def row(scene: jb.Scene) -> dict[str, Any]:
    """Curves, parameters and errors of a scene; forces over F_S, displacements over F_S L/EA."""
    found = four_parameters(scene)
    law, slip = found.law, float(found.law.slip_force)
    unit = slip * float(scene.strip.length / scene.strip.axial_stiffness)
    off = np.abs(found.dissipation_error)
    return {
        "force": (found.force / slip).tolist(),
        "displacement": (found.displacement / unit).tolist(),
        "dissipation": (found.dissipation / (slip * unit)).tolist(),
        "exponents": found.exponents.tolist(),
        "fitted": [float(law.stiffness) * unit / slip, float(law.chi), float(law.beta)],
        "fitted_errors": [float(np.median(off)), float(np.max(off))],
        "fitted_displacement_error": float(np.max(np.abs(found.displacement_error))),
    }


def formula_errors(scene: jb.Scene, each: dict[str, Any]) -> dict[str, Any]:
    """Median and worst error of D by the short formula; nothing where it has none."""
    try:
        law = jb.laws.iwan4_of_strip(scene)
    except jb.InputError:
        return {}
    slip = float(law.slip_force)
    unit = slip * float(scene.strip.length / scene.strip.axial_stiffness)
    u = law.displacement(slip * np.array(each["force"]))
    off = np.abs(np.asarray(law.dissipation(u)) / (slip * unit) / each["dissipation"] - 1.0)
    softer = np.abs(np.asarray(u) / unit / each["displacement"] - 1.0)
    numbers = [float(law.stiffness) * unit / slip, float(law.chi), float(law.beta)]
    return {
        "formula": numbers,
        "formula_errors": [float(np.median(off)), float(np.max(off))],
        "formula_displacement_error": float(np.max(softer)),
    }


def energy_errors(about: dict[str, Any], each: dict[str, Any]) -> dict[str, Any]:
    """Errors of D by the bar's energy and the factor of height; nothing for other patches."""
    if about["patch"] not in EDGES:
        return {}
    edge, part = EDGES[about["patch"]]
    force, half = np.array(each["force"]), 0.5 * about["eta"]  # L = E' 2H = F_S = 1
    energy = np.asarray(jb.reference.slip_energy(force, 1.0 / part, 1.0, half, edge))
    return {"energy_errors": (energy / each["dissipation"] - 1.0).tolist()}


def main() -> None:
    """Write the record."""
    warnings.simplefilter("ignore", jb.DoubtfulWarning)
    rows: list[dict[str, Any]] = []
    failed: list[dict[str, Any]] = []
    for about, scene in scenes():
        try:
            each = row(scene)
        except jb.UnconvergedError as error:
            failed.append(about | {"why": str(error)})
            continue
        further = formula_errors(scene, each) | energy_errors(about, each)
        rows.append(about | each | further)
        print({key: rows[-1][key] for key in rows[-1] if key not in CURVES}, flush=True)
    record = {"about": provenance(), "rows": rows, "failed": failed}
    write_text(HERE / "four_parameters.json", json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()

"""These finite elements against those that ship as data: three loops, and a contact that recedes.

The data were made by an independent solver with exact Coulomb friction and contact, on meshes
graded a thousand times finer (see calibration/data).  Writes checked.json beside this file; takes
some minutes:

    python -m calibration.finite_elements.check
"""

from __future__ import annotations

import csv
import json
import time
from pathlib import Path
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

import jbeamshell as jb  # noqa: E402
from calibration.finite_elements import program, solve  # noqa: E402
from calibration.provenance import provenance  # noqa: E402
from calibration.strip import in_load_steps  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.measured.example import data_folder  # noqa: E402
from jbeamshell.scene import library  # noqa: E402

HERE = Path(__file__).parent
CASES = ((0.1126, 0.7855), (0.1126, 1.6), (0.2358, 1.0))  # height ratio, amplitude
CYCLE = {"load.cycles": 1, "load.steps_per_half_cycle": 20}
RECEDING = {"contact_end": 50.779, "reaction_max": 103.12, "lift_slope": 1.9858e-4}


def reference() -> dict[tuple[float, float], float]:
    """Dissipation by (eta, A), per unit width."""
    with open(data_folder() / "energy.csv", newline="", encoding="utf-8") as file:
        return {(float(r["eta"]), float(r["A"])): float(r["D"]) for r in csv.DictReader(file)}


def timed(scene: jb.Scene, **options: Any) -> tuple[jb.History, dict[str, Any]]:
    """A history, and what it took."""
    begin = time.perf_counter()
    history = solve(scene, **options)
    return history, {
        "nodes_on_the_base": history.x.size,
        "elements_along_x": history.middles.size,
        "levels": history.force.size,
        "iterations": int(history.iterations.sum()),
        "wall_s": round(time.perf_counter() - begin, 1),
    }


def loop(height_ratio: float, amplitude: float, elements: str) -> dict[str, Any]:
    """One loop against the data."""
    change = {"strip.height_ratio": height_ratio, "load.amplitude": amplitude} | CYCLE
    history, took = timed(in_load_steps().replace(change), elements=elements)
    dissipation, area = float(history.dissipation), float(history.dissipation_loop)
    there = reference()[height_ratio, amplitude]
    return {
        "eta": height_ratio,
        "A": amplitude,
        "elements": elements,
        "D": dissipation,
        "D_reference": there,
        "D_over_reference": dissipation / there,
        "loop_area_over_reference": area / there,
        "slip_work_over_loop_area": dissipation / area,
        "closure": float(history.closure),
        **took,
    }


def receding() -> dict[str, Any]:
    """The frictionless strip that lifts off beyond its load, against the data of theory."""
    history, took = timed(library.receding())
    found = {name: float(getattr(history, name)[-1]) for name in RECEDING}
    return {"found": found, "reference": RECEDING, "elements": "quadratic", **took}


def main() -> None:
    """Run all, print a line each, write the record."""
    loops = []
    for kind in ("quadratic", "linear"):
        for case in CASES if kind == "quadratic" else CASES[:1]:
            loops.append(loop(*case, kind))
            print({key: loops[-1][key] for key in ("eta", "A", "D_over_reference", "wall_s")})
    record = {
        "provenance": provenance() | {"calculix": program.version(program.find_program())},
        "steps": CYCLE,
        "D_source": "calibration/data/energy.csv",
        "loops": loops,
        "receding": receding(),
    }
    print(record["receding"])
    write_text(HERE / "checked.json", json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()

"""These finite elements against others, and against plane elasticity on the contact line.

The data that ship were made by an independent solver with exact Coulomb friction and contact, on
meshes graded a thousand times finer (see calibration/data).  Three loops and a contact that recedes
are compared with them.  Strips under each entry of the force are compared with them and with plane
elasticity.  Writes checked.json beside this file; takes an hour:

    python -m calibration.finite_elements.check
"""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Iterator
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
STEADY = CYCLE | {"load.cycles": 2}  # the first cycle does not close
NODES = 129  # of plane elasticity
REFINEMENTS = (1.0, 2.0)
# Height ratio, amplitude and friction of the strips that are solved under every entry
STRIPS = (
    (0.1126, 0.4359, 0.1),
    (0.1126, 0.7855, 0.1),
    (0.2358, 0.7855, 0.1),
    (0.1126, 1.3077, 0.3),
)
BEYOND = (0.0, 4.0)  # H that a member goes on in the data; other entries have none
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


def entries() -> Iterator[tuple[jb.Scene, dict[str, float]]]:
    """Strips under each entry of the force, with D and K of the data that ship.

    K is that of the displacement which is conjugate to the force, as a history has it.
    """
    with open(data_folder() / "entry.csv", newline="") as file:
        for row in csv.DictReader(file):
            place = tuple(float(row[name]) for name in ("eta", "A", "mu"))
            if place in STRIPS and float(row["overhang_over_H"]) in BEYOND:
                keys = ("strip.height_ratio", "load.amplitude", "contact.friction")
                values = dict(zip(keys, place, strict=True)) | {"load.entry": row["entry"]}
                there = {"D": float(row["D"]), "K": float(row["K_conjugate"])}
                yield jb.Scene().replace(values), there


def entry(scene: jb.Scene, there: dict[str, float]) -> dict[str, Any]:
    """One entry of the force, by CalculiX on two meshes, beside both others."""
    plane = jb.solve(scene.replace({"model.section": "plane", "model.nodes": NODES}))
    others = {
        "reference": there,
        "plane": {"D": float(plane.dissipation), "K": float(plane.secant_stiffness)},
    }
    row: dict[str, Any] = {
        "eta": float(scene.strip.height_ratio),
        "A": float(scene.load.amplitude),
        "mu": float(scene.contact.friction),
        "entry": scene.load.entry,
    } | others
    for refinement in REFINEMENTS:
        history, took = timed(scene.replace(STEADY), refinement=refinement)
        found = {"D": float(history.dissipation), "K": float(history.secant_stiffness)}
        row[f"refinement {refinement:g}"] = found | ratios(found, others) | took
    return row


def ratios(found: dict[str, float], others: dict[str, dict[str, float]]) -> dict[str, float]:
    """D and K over those of other solutions."""
    return {
        f"{name}_over_{other}": value / figures[name]
        for other, figures in others.items()
        for name, value in found.items()
    }


def receding() -> dict[str, Any]:
    """The frictionless strip that lifts off beyond its load, against the data of theory."""
    scene = library.receding().replace({"load.entry": "traction"})  # nothing pulls
    history, took = timed(scene)
    found = {name: float(getattr(history, name)[-1]) for name in RECEDING}
    return {"found": found, "reference": RECEDING, "elements": "quadratic", **took}


def main() -> None:
    """Run all, print a line each, write the record."""
    loops = []
    for kind in ("quadratic", "linear"):
        for case in CASES if kind == "quadratic" else CASES[:1]:
            loops.append(loop(*case, kind))
            print({key: loops[-1][key] for key in ("eta", "A", "D_over_reference", "wall_s")})
    strips = []
    for scene, there in entries():
        strips.append(row := entry(scene, there))
        print(row)
    record = {
        "provenance": provenance() | {"calculix": program.version(program.find_program())},
        "steps": CYCLE,
        "D_source": "calibration/data/energy.csv",
        "loops": loops,
        "entries": strips,
        "receding": receding(),
    }
    print(record["receding"])
    write_text(HERE / "checked.json", json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()

"""These finite elements against others, and against plane elasticity on the contact line.

Three loops and a contact that recedes are those of the data that ship.  The data were made by an
independent solver with exact Coulomb friction and contact, on meshes graded a thousand times finer
(see calibration/data).  The entries of the force are beside both: plane elasticity, and that
independent solver.  Writes checked.json beside this file; takes an hour:

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
STEADY = CYCLE | {"load.cycles": 2}  # the first cycle does not close
NODES = 129  # of plane elasticity
REFINEMENTS = (1.0, 2.0)
# By eta, A and mu: D and 2A/(u_max - u_min) by plane-strain finite elements (QM6, condensed to the
# contact, graded to 5e-6 H at the corner, 60 steps from 0 to A).  Their member goes on by 4 H, and
# its u is the mean over the section X = L, which is not conjugate to F: its stiffness is left out.
ENTRIES: dict[tuple[float, float, float], dict[str, tuple[float, float | None]]] = {
    (0.1126, 0.4359, 0.1): {
        "traction": (5.9694981e-07, 118985.18),
        "face": (6.2956419e-07, 118889.29),
        "guided": (1.2359233e-06, 121549.93),
        "member": (6.2420848e-07, None),
    },
    (0.1126, 0.7855, 0.1): {
        "traction": (7.2053529e-06, 79436.703),
        "face": (7.2317706e-06, 79437.781),
        "guided": (8.0299188e-06, 79408.582),
        "member": (7.2508821e-06, None),
    },
    (0.2358, 0.7855, 0.1): {
        "traction": (2.4658745e-06, 60440.344),
        "face": (2.8097819e-06, 60330.783),
        "guided": (7.1877445e-06, 63392.814),
        "member": (2.6606022e-06, None),
    },
    (0.1126, 1.3077, 0.3): {
        "traction": (5.315044e-06, 119624.46),
        "face": (5.6115958e-06, 119522.76),
        "guided": (1.1175356e-05, 121538.02),
        "member": (5.4990175e-06, None),
    },
}
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


def entry(scene: jb.Scene, there: tuple[float, float | None]) -> dict[str, Any]:
    """One entry of the force, by CalculiX on two meshes, beside both others."""
    plane = jb.solve(scene.replace({"model.rung": "plane", "model.nodes": NODES}))
    row: dict[str, Any] = {
        "eta": float(scene.strip.height_ratio),
        "A": float(scene.load.amplitude),
        "mu": float(scene.contact.friction),
        "entry": scene.load.entry,
        "reference": dict(zip(("D", "K"), there, strict=True)),
        "plane": {"D": float(plane.dissipation), "K": float(plane.secant_stiffness)},
    }
    for refinement in REFINEMENTS:
        history, took = timed(scene.replace(STEADY), refinement=refinement)
        found = {"D": float(history.dissipation), "K": float(history.secant_stiffness)}
        beside = {
            f"{name}_over_{other}": value / row[other][name]
            for other in ("plane", "reference")
            for name, value in found.items()
            if row[other][name] is not None
        }
        row[f"refinement {refinement:g}"] = found | beside | took
    return row


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
    entries = []
    for (height_ratio, amplitude, friction), rows in ENTRIES.items():
        for kind, there in rows.items():
            change = {"strip.height_ratio": height_ratio, "load.amplitude": amplitude}
            change |= {"contact.friction": friction, "load.entry": kind}
            entries.append(row := entry(jb.Scene().replace(change), there))
            print(kind, change, row["refinement 1"], row["refinement 2"])
    record = {
        "provenance": provenance() | {"calculix": program.version(program.find_program())},
        "steps": CYCLE,
        "D_source": "calibration/data/energy.csv",
        "loops": loops,
        "entries": entries,
        "receding": receding(),
    }
    print(record["receding"])
    write_text(HERE / "checked.json", json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()

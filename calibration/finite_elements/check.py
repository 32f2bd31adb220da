"""These finite elements against others, and against plane elasticity on the contact line.

The data that ship were made by an independent solver with exact Coulomb friction and contact, on
meshes graded a thousand times finer (see calibration/data).  Three loops and a contact that recedes
are compared with them.  Strips under each entry of the force are compared with them and with plane
elasticity.  Takes an hour.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import jbeamshell as jb
from calibration.finite_elements import program, solve
from calibration.strip import in_load_steps
from calibration.tables import energies, rows
from jbeamshell.scene import library

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
    there = energies()[height_ratio, amplitude]["D"]
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
    for row in rows("entry.csv"):
        place = row["eta"], row["A"], row["mu"]
        if place in STRIPS and row["overhang_over_H"] in BEYOND:
            keys = ("strip.height_ratio", "load.amplitude", "contact.friction")
            values = dict(zip(keys, place, strict=True)) | {"load.entry": row["entry"]}
            yield jb.Scene().replace(values), {"D": row["D"], "K": row["K_conjugate"]}


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


def measure() -> dict[str, Any]:
    """Run all, and print a line each."""
    loops = []
    for kind in ("quadratic", "linear"):
        for case in CASES if kind == "quadratic" else CASES[:1]:
            loops.append(loop(*case, kind))
            print({key: loops[-1][key] for key in ("eta", "A", "D_over_reference", "wall_s")})
    strips = []
    for scene, there in entries():
        strips.append(row := entry(scene, there))
        print(row)
    return {
        "calculix": program.version(program.find_program()),
        "steps": CYCLE,
        "D_source": "calibration/data/energy.csv",
        "loops": loops,
        "entries": strips,
        "receding": receding(),
    }

"""Compute the comparisons, section by section, and draw them."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import numpy as np
from tqdm import tqdm

import jbeamshell as jb

jb.configure(cache=False)
jax.config.update("jax_enable_x64", True)

from calibration import charts  # noqa: E402
from calibration.methods import (  # noqa: E402
    contacts,
    controls,
    events,
    grids,
    laws,
    shooting,
    solvers,
    strips,
)
from calibration.provenance import provenance  # noqa: E402
from jbeamshell import plotting  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402

HERE = Path(__file__).parent.parent
RECORD, PICTURE = HERE / "methods.json", HERE / "methods.png"
STEPS = [2, 10, 40, 320]
FEWER_STEPS = [10, 40]  # of all scenes but the first
LAW_STRIPS, NODES = ("standard", "thick", "near gross slip"), 41  # on which laws are compared
STRIPS = 200
Section = dict[str, Any]


def compared_laws(quick: bool) -> Section:
    """Dissipation over steps per half cycle, and drift, of every law on every scene."""
    rows = []
    names = LAW_STRIPS[:1] if quick else LAW_STRIPS
    pairs = [(name, law) for name in names for law in laws.LAWS]
    for name, law in tqdm(pairs, desc="laws", disable=None):
        steps = STEPS if name == LAW_STRIPS[0] and not quick else FEWER_STEPS
        work, area = zip(*laws.dissipations(name, law, steps, NODES), strict=True)
        row = {"scene": name, "law": law, "steps": steps, "dissipation": work, "area": area}
        rows.append(row | {"drift": laws.drift(name, law, nodes=NODES)})
    return {"rows": rows}


def compared_controls(quick: bool) -> Section:
    """Control of force, displacement and arc length, on the same loop and up to gross slip."""
    parts = [0.9, 1.1] if quick else [0.5, 0.9, 0.99, 0.999, 1.0, 1.1, 1.5, 2.0]
    pulls = [
        {"control": control, "far_end": end, "rows": controls.to_gross_slip(control, parts, end)}
        for end in ("guided", "free")
        for control in ("force", "displacement", "arc-length")
    ]
    return {"loop": controls.same_loop(), "pulls": pulls, "refusal": controls.refusal(1.1)}


def compared_solvers(quick: bool) -> Section:
    """Success, wrong answers and iterations over random strips."""
    values = solvers.random_strips(20 if quick else STRIPS)
    names = [solvers.LIBRARY, *solvers.METHODS]
    nothing = solvers.NEGLIGIBLE * np.array([solvers.bar_dissipation(one) for one in values])
    right, rows = None, []
    for name in tqdm(names, desc="solvers", disable=None):
        run = solvers.runner(name)
        runs = [jax.tree.map(float, run(one)) for one in values]
        if right is None:
            right = np.array([one.dissipation for one in runs])
        found = solvers.tally(runs, right, nothing)._asdict()
        rows.append({"method": name} | {k: strips.number(v) for k, v in found.items()})
        jax.clear_caches()
    return {
        "strips": len(values),
        "tries": solvers.TRIES,
        "wrong_by": solvers.WRONG,
        "rows": rows,
    }


def compared_grids(quick: bool) -> Section:
    """Locking, oscillation, and convergence of the dissipation."""
    heights = [float(eta) for eta in np.geomspace(0.005, 0.4, 4 if quick else 12)]
    sizes = [0.25, 0.5, 1.0, 2.0, 4.0, 8.0]
    counts, finest = ([41, 81], 161) if quick else ([21, 41, 81, 161, 321], 1281)
    locking = {name: [grids.cantilever(eta, name) for eta in heights] for name in grids.RULES}
    oscillation = {name: [grids.squeezed(size, name) for size in sizes] for name in grids.RULES}
    rows = []
    kinds = [
        (name, grid)
        for name in ("standard", "thick")
        for grid in ("finite-difference", "collocation")
    ]
    for name, grid in tqdm(kinds, desc="grids", disable=None):
        scene = strips.scene_of(name, steps_per_half_cycle=10)
        found = [grids.convergence(grid, nodes, scene) for nodes in (*counts, finest)]
        work, stiffness = np.array(found).T
        rows.append(
            {
                "scene": name,
                "grid": grid,
                "dissipation_off": (work[:-1] / work[-1] - 1.0).tolist(),
                "stiffness_off": (stiffness[:-1] / stiffness[-1] - 1.0).tolist(),
            }
        )
    return {
        "heights": heights,
        "locking": locking,
        "elements_per_height": sizes,
        "oscillation": oscillation,
        "nodes": counts,
        "finest": finest,
        "rows": rows,
    }


def compared_steps(quick: bool) -> Section:
    """Load steps against the exact path from event to event."""
    counts = [1, 4] if quick else [1, 2, 4, 10, 40, 160]
    rows = []
    for name in tqdm(list(strips.STRIPS)[: 1 if quick else None], desc="events", disable=None):
        scene = strips.scene_of(name, 41)
        exact, stiffness, changes = events.dissipation(scene)
        found = [
            jb.solve(scene.replace({"load.steps_per_half_cycle": n}), throw=False) for n in counts
        ]
        rows.append(
            {
                "scene": name,
                "dissipation": exact,
                "events": changes,
                "off": [strips.number(h.dissipation / exact - 1.0) for h in found],
                "area_off": [strips.number(h.dissipation_loop / exact - 1.0) for h in found],
                "stiffness_off": [
                    strips.number(h.secant_stiffness / stiffness - 1.0) for h in found
                ],
            }
        )
    return {"steps": counts, "rows": rows}


def compared_shooting(quick: bool) -> Section:
    """Errors of shooting over the growth of its solutions."""
    lengths = [float(x) for x in np.geomspace(1.0, 100.0, 8 if quick else 25)]
    squeeze = [shooting.shoot_squeeze(x)._asdict() for x in lengths]
    stuck = []
    for alpha in (6.0, 1000.0):
        for eta in np.geomspace(0.02, 4.0, 8 if quick else 24):
            scene = strips.scene_of("standard").replace({"strip.height_ratio": float(eta)})
            unit = float(scene.strip.shear_modulus / scene.strip.half_height)
            shot = shooting.shoot(scene, alpha * unit)._asdict()
            shot = {key: strips.number(value) for key, value in shot.items()}
            stuck.append({"eta": float(eta), "alpha": alpha} | shot)
    return {"squeeze": squeeze, "stuck": stuck}


def compared_contacts(quick: bool) -> Section:
    """The active set against compliances."""
    stiffnesses = [None, *(float(k) for k in np.geomspace(1.0, 1e6, 3 if quick else 13))]
    return {
        "receding": [contacts.figures(k) for k in tqdm(stiffnesses, desc="contact", disable=None)],
        "clamp": [contacts.clamp(k) for k in tqdm(stiffnesses[::2], desc="clamp", disable=None)],
    }


SECTIONS: dict[str, Callable[[bool], Section]] = {
    "shooting": compared_shooting,
    "steps": compared_steps,
    "grids": compared_grids,
    "contacts": compared_contacts,
    "controls": compared_controls,
    "solvers": compared_solvers,
    "laws": compared_laws,
}


def main() -> None:
    """Compute what is missing, write it section by section, and draw it."""
    parser = argparse.ArgumentParser(prog="python -m calibration.methods", description=__doc__)
    parser.add_argument("--only", nargs="+", choices=SECTIONS, metavar="SECTION")
    parser.add_argument("--quick", action="store_true", help="few values of each")
    parser.add_argument("--draw", action="store_true", help="draw the record that is there")
    options = parser.parse_args()
    record = json.loads(RECORD.read_text()) if RECORD.exists() else {}
    if not options.draw:
        for name in options.only or [name for name in SECTIONS if name not in record]:
            record[name] = SECTIONS[name](options.quick)
            write_text(RECORD, json.dumps({"provenance": provenance()} | record) + "\n")
            jax.clear_caches()
    plotting.save(charts.methods.sheet(record), PICTURE)


if __name__ == "__main__":
    main()

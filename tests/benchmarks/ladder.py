"""Cost and error of every rung of the ladder, beside finite elements.

    python tests/benchmarks/ladder.py           # --draw: only the picture, from the record

writes ladder.json beside this file and draws calibration/work_precision.png from it, in a quarter
of an hour on one core, most of it to compile.  Its parts, any of which ``--only`` does alone:

- work: on three strips, every rung over grids and load paths; errors against finite elements and
  against the rung's own limit, warm times interleaved between the cases, compilation apart;
- map: the rungs on one grid over all heights and amplitudes that finite elements have computed.

``--peer SCRIPT`` times condensed finite elements anew, by a script of your own that takes ETA A NX
NY STEPS_PER_QUARTER and prints a JSON line with "ratio" (to the cubic law), "build_s" and
"run_s_2_cycles"; without it their rows stay as they are in the record.
"""

import argparse
import csv
import functools
import json
import os
import platform
import re
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import jax

jax.config.update("jax_enable_x64", True)

import jaxlib  # noqa: E402
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from tqdm import tqdm  # noqa: E402

import jbeamshell as jb  # noqa: E402
from calibration import charts  # noqa: E402
from jbeamshell import plotting  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.measured.example import data_folder, example_loops  # noqa: E402

IN_LOAD_STEPS = {"model.solution": "stepwise", "model.kinematics": "exact"}

ROOT = Path(__file__).parents[2]
RECORD = Path(__file__).with_suffix(".json")
PICTURE = ROOT / "calibration" / "work_precision.png"
CALCULIX = ROOT / "calibration" / "finite_elements" / "checked.json"
PARTS = ("work", "map")
ROUNDS = 7
CYCLES = 2
STRIPS = ((0.0511, 0.3247), (0.1126, 0.7855), (0.2358, 1.0))  # eta and A
RUNGS = ("bar", "masing", "shell", "squeeze", "p2", "p3", "p4", "p6")
RESOLUTIONS = ((21, 2), (41, 4), (41, 10), (81, 10), (161, 20), (161, 40))  # nodes, steps
LIMIT = (321, 80)
MAPPED = (*RUNGS, "masing-pull")
MAP_RESOLUTION = (81, 10)
PULL = 1.0  # force of the profiles
PEER_MESHES = ((20, 2, 6), (40, 4, 10), (80, 8, 20))  # along x, over the height, steps per quarter
QUICK = {"rungs": ("bar", "squeeze", "p3"), "resolutions": ((21, 2), (41, 4)), "limit": (81, 10)}


class Case(NamedTuple):
    """Rung with its numbers of nodes and of load steps per half cycle."""

    rung: str
    nodes: int
    steps: int

    @property
    def settings(self) -> dict[str, Any]:
        """Dotted values of the model, in load steps.

        Coarse grids need their nodes at the loaded end.  On finer elements than these the
        beamshell's point reaction there turns into tension.
        """
        fine = self.nodes <= 41 or self.rung.startswith("p")
        general = self.rung != "bar" and "masing" not in self.rung
        return {
            "model.rung": self.rung,
            "model.nodes": self.nodes,
            "model.end_size": 1.0 / 12.0 if fine else 1.0 / 6.0,
            "load.steps_per_half_cycle": self.steps,
        } | ({"model.solution": "stepwise"} if general else {})


# --- finite elements ------------------------------------------------------------------------------


@functools.cache
def cells() -> dict[tuple[float, float], dict[str, float]]:
    """The table of dissipations by (eta, A)."""
    with (data_folder() / "energy.csv").open(encoding="utf-8") as table:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(table)]
    return {(row["eta"], row["A"]): row for row in rows}


def stiffness(eta: float, amplitude: float) -> float:
    """Secant stiffness of the finite elements' loop."""
    (loop,) = example_loops(eta, (amplitude,))
    return float(np.ptp(loop.force) / np.ptp(loop.displacement))


def contact_profile(eta: float) -> tuple[np.ndarray, np.ndarray]:
    """x and displacement of the contact under a pull by PULL."""
    table = np.genfromtxt(data_folder() / f"profiles_eta{eta:.4f}.csv", delimiter=",", names=True)
    pull = table[np.isclose(table["force"], PULL)]
    return pull["x"], pull["u_contact"]


def calculix() -> list[dict[str, Any]]:
    """Loops of the standard strips by CalculiX, from its own record."""
    record = json.loads(CALCULIX.read_text(encoding="utf-8"))
    walked = record["steps"]["load.cycles"] + 0.25
    return [
        {
            "eta": loop["eta"],
            "A": loop["A"],
            "what": "CalculiX",
            "mesh": f"{loop['elements_along_x']} {loop['elements']} elements along x",
            "ratio": loop["D_over_reference"],
            "ms_per_cycle": 1e3 * loop["wall_s"] / walked,
        }
        for loop in record["loops"]
        if (loop["eta"], loop["A"]) in STRIPS
    ]


def condensed(script: str) -> list[dict[str, Any]]:
    """Elements condensed to the contact, by a script run beside this one."""
    rows = []
    cases = [(strip, mesh) for strip in STRIPS for mesh in PEER_MESHES]
    for strip, mesh in tqdm(cases, disable=None, unit="mesh", desc="peer"):
        command = [sys.executable, script, *map(str, (*strip, *mesh))]
        answer = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        found = json.loads(answer.splitlines()[-1])
        rows.append(
            {
                "eta": strip[0],
                "A": strip[1],
                "what": "condensed",
                "mesh": "{} x {}, {} steps per quarter".format(*mesh),
                "ratio": found["ratio"] / cells()[strip]["ratio"],
                "ms_per_cycle": 1e3 * (found["build_s"] + found["run_s_2_cycles"]) / 2.25,
                "ms_per_cycle_once_built": 1e3 * found["run_s_2_cycles"] / 2.25,
            }
        )
    return rows


# --- measuring ------------------------------------------------------------------------------------


def scene_of(strip: tuple[float, float], values: dict[str, Any]) -> jb.Scene:
    """A standard strip, with what differs from the defaults."""
    eta, amplitude = strip
    own = {"strip.height_ratio": eta, "load.amplitude": amplitude, "load.cycles": CYCLES}
    return jb.library.standard().replace(IN_LOAD_STEPS).replace(own | values)


def modelled(strip: tuple[float, float], case: Case) -> jb.Scene:
    """A standard strip by a rung on a grid, with linear kinematics."""
    return scene_of(strip, {"model.kinematics": "linear", **case.settings})


def timed(scene: jb.Scene) -> tuple[jb.History, float]:
    """A run with its whole history, and its seconds."""
    begin = time.perf_counter()
    history = jax.block_until_ready(jb.solve(scene))
    return history, time.perf_counter() - begin


def ratio(history: jb.History, strip: tuple[float, float]) -> float:
    """Dissipation over that of the finite elements."""
    return float(history.dissipation) / cells()[strip]["D"]


def profile_error(case: Case, eta: float) -> float:
    """Rms error of the contact's displacement along x under a pull, over its maximum."""
    history = jb.solve(modelled((eta, PULL), case))
    turn, _, _ = history.cycles[0]
    x, truth = contact_profile(eta)
    off = np.interp(x, history.x, history.slip[turn]) - truth
    return float(np.sqrt(np.trapezoid(off**2, x) / np.ptp(x)) / np.max(truth))


def figures(history: jb.History, strip: tuple[float, float], case: Case) -> dict[str, Any]:
    """Row of the record for a run, without its times."""
    return {
        "eta": strip[0],
        "A": strip[1],
        "rung": case.rung,
        "nodes": case.nodes,
        "steps": case.steps,
        "ratio": ratio(history, strip),
        "stiffness": float(history.secant_stiffness) / stiffness(*strip),
        "profile_error": profile_error(case, strip[0]),
    }


def measure_work(quick: bool) -> dict[str, Any]:
    """Every rung over grids and paths on the strips, and its limit."""
    rungs = QUICK["rungs"] if quick else RUNGS
    resolutions = QUICK["resolutions"] if quick else RESOLUTIONS
    limit = QUICK["limit"] if quick else LIMIT
    cases = [Case(rung, *resolution) for rung in rungs for resolution in resolutions]
    first = [
        {"rung": case.rung, "nodes": case.nodes, "steps": case.steps}
        | {"first_s": timed(modelled(STRIPS[0], case))[1]}
        for case in tqdm(cases, disable=None, unit="case", desc="compile")
    ]
    lanes = [(strip, case) for strip in STRIPS for case in cases]
    seconds: dict[Any, list[float]] = {lane: [] for lane in lanes}
    for _ in tqdm(range(ROUNDS), disable=None, unit="round", desc="work"):
        for lane in lanes:
            seconds[lane].append(timed(modelled(*lane))[1])
    limits, runs = [], []
    for rung in tqdm(rungs, disable=None, unit="rung", desc="limits"):
        case = Case(rung, *limit)
        for strip in STRIPS:
            history, _ = timed(modelled(strip, case))
            limits.append(figures(history, strip, case))
    own_limit = {(row["eta"], row["A"], row["rung"]): row["ratio"] for row in limits}
    for strip, case in tqdm(lanes, disable=None, unit="run", desc="errors"):
        run_ms = 1e3 * statistics.median(seconds[strip, case])
        row = figures(jb.solve(modelled(strip, case)), strip, case)
        row["over_own_limit"] = row["ratio"] / own_limit[*strip, case.rung]
        runs.append(row | {"run_ms": run_ms, "ms_per_cycle": run_ms / (CYCLES + 0.25)})
    return {
        "about": about(),
        "kinematics": "linear",
        "runs": runs,
        "limits": limits,
        "first": first,
        "reference": [
            {"eta": eta, "A": amplitude, "error": cells()[eta, amplitude]["D_err_pct"] / 100.0}
            for eta, amplitude in STRIPS
        ],
    }


def measure_map(quick: bool) -> dict[str, Any]:
    """Every rung on one grid over all cells."""
    rungs = QUICK["rungs"] if quick else MAPPED
    rows: dict[Any, dict[str, float]] = {
        cell: {"eta": cell[0], "A": cell[1], "over_cubic_law": row["ratio"]}
        for cell, row in cells().items()
    }
    for rung in tqdm(rungs, disable=None, unit="rung", desc="map"):
        case = Case(rung, *MAP_RESOLUTION)
        for cell, row in rows.items():
            row[rung] = ratio(jb.solve(modelled(cell, case)), cell)
    nodes, steps = MAP_RESOLUTION
    return {
        "about": about(),
        "kinematics": "linear",
        "nodes": nodes,
        "steps": steps,
        "rungs": list(rungs),
        "cells": list(rows.values()),
    }


def about() -> dict[str, Any]:
    """Source of the numbers of a part."""
    information = Path("/proc/cpuinfo")
    text = information.read_text(encoding="utf-8") if information.exists() else ""
    model = re.search(r"model name\s*:\s*(.*)", text)
    asked = ["git", "rev-parse", "--short", "HEAD"]
    commit = subprocess.run(asked, capture_output=True, text=True, cwd=ROOT)
    return {
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "cpu": model[1] if model else platform.processor(),
        "python": platform.python_version(),
        "jax": jax.__version__,
        "jaxlib": jaxlib.__version__,
        "dtype": "float64",
        "flags": os.environ.get("XLA_FLAGS", ""),
        "commit": commit.stdout.strip(),
        "cycles": CYCLES,
        "rounds": ROUNDS,
    }


# --- record and picture ---------------------------------------------------------------------------


def short(value: Any) -> Any:
    """The same with six digits of every number."""
    if isinstance(value, dict):
        return {key: short(item) for key, item in value.items()}
    if isinstance(value, list):
        return [short(item) for item in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value


def as_text(record: dict[str, Any]) -> str:
    """The record as JSON, every row on one line."""
    text = json.dumps(short(record), indent=1, allow_nan=False)
    return re.sub(r"[\[{][^][{}]*[\]}]", lambda row: " ".join(row[0].split()), text) + "\n"


def report(record: dict[str, Any]) -> str:
    """Errors and times of the rungs on the strips."""
    lines = [
        "eta     A       rung     nodes steps  D/FE - 1  D/own - 1   k/FE - 1   rms u  ms/cycle"
    ]
    lines += [
        f"{row['eta']:<7} {row['A']:<7} {row['rung']:8s} {row['nodes']:5d} {row['steps']:5d}"
        f" {row['ratio'] - 1.0:10.2%} {row['over_own_limit'] - 1.0:10.2%}"
        f" {row['stiffness'] - 1.0:11.2%} {row['profile_error']:7.2%} {row['ms_per_cycle']:9.2f}"
        for row in record["work"]["runs"]
    ]
    return "\n".join(lines)


def picture(record: dict[str, Any]) -> plt.Figure:
    """Work and precision on the middle strip."""
    with plotting.style():
        figure, axes = plt.subplots(figsize=(7.5, 5.0))
        charts.ladder.work_precision(record, axes)
    return figure


def main() -> None:
    """Measure, write the record, say what it holds, draw it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=PARTS, help="a part; the rest of the record stays")
    parser.add_argument("--quick", action="store_true", help="a few points; writes nothing")
    parser.add_argument("--peer", metavar="SCRIPT", help="condensed finite elements to be timed")
    parser.add_argument("--draw", action="store_true", help="draw the record that is there")
    options = parser.parse_args()
    # First calls are to be compiled, whatever an earlier process has left.
    timing = not options.quick and options.only in (None, "work")
    jax.config.update("jax_enable_compilation_cache", not timing)
    record: dict[str, Any] = {}
    if RECORD.exists():
        record = json.loads(RECORD.read_text(encoding="utf-8"))
    if not options.draw:
        measures = dict(zip(PARTS, (measure_work, measure_map), strict=True))
        for part in [options.only] if options.only else PARTS:
            record[part] = measures[part](options.quick)
            kept = [r for r in record.get("finite_elements", []) if r["what"] == "condensed"]
            rows = condensed(options.peer) if options.peer and part == "work" else kept
            record["finite_elements"] = calculix() + rows
            if not options.quick:
                write_text(RECORD, as_text(record))
    print(report(record))
    if not options.quick:
        plotting.save(picture(record), PICTURE)


if __name__ == "__main__":
    main()

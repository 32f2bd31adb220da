"""Error of every section in load steps, over heights and loads.

    python tests/benchmarks/ladder.py           # --quick: a few sections, no record

writes ladder.json beside this file: the sections on one grid over all heights and amplitudes that
finite elements have computed.  Times and errors side by side are those of work_precision.py.
"""

import argparse
import csv
import functools
import json
import os
import platform
import re
import subprocess
from pathlib import Path
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

import jaxlib  # noqa: E402
from tqdm import tqdm  # noqa: E402

import jbeamshell as jb  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.measured.example import data_folder  # noqa: E402

ROOT = Path(__file__).parents[2]
RECORD = Path(__file__).with_suffix(".json")
CYCLES = 2
SECTIONS = ("bar", "shell", "squeeze", "p2", "p3", "p4", "p6")
QUICK = ("bar", "squeeze", "p3")
NODES, STEPS = 81, 10  # load steps per half cycle


# --- finite elements ------------------------------------------------------------------------------


@functools.cache
def cells() -> dict[tuple[float, float], dict[str, float]]:
    """The table of dissipations by (eta, A)."""
    with (data_folder() / "energy.csv").open(encoding="utf-8") as table:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(table)]
    return {(row["eta"], row["A"]): row for row in rows}


# --- measuring ------------------------------------------------------------------------------------


def modelled(strip: tuple[float, float], section: str) -> jb.Scene:
    """A standard strip of a section in load steps, held down, with linear kinematics.

    On finer elements than these the beamshell's point reaction at the loaded end turns into
    tension.
    """
    eta, amplitude = strip
    scene = (
        jb.library.standard()
        .replace(
            {
                "strip.height_ratio": eta,
                "contact.normal": "held",
                "load.amplitude": amplitude,
                "load.cycles": CYCLES,
                "load.steps_per_half_cycle": STEPS,
                "model.section": section,
                "model.kinematics": "linear",
            }
        )
        .on_grid(NODES, 1.0 / 12.0 if section.startswith("p") else 1.0 / 6.0)
    )
    return scene if section == "bar" else scene.by_load_steps()


def ratio(history: jb.History, strip: tuple[float, float]) -> float:
    """Dissipation over that of the finite elements."""
    return float(history.dissipation) / cells()[strip]["D"]


def measure_map(quick: bool) -> dict[str, Any]:
    """Every section on one grid over all cells."""
    sections = QUICK if quick else SECTIONS
    rows: dict[Any, dict[str, float]] = {
        cell: {"eta": cell[0], "A": cell[1], "over_cubic_law": row["ratio"]}
        for cell, row in cells().items()
    }
    for section in tqdm(sections, disable=None, unit="section", desc="map"):
        for cell, row in rows.items():
            row[section] = ratio(jb.solve(modelled(cell, section)), cell)
    return {
        "about": about(),
        "kinematics": "linear",
        "nodes": NODES,
        "steps": STEPS,
        "sections": list(sections),
        "cells": list(rows.values()),
    }


def about() -> dict[str, Any]:
    """Source of the numbers."""
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
    }


# --- record ---------------------------------------------------------------------------


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


def main() -> None:
    """Measure and write the record."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a few sections; writes nothing")
    options = parser.parse_args()
    text = as_text({"map": measure_map(options.quick)})
    if options.quick:
        print(text)
    else:
        write_text(RECORD, text)


if __name__ == "__main__":
    main()

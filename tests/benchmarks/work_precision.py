"""Error to elasticity over time, for everything that answers the energy of a cycle.

    python tests/benchmarks/work_precision.py        # --quick: few calls, no record

writes work_precision.json beside this file and draws calibration/work_precision.png from it.  Three
strips under an even traction slip over .7, 2 and 5 H; their energies by converged elements are in
calibration/data.  On each, warm and on one core:

- plain: `jb.solve` without settings, on a body that is kept and on one that was never seen;
- sections: every section that can be named, on 17 to 129 nodes;
- bulk: a call of `jb.response` over the load, and a lane of a plain `jb.sweep`.

``--peer SCRIPT`` times condensed elements, by a script of your own that takes ETA A NX NY
STEPS_PER_QUARTER and prints a JSON line with "ratio" (to the cubic law), "build_s" and
"run_s_2_cycles".  ``--calculix`` runs CalculiX.  Without them their rows stay as they are.
"""

import os

os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # before NumPy
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})

import argparse
import csv
import functools
import json
import statistics
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from ladder import as_text  # noqa: E402
from speeds import machine  # noqa: E402

import jbeamshell as jb  # noqa: E402
from calibration import charts, finite_elements  # noqa: E402
from jbeamshell import plotting  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.measured.example import data_folder  # noqa: E402

RECORD = Path(__file__).with_suffix(".json")
PICTURE = Path(__file__).parents[2] / "calibration" / "work_precision.png"
HEIGHT, LOAD = "strip.height_ratio", "load.amplitude"
STRIPS = ((0.2358, 0.5851), (0.1126, 0.4359), (0.1126, 0.7855))  # eta and A
SECTIONS = ("shell", "squeeze", "p2", "p4", "p6", "plane")
NODES = (17, 33, 65, 129)
PEER_MESHES = ((20, 2, 6), (40, 4, 10), (80, 8, 20))  # along x, over the height, steps per quarter
SIDE = 64  # heights and loads of the sweep
CALLS = 9
APART = 1e-7  # relative change from call to call, so that none is answered from memory

Call = Callable[[int], float]  # from its number to the energy of a cycle


class Way(NamedTuple):
    """Way to the energy of a cycle.

    Attributes
    ----------
    family, what : what it belongs to, and its name
    nodes : contact nodes, None where they are chosen
    call : the call
    """

    family: str
    what: str
    nodes: int | None
    call: Call


@functools.cache
def elements() -> dict[tuple[float, float], dict[str, float]]:
    """Energies by converged elements by (eta, A)."""
    with (data_folder() / "energy.csv").open(encoding="utf-8") as table:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(table)]
    return {(row["eta"], row["A"]): row for row in rows}


def scene_of(strip: tuple[float, float], values: dict[str, Any] | None = None) -> jb.Scene:
    """A strip under an even traction."""
    own = dict(zip((HEIGHT, LOAD), strip, strict=True))
    return jb.Scene().replace({"load.entry": "traction"} | own | (values or {}))


def solved(scene: jb.Scene, key: str) -> Call:
    """Call of `jb.solve` that changes one number a little each time."""
    value = float(scene.get(key))
    return lambda i: float(jb.solve(scene.replace({key: value * (1.0 + APART * i)})).dissipation)


def ways(strip: tuple[float, float]) -> Iterator[Way]:
    """Ways to the energy of a strip's cycle, but for sweeps."""
    plain = scene_of(strip)
    yield Way("plain call", "kept body", None, solved(plain, LOAD))
    yield Way("plain call", "new body", None, solved(plain, HEIGHT))
    yield Way("bar", "bar", None, solved(scene_of(strip, {"model.section": "bar"}), LOAD))
    for section in SECTIONS:
        for nodes in NODES:
            named = scene_of(strip, {"model.section": section, "model.nodes": nodes})
            yield Way(section, section, nodes, solved(named, LOAD))
    ask = jb.response(plain, [LOAD])
    yield Way(
        "response",
        "over the load",
        None,
        lambda i: ask(strip[1] * (1.0 + APART * i))["dissipation"],
    )


def timed(strip: tuple[float, float], calls: int) -> list[dict[str, Any]]:
    """Rows of a strip; its calls take turns."""
    known = list(ways(strip))
    answers = [float(way.call(0)) for way in known]
    seconds: list[list[float]] = [[] for _ in known]
    for i in range(1, calls + 1):
        for way, own in zip(known, seconds, strict=True):
            begin = time.perf_counter()
            jax.block_until_ready(way.call(i))
            own.append(time.perf_counter() - begin)
    return [
        row(strip, way.family, way.what, answer, statistics.median(own)) | {"nodes": way.nodes}
        for way, answer, own in zip(known, answers, seconds, strict=True)
    ]


def row(
    strip: tuple[float, float], family: str, what: str, energy: float, seconds: float
) -> dict[str, Any]:
    """Row of the record."""
    error = energy / elements()[strip]["D"] - 1.0
    return {
        "eta": strip[0],
        "A": strip[1],
        "family": family,
        "what": what,
        "error": error,
        "ms": 1e3 * seconds,
    }


def swept(side: int) -> list[dict[str, Any]]:
    """Rows of a lane of a plain sweep that has the strips among its heights and loads."""
    heights, loads = (
        np.unique([*values, *np.geomspace(*ends, side - len(set(values)))])
        for values, ends in zip(zip(*STRIPS, strict=True), ((0.03, 0.4), (0.1, 1.8)), strict=True)
    )
    over, scene = {HEIGHT: heights, LOAD: loads}, scene_of(STRIPS[0])
    for _ in range(2):  # the first compiles
        begin = time.perf_counter()
        found = jb.sweep(scene, over, ["dissipation"])
        seconds = (time.perf_counter() - begin) / found.status.size
    places = [(np.searchsorted(heights, eta), np.searchsorted(loads, load)) for eta, load in STRIPS]
    return [
        row(strip, "sweep", "a lane", float(found["dissipation"][place]), seconds)
        for strip, place in zip(STRIPS, places, strict=True)
    ]


def condensed(script: str) -> list[dict[str, Any]]:
    """Rows of elements condensed to the contact, by a script run beside this one."""
    rows = []
    for strip in STRIPS:
        cubic_law = elements()[strip]["D"] / elements()[strip]["ratio"]
        for mesh in PEER_MESHES:
            command = [sys.executable, script, *map(str, (*strip, *mesh))]
            answer = subprocess.run(command, capture_output=True, text=True, check=True).stdout
            found = json.loads(answer.splitlines()[-1])
            once = found["run_s_2_cycles"]
            for what, seconds in {"new body": found["build_s"] + once, "kept body": once}.items():
                energy = found["ratio"] * cubic_law
                rows.append(row(strip, "condensed elements", what, energy, seconds))
    return rows


def calculix() -> list[dict[str, Any]]:
    """Rows of CalculiX, one cycle on meshes graded towards the loaded corner."""
    rows = []
    for strip in STRIPS:
        begin = time.perf_counter()
        run = {"load.cycles": 1, "load.steps_per_half_cycle": 20}
        history = finite_elements.solve(scene_of(strip, run), elements="linear")
        seconds = time.perf_counter() - begin
        rows.append(row(strip, "CalculiX", "one cycle", float(history.dissipation), seconds))
    return rows


def main() -> None:
    """Measure, write the record, draw it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few calls; writes nothing")
    parser.add_argument("--peer", metavar="SCRIPT", help="condensed elements to be timed")
    parser.add_argument("--calculix", action="store_true", help="run CalculiX")
    parser.add_argument("--draw", action="store_true", help="draw the record that is there")
    options = parser.parse_args()
    warnings.simplefilter("ignore", jb.DoubtfulWarning)
    record: dict[str, Any] = {"ours": [], "others": []}
    if RECORD.exists():
        record = json.loads(RECORD.read_text(encoding="utf-8"))
    if not options.draw:
        calls, side = (2, 8) if options.quick else (CALLS, SIDE)
        others = {"condensed elements": condensed(options.peer) if options.peer else None}
        others["CalculiX"] = calculix() if options.calculix else None
        for family, rows in others.items():
            if rows is not None:
                kept = [own for own in record["others"] if own["family"] != family]
                record["others"] = kept + rows
        ours = [own for strip in STRIPS for own in timed(strip, calls)] + swept(side)
        truth = [
            {"eta": eta, "A": load, "error": elements()[eta, load]["D_err_pct"] / 100.0}
            for eta, load in STRIPS
        ]
        about = machine.about() | {"cores_used": 1, "calls": calls}
        record = {"about": about, "truth": truth, "ours": ours, "others": record["others"]}
    for own in record["ours"] + record["others"]:
        print("{eta:<7} {A:<7} {family:18s} {what:13s} {error:+9.2%} {ms:10.3f} ms".format(**own))
    if not options.quick:
        write_text(RECORD, as_text(record))
        plotting.save(charts.work_precision.chart(record), PICTURE)


if __name__ == "__main__":
    main()

"""Error to elasticity over time, for everything that answers the energy of a cycle.

Three strips under an even traction slip over .7, 2 and 5 H; their energies by converged elements
are in calibration/data.  On each, warm and on one core:

- plain: `jb.solve` without settings, on a body that is kept and on one that was never seen;
- sections: every section that can be named, on 17 to 129 nodes;
- bulk: a call of `jb.response` over the load, and a lane of a plain `jb.sweep`.

peer=SCRIPT times condensed elements, by a script of your own that takes ETA A NX NY
STEPS_PER_QUARTER and prints a JSON line with "ratio" (to the cubic law), "build_s" and
"run_s_2_cycles".  calculix=true runs CalculiX.  Without them their rows stay as they are.
"""

import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import jax
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

import jbeamshell as jb
from calibration import finite_elements
from calibration.charts import plain_numbers
from calibration.running import read
from calibration.tables import energies
from jbeamshell.plotting.style import DATA, FAINT, style

HEIGHT, LOAD = "strip.height_ratio", "load.amplitude"
STRIPS = ((0.2358, 0.5851), (0.1126, 0.4359), (0.1126, 0.7855))  # eta and A
SECTIONS = ("shell", "squeeze", "plane")
NODES = (17, 33, 65, 129)
PEER_MESHES = ((20, 2, 6), (40, 4, 10), (80, 8, 20))  # along x, over the height, steps per quarter
SIDE = 64  # heights and loads of the sweep
CALLS = 9
APART = 1e-7  # relative change from call to call, so that none is answered from memory
LOOKS: dict[str, dict[str, Any]] = {  # by family
    "bar": {"color": "0.6", "marker": "s"},
    "shell": {"color": "#D55E00", "marker": "v"},
    "squeeze": {"color": "#CC79A7", "marker": "o"},
    "plane": {"color": "#117733", "marker": "h"},
    "plain call": {"color": "#E69F00", "marker": "*", "markersize": 13.0},
    "response": {"color": "#E69F00", "marker": "D"},
    "sweep": {"color": "#E69F00", "marker": "<", "markersize": 8.0},
    "condensed elements": {"color": DATA, "marker": "+", "markersize": 8.0},
    "CalculiX": {"color": DATA, "marker": "H", "markersize": 8.0},
}
LEAST = 0.01  # per cent, lower end of the errors

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


def timed(strip: tuple[float, float]) -> list[dict[str, Any]]:
    """Rows of a strip; its calls take turns."""
    known = list(ways(strip))
    answers = [float(way.call(0)) for way in known]
    seconds: list[list[float]] = [[] for _ in known]
    for i in range(1, CALLS + 1):
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
    error = energy / energies()[strip]["D"] - 1.0
    return {
        "eta": strip[0],
        "A": strip[1],
        "family": family,
        "what": what,
        "error": error,
        "ms": 1e3 * seconds,
    }


def swept() -> list[dict[str, Any]]:
    """Rows of a lane of a plain sweep that has the strips among its heights and loads."""
    heights, loads = (
        np.unique([*values, *np.geomspace(*ends, SIDE - len(set(values)))])
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
        cubic_law = energies()[strip]["D"] / energies()[strip]["ratio"]
        for mesh in PEER_MESHES:
            command = [sys.executable, script, *map(str, (*strip, *mesh))]
            answer = subprocess.run(command, capture_output=True, text=True, check=True).stdout
            found = json.loads(answer.splitlines()[-1])
            once = found["run_s_2_cycles"]
            for what, seconds in {"new body": found["build_s"] + once, "kept body": once}.items():
                energy = found["ratio"] * cubic_law
                rows.append(row(strip, "condensed elements", what, energy, seconds))
    return rows


def by_calculix() -> list[dict[str, Any]]:
    """Rows of CalculiX, one cycle on meshes graded towards the loaded corner."""
    rows = []
    for strip in STRIPS:
        begin = time.perf_counter()
        run = {"load.cycles": 1, "load.steps_per_half_cycle": 20}
        history = finite_elements.solve(scene_of(strip, run), elements="linear")
        seconds = time.perf_counter() - begin
        rows.append(row(strip, "CalculiX", "one cycle", float(history.dissipation), seconds))
    return rows


def measure(peer: str = "", calculix: bool = False) -> dict[str, Any]:
    """Rows of all ways; those of others stay as they are where none are asked for."""
    others = read(Path(__file__).with_suffix(".json")).get("others", [])
    renewed = (condensed(peer) if peer else []) + (by_calculix() if calculix else [])
    families = {own["family"] for own in renewed}
    others = renewed + [own for own in others if own["family"] not in families]
    truth = [
        {"eta": eta, "A": load, "error": energies()[eta, load]["D_err_pct"] / 100.0}
        for eta, load in STRIPS
    ]
    ours = [own for strip in STRIPS for own in timed(strip)] + swept()
    return {"truth": truth, "ours": ours, "others": others}


def tell(record: dict[str, Any]) -> str:
    """Errors and times in lines."""
    line = "{eta:<7} {A:<7} {family:18s} {what:13s} {error:+9.2%} {ms:10.3f} ms"
    return "\n".join(line.format(**own) for own in record["ours"] + record["others"])


# --- chart ----------------------------------------------------------------------------------------


def draw(record: dict[str, Any]) -> plt.Figure:
    """Figure with a panel for each strip of the record."""
    with style():
        count = len(record["truth"])
        figure, panels = plt.subplots(
            1, count, figsize=(4.6 * count, 4.8), sharex=True, sharey=True, layout="constrained"
        )
        for axes, truth in zip(panels, record["truth"], strict=True):
            _strip(axes, record, truth)
        panels[0].set_ylabel("error of the dissipation, to elements  [%]")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right center", fontsize=9)
    return figure


def _strip(axes: Axes, record: dict[str, Any], truth: dict[str, Any]) -> None:
    """Dots of all ways to the energy of one strip; lines join a section's grids."""
    rows = [
        row
        for row in record["ours"] + record["others"]
        if (row["eta"], row["A"]) == (truth["eta"], truth["A"])
    ]
    for family, look in LOOKS.items():
        own = [row for row in rows if row["family"] == family]
        off = [max(100.0 * abs(row["error"]), LEAST) for row in own]
        line = "-" if len(own) > 1 and family not in ("plain call", "condensed elements") else ""
        shown = {"linestyle": line, "linewidth": 1.0, "markersize": 6.0} | look
        axes.plot([row["ms"] for row in own], off, label=family, **shown)
    tolerance = {"color": FAINT, "linestyle": "--", "linewidth": 1.0}
    axes.axhline(1.0, label="tolerance of a plain call", **tolerance)
    dotted = tolerance | {"linestyle": ":"}
    axes.axhline(max(100.0 * truth["error"], LEAST), label="error of the elements", **dotted)
    axes.set(xscale="log", yscale="log", xlabel="time of a warm call  [ms]")
    axes.set_title(f"$\\eta = {truth['eta']:g}$, $A = {truth['A']:g}$")
    plain_numbers(axes.xaxis, axes.yaxis)

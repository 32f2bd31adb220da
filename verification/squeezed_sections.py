"""Order of section that a squeeze needs, by Filon's tension, the reaction and the end of contact.

A strip is squeezed on both faces over its middle, and pressed onto a frictionless base (scenes
``squeezed`` and ``receding``; Brink 2015, section 4.7). It is solved by the beamshell, p = 0, and
by sections of order p = 1 to 6, on grids of 101 to 801 nodes with linear kinematics, some with
exact ones, and compared with finite elements and Filon's exact stress. Where the pressure steps by
[p], the reaction of order p steps by (-1)^p [p]/(p+1), and that of elasticity does not (for the
reason see tests/solving/test_hierarchic_squeeze.py).

Writes ladder_squeeze.json beside this file and draws ladder_squeeze.png from it; takes about a
quarter of an hour on one core, most of it to compile:

    python calibration/ladder_squeeze.py           # --draw: only the picture, from the record
"""

import argparse
import json
import re
import statistics
import time
from pathlib import Path
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from matplotlib.ticker import ScalarFormatter  # noqa: E402
from provenance import provenance  # noqa: E402
from tqdm import tqdm  # noqa: E402

import jbeamshell as jb  # noqa: E402
from jbeamshell import plotting  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.measured.example import data_folder  # noqa: E402
from jbeamshell.mechanics.homogeneous import shear_coefficient  # noqa: E402
from jbeamshell.reference import filon_average_step, reaction_jump  # noqa: E402
from jbeamshell.scene import library  # noqa: E402

HERE = Path(__file__).parent
RECORD = HERE / "ladder_squeeze.json"
ORDERS = (0, 1, 2, 3, 4, 6)
NODES = (101, 201, 401, 801)
SHOWN = 401  # nodes of the profiles
END_SIZE = 0.02  # smallest elements over H, before the number of nodes scales all
EXACT = [(order, 201) for order in (0, 3)]  # once more with exact kinematics
ROUNDS = 5
EDGE, PRESSURE = 50.0, 100.0  # mm, MPa
WINDOW = (45.0, 55.0)  # mm, of the rms error
PROFILE = (EDGE - 1.0, EDGE + 2.5)  # mm
# Finite elements, finest mesh: between the end of contact by pressure, 50.777, and by gap, 50.782.
TRUTH = {"contact_end_mm": 0.779, "reaction_max_MPa": 103.12, "lift_slope": 1.9858e-4}
UNSURE = 0.0025  # mm, of the end of contact


# --- measuring ------------------------------------------------------------------------------------


def finite_elements(name: str) -> np.ndarray:
    """Table of the finite elements, by column."""
    return np.genfromtxt(data_folder() / "squeeze" / name, delimiter=",", names=True)


def timed(scene: jb.Scene) -> tuple[jb.History, dict[str, float]]:
    """Result of a run, seconds of its first time with compilation, median of the next ones."""
    seconds = []
    for _ in range(1 + ROUNDS):
        begin = time.perf_counter()
        history = jax.block_until_ready(jb.solve(scene))
        seconds.append(time.perf_counter() - begin)
    return history, {"first_s": seconds[0], "run_ms": 1e3 * statistics.median(seconds[1:])}


def peak(x: np.ndarray, values: np.ndarray) -> tuple[float, float]:
    """Largest value and its place, by a parabola through three points."""
    middle = int(np.clip(np.argmax(values), 1, x.size - 2))
    three = slice(middle - 1, middle + 2)
    parabola = np.polyfit(x[three] - x[middle], values[three], 2)
    place = -parabola[1] / (2.0 * parabola[0])
    return float(np.polyval(parabola, place)), float(x[middle] + place)


def rms(x: np.ndarray, stress: np.ndarray, truth: np.ndarray) -> float:
    """Root mean square error of a profile, against samples in the window."""
    return float(np.sqrt(np.mean((np.interp(window(), x, stress) - truth) ** 2)))


def window() -> np.ndarray:
    """Positions at which errors are sampled."""
    return np.linspace(*WINDOW, 1001)


def squeeze_figures(history: jb.History) -> dict[str, Any]:
    """Tension beyond the load and errors of the mean sigma_y."""
    x, stress = np.asarray(history.middles), np.asarray(history.squeeze_stress[-1])
    beyond = x > EDGE
    largest, place = peak(x[beyond], stress[beyond])
    pulls = largest > 1e-6 * PRESSURE
    measured = finite_elements("b2.csv")
    filon = -PRESSURE * np.asarray(filon_average_step(window() - EDGE))  # H = 1 mm
    return {
        "tension_MPa": largest if pulls else 0.0,
        "tension_at_mm": place - EDGE if pulls else None,
        "rms_MPa": rms(x, stress, np.interp(window(), measured["x_mm"], measured["sy_avg"])),
        "rms_to_filon_MPa": rms(x, stress, filon),
    }


def contact_figures(history: jb.History) -> dict[str, Any]:
    """End of contact, reaction and lift."""
    x, reaction = np.asarray(history.x), np.asarray(history.reaction[-1])
    largest, place = peak(x, reaction)
    before, after = reaction_at_the_step(x - EDGE, reaction)
    return {
        "contact_end_mm": float(history.contact_end[-1]) - EDGE,
        "reaction_max_MPa": largest,
        "reaction_max_at_mm": place,
        "reaction_before_step_MPa": before,
        "reaction_after_step_MPa": after,
        "lift_slope": float(history.lift_slope[-1]),
        "load_carried": float(np.sum(reaction * history.tributary)) / (PRESSURE * EDGE),
        "newton_iterations": int(np.sum(history.iterations)),
    }


def reaction_at_the_step(x: np.ndarray, reaction: np.ndarray) -> list[float]:
    """Reaction on either side of the load's edge, by the nearest three nodes fully on that side."""
    apart = 1.5 * np.min(np.diff(x))
    sides = (np.flatnonzero(x < -apart)[-3:], np.flatnonzero(x > apart)[:3])
    return [float(np.polyval(np.polyfit(x[near], reaction[near], 2), 0.0)) for near in sides]


def closed_step(order: int) -> float:
    """Step of R at the edge of the load."""
    if order:
        return -PRESSURE * (-1) ** order / (order + 1)
    strip = library.receding().strip
    return float(reaction_jump(-PRESSURE, strip.kappa_s, shear_coefficient(strip.poisson_ratio)))


def profile(x: Any, values: Any) -> list[list[float]]:
    """Rows of x - a and of the values around the edge."""
    x = np.asarray(x)
    inside = (x >= PROFILE[0]) & (x <= PROFILE[1])
    rows = np.stack([x - EDGE, np.asarray(values)])[:, inside]
    return [[float(f"{value:.5g}") for value in row] for row in rows]


def climb(order: int, nodes: int, kinematics: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Figures and profiles of both problems on one grid."""
    section = f"p{order}" if order else "squeeze"
    change = {"model.section": section, "model.kinematics": kinematics}
    squeezed, squeeze_time = timed(library.squeezed().replace(change).on_grid(nodes, END_SIZE))
    receding, contact_time = timed(library.receding().replace(change).on_grid(nodes, END_SIZE))
    jax.clear_caches()  # every case compiles programs of its own
    figures = {
        "order": order,
        "nodes": nodes,
        "kinematics": kinematics,
        "squeezed": squeeze_figures(squeezed) | squeeze_time,
        "receding": contact_figures(receding)
        | {"closed_step_MPa": closed_step(order)}
        | contact_time,
    }
    return figures, {
        "stress": profile(squeezed.middles, squeezed.squeeze_stress[-1]),
        "reaction": profile(receding.x, receding.reaction[-1]),
    }


def measure() -> dict[str, Any]:
    """Record of all sections and grids."""
    cases = [(order, nodes, "linear") for order in ORDERS for nodes in NODES]
    cases += [(*case, "exact") for case in EXACT]
    b2, b3 = finite_elements("b2.csv"), finite_elements("b3.csv")
    tension, place = peak(b2["x_mm"], b2["sy_avg"])
    record: dict[str, Any] = {
        "provenance": provenance(),
        "timing": f"run_ms: median of {ROUNDS} warm runs; first_s: with compilation",
        "finite_elements": {"tension_MPa": tension, "tension_at_mm": place - EDGE} | TRUTH,
        "sections": [],
        "profiles": {
            "nodes": SHOWN,
            "finite elements": {
                "stress": profile(b2["x_mm"], b2["sy_avg"]),
                "reaction": profile(b3["x_mm"], b3["R"]),
            },
        },
    }
    for case in tqdm(cases, disable=None, unit="case"):
        figures, profiles = climb(*case)
        record["sections"].append(figures)
        if case[1] == SHOWN:
            record["profiles"][str(case[0])] = profiles
    return record


def as_text(record: dict[str, Any]) -> str:
    """Record as JSON text, every row of a profile on one line."""
    text = json.dumps(record, indent=1, allow_nan=False)
    return re.sub(r"\[[^][{}]*\]", lambda row: " ".join(row[0].split()), text) + "\n"


def report(record: dict[str, Any]) -> str:
    """Table of the sections, as text."""
    lines = [
        "p  nodes  kinematics  tension MPa at mm   rms MPa  x_c - a mm  R max MPa at mm     "
        "R across the step  lift slope  run ms"
    ]
    for row in record["sections"]:
        s, r = row["squeezed"], row["receding"]
        at = "-" if s["tension_at_mm"] is None else format(s["tension_at_mm"], ".3f")
        lines.append(
            f"{row['order']}  {row['nodes']:5d}  {row['kinematics']:10s}  "
            f"{s['tension_MPa']:11.4f} {at:>5s}   {s['rms_MPa']:7.4f}  {r['contact_end_mm']:10.4f}"
            f"  {r['reaction_max_MPa']:9.3f} {r['reaction_max_at_mm']:.3f}    "
            f"{r['reaction_before_step_MPa']:6.2f} -> {r['reaction_after_step_MPa']:6.2f}  "
            f"  {r['lift_slope']:.4e}  {s['run_ms']:.0f} + {r['run_ms']:.0f}"
        )
    return "\n".join(lines)


# --- picture --------------------------------------------------------------------------------------


def picture(record: dict[str, Any]) -> plt.Figure:
    """Picture with profiles above, errors over run time below."""
    with plotting.style():
        figure, ((stress, reaction), (squeeze, contact)) = plt.subplots(2, 2, figsize=(11.0, 8.0))
        draw_stress(record["profiles"], stress)
        draw_reaction(record["profiles"], reaction)
        draw_grids(record["sections"], "squeezed", "rms_MPa", squeeze)
        squeeze.set(
            yscale="log",
            ylabel="rms error of the mean $\\sigma_y$  [MPa]",
            title="(c) squeezed: 101, 201, 401 and 801 nodes",
        )
        squeeze.yaxis.set_major_formatter(ScalarFormatter())
        draw_grids(record["sections"], "receding", "contact_end_mm", contact)
        end = record["finite_elements"]["contact_end_mm"]
        label = "finite elements"
        contact.axhspan(
            end - UNSURE, end + UNSURE, color=plotting.DATA, alpha=0.4, lw=0, label=label
        )
        contact.set(
            ylabel="end of contact $x_c - a$  [mm]",
            title="(d) receding: 101, 201, 401 and 801 nodes",
        )
        contact.legend(handles=contact.get_legend_handles_labels()[0][-1:], loc="lower right")
    return figure


def name(order: int) -> str:
    """Name of a section."""
    return f"$p$ = {order}" if order else "beamshell"


def draw_profiles(profiles: dict[str, Any], what: str, axes: plt.Axes, dots: slice) -> None:
    """Draw a profile of every section over the finite elements."""
    for order, colour in zip(ORDERS, plotting.colours(len(ORDERS)), strict=True):
        x, value = profiles[str(order)][what]
        axes.plot(x, value, color=colour, label=name(order), linewidth=1.3)
    x, value = profiles["finite elements"][what]
    axes.plot(x[dots], value[dots], label="finite elements", **plotting.DOTS)


def draw_stress(profiles: dict[str, Any], axes: plt.Axes) -> None:
    """Draw the squeeze stress around the edge of the load, and its tension."""
    zoom = axes.inset_axes((0.42, 0.13, 0.56, 0.56), xlim=(0.4, 2.4), ylim=(-3.0, 2.2))
    for panel, dots in ((axes, slice(None, None, 2)), (zoom, slice(None))):
        draw_profiles(profiles, "stress", panel, dots)
    zoom.axhline(0.0, color=plotting.FAINT, linewidth=0.8, zorder=0)
    zoom.set_title("Filon's tension", fontsize=9)
    axes.set(
        xlim=(-1.0, 2.4),
        xlabel="$X - a$  [mm]",
        ylabel=r"mean of $\sigma_y$  [MPa]",
        title="(a) squeezed on both faces up to $X = a$",
    )


def draw_reaction(profiles: dict[str, Any], axes: plt.Axes) -> None:
    """Draw the reaction around the edge of the load."""
    draw_profiles(profiles, "reaction", axes, slice(None))
    axes.set(
        xlim=(-0.6, 1.0),
        ylim=(-4.0, 90.0),
        xlabel="$X - a$  [mm]",
        ylabel="$R$  [MPa]",
        title="(b) on a base, pressed up to $X = a$",
    )
    axes.legend(loc="lower left")


def draw_grids(sections: list[dict], problem: str, key: str, axes: plt.Axes) -> None:
    """Draw a figure over run time, a line for every section and a dot for every grid."""
    for order, colour in zip(ORDERS, plotting.colours(len(ORDERS)), strict=True):
        own = [r[problem] for r in sections if r["order"] == order and r["kinematics"] == "linear"]
        milliseconds, values = [r["run_ms"] for r in own], [r[key] for r in own]
        axes.plot(milliseconds, values, "o-", color=colour, label=name(order), markersize=4.0)
    axes.set(xscale="log", xlabel="warm run, one core  [ms]")
    axes.xaxis.set_major_formatter(ScalarFormatter())


def main() -> None:
    """Measure, write the record, print a table, draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draw", action="store_true", help="draw the record that is there")
    if not parser.parse_args().draw:
        write_text(RECORD, as_text(measure()))
    record = json.loads(RECORD.read_text(encoding="utf-8"))
    print(report(record))
    plotting.save(picture(record), HERE / "ladder_squeeze.png")


if __name__ == "__main__":
    main()

"""Order of section that a squeeze needs, by Filon's tension, the reaction and the end of contact.

A strip is squeezed on both faces over its middle, and pressed onto a frictionless base (scenes
``squeezed`` and ``receding``; Brink 2015, section 4.7). It is solved by the beamshell, p = 0, and
by sections of order p = 1 to 6, on grids of 101 to 801 nodes with linear kinematics, and compared
with finite elements. Where the pressure steps by [p], the reaction of order p steps by
(-1)^p [p]/(p+1), and that of elasticity does not (see tests/solving/test_hierarchic_squeeze.py).

Takes about a quarter of an hour on one core, most of it to compile.
"""

import itertools
from typing import Any

import jax
import matplotlib.pyplot as plt
import numpy as np
from tqdm import tqdm

import jbeamshell as jb
from jbeamshell import plotting
from jbeamshell.measured.example import data_folder
from jbeamshell.scene import library

ORDERS = (0, 1, 2, 3, 4, 6)
NODES = (101, 201, 401, 801)
SHOWN = 401  # nodes of the profiles
END_SIZE = 0.02  # smallest elements over H, before the number of nodes scales all
EDGE, PRESSURE = 50.0, 100.0  # mm, MPa
PROFILE = (EDGE - 1.0, EDGE + 2.5)  # mm
# Finite elements, finest mesh: between the end of contact by pressure, 50.777, and by gap, 50.782.
TRUTH = {"contact_end_mm": 0.779, "reaction_max_MPa": 103.12, "lift_slope": 1.9858e-4}


# --- measuring ------------------------------------------------------------------------------------


def finite_elements(name: str) -> np.ndarray:
    """Table of the finite elements, by column."""
    return np.genfromtxt(data_folder() / "squeeze" / name, delimiter=",", names=True)


def peak(x: np.ndarray, values: np.ndarray) -> tuple[float, float]:
    """Largest value and its place, by a parabola through three points."""
    middle = int(np.clip(np.argmax(values), 1, x.size - 2))
    three = slice(middle - 1, middle + 2)
    parabola = np.polyfit(x[three] - x[middle], values[three], 2)
    place = -parabola[1] / (2.0 * parabola[0])
    return float(np.polyval(parabola, place)), float(x[middle] + place)


def tension_figures(history: jb.History) -> dict[str, Any]:
    """Largest tension beyond the load, and its place."""
    x, stress = np.asarray(history.middles), np.asarray(history.squeeze_stress[-1])
    largest, place = peak(x[x > EDGE], stress[x > EDGE])
    pulls = largest > 1e-6 * PRESSURE
    return {
        "tension_MPa": largest if pulls else 0.0,
        "tension_at_mm": place - EDGE if pulls else None,
    }


def contact_figures(history: jb.History) -> dict[str, Any]:
    """End of contact, reaction and lift."""
    largest, place = peak(np.asarray(history.x), np.asarray(history.reaction[-1]))
    return {
        "contact_end_mm": float(history.contact_end[-1]) - EDGE,
        "reaction_max_MPa": largest,
        "reaction_max_at_mm": place,
        "lift_slope": float(history.lift_slope[-1]),
    }


def profile(x: Any, values: Any) -> list[list[float]]:
    """Rows of x - a and of the values around the edge."""
    x = np.asarray(x)
    inside = (x >= PROFILE[0]) & (x <= PROFILE[1])
    rows = np.stack([x - EDGE, np.asarray(values)])[:, inside]
    return [[float(f"{value:.5g}") for value in row] for row in rows]


def solved(order: int, nodes: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Figures and profiles of both problems on one grid."""
    section = f"p{order}" if order else "squeeze"
    change = {"model.section": section, "model.kinematics": "linear"}
    squeezed = jb.solve(library.squeezed().replace(change).on_grid(nodes, END_SIZE))
    receding = jb.solve(library.receding().replace(change).on_grid(nodes, END_SIZE))
    jax.clear_caches()  # every case compiles programs of its own
    figures = {
        "order": order,
        "nodes": nodes,
        "squeezed": tension_figures(squeezed),
        "receding": contact_figures(receding),
    }
    return figures, {
        "stress": profile(squeezed.middles, squeezed.squeeze_stress[-1]),
        "reaction": profile(receding.x, receding.reaction[-1]),
    }


def measure() -> dict[str, Any]:
    """Record of all sections and grids."""
    cases = list(itertools.product(ORDERS, NODES))
    b2, b3 = finite_elements("b2.csv"), finite_elements("b3.csv")
    tension, place = peak(b2["x_mm"], b2["sy_avg"])
    record: dict[str, Any] = {
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
        figures, profiles = solved(*case)
        record["sections"].append(figures)
        if case[1] == SHOWN:
            record["profiles"][str(case[0])] = profiles
    return record


def tell(record: dict[str, Any]) -> str:
    """Table of the sections, as text."""
    lines = ["p  nodes  tension MPa at mm   x_c - a mm  R max MPa at mm   lift slope"]
    for row in record["sections"]:
        s, r = row["squeezed"], row["receding"]
        at = "-" if s["tension_at_mm"] is None else format(s["tension_at_mm"], ".3f")
        lines.append(
            f"{row['order']}  {row['nodes']:5d}  {s['tension_MPa']:11.4f} {at:>5s}   "
            f"{r['contact_end_mm']:10.4f}  {r['reaction_max_MPa']:9.3f} "
            f"{r['reaction_max_at_mm']:.3f}   {r['lift_slope']:.4e}"
        )
    return "\n".join(lines)


# --- picture --------------------------------------------------------------------------------------


def draw(record: dict[str, Any]) -> plt.Figure:
    """Picture of the stress and of the reaction beside the edge of the load."""
    with plotting.style():
        figure, (stress, reaction) = plt.subplots(1, 2, figsize=(11.0, 4.0))
        draw_stress(record["profiles"], stress)
        draw_reaction(record["profiles"], reaction)
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

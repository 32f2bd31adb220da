"""Squeezed strips by sections: Filon's tension, the reaction and the end of contact.

A strip is squeezed on both faces over its middle, and pressed onto a frictionless base (scenes
``squeezed`` and ``receding``; Brink 2015, section 4.7).  It is solved by the beamshell,
``squeeze``, and as plane elasticity, ``plane``, on grids of 101 to 401 nodes with linear
kinematics, and compared with finite elements.
"""

import itertools
from typing import Any

import jax
import numpy as np
from tqdm import tqdm

import jbeamshell as jb
from jbeamshell.measured.example import data_folder
from jbeamshell.scene import library

SECTIONS = ("squeeze", "plane")
NODES = (101, 201, 401)
END_SIZE = 0.02  # smallest elements over H, before the number of nodes scales all
EDGE, PRESSURE = 50.0, 100.0  # mm, MPa
# Finite elements, finest mesh: between the end of contact by pressure, 50.777, and by gap, 50.782.
TRUTH = {"contact_end_mm": 0.779, "reaction_max_MPa": 103.12, "lift_slope": 1.9858e-4}


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


def solved(section: str, nodes: int) -> dict[str, Any]:
    """Figures of both problems on one grid."""
    change = {"model.section": section, "model.kinematics": "linear"}
    squeezed = jb.solve(library.squeezed().replace(change).on_grid(nodes, END_SIZE))
    receding = jb.solve(library.receding().replace(change).on_grid(nodes, END_SIZE))
    jax.clear_caches()  # every case compiles programs of its own
    return {
        "section": section,
        "nodes": nodes,
        "squeezed": tension_figures(squeezed),
        "receding": contact_figures(receding),
    }


def measure() -> dict[str, Any]:
    """Record of all sections and grids."""
    cases = list(itertools.product(SECTIONS, NODES))
    table = finite_elements("b2.csv")
    tension, place = peak(table["x_mm"], table["sy_avg"])
    return {
        "finite_elements": {"tension_MPa": tension, "tension_at_mm": place - EDGE} | TRUTH,
        "sections": [solved(*case) for case in tqdm(cases, disable=None, unit="case")],
    }


def tell(record: dict[str, Any]) -> str:
    """Table of the sections, as text."""
    lines = ["section  nodes  tension MPa at mm   x_c - a mm  R max MPa at mm   lift slope"]
    for row in record["sections"]:
        s, r = row["squeezed"], row["receding"]
        at = "-" if s["tension_at_mm"] is None else format(s["tension_at_mm"], ".3f")
        lines.append(
            f"{row['section']:7s}  {row['nodes']:5d}  {s['tension_MPa']:11.4f} {at:>5s}   "
            f"{r['contact_end_mm']:10.4f}  {r['reaction_max_MPa']:9.3f} "
            f"{r['reaction_max_at_mm']:.3f}   {r['lift_slope']:.4e}"
        )
    return "\n".join(lines)

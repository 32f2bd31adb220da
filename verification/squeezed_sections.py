"""Order of section that a squeeze needs, by Filon's tension, the reaction and the end of contact.

A strip is squeezed on both faces over its middle, and pressed onto a frictionless base (scenes
``squeezed`` and ``receding``; Brink 2015, section 4.7). It is solved by the beamshell, p = 0, and
by sections of order p = 1 to 6, on grids of 101 to 801 nodes with linear kinematics, some with
exact ones, and compared with finite elements and Filon's exact stress. Where the pressure steps by
[p], the reaction of order p steps by (-1)^p [p]/(p+1), and that of elasticity does not (for the
reason see tests/solving/test_hierarchic_squeeze.py).

Takes about a quarter of an hour on one core, most of it to compile.
"""

from typing import Any

import jax
import matplotlib.pyplot as plt
import numpy as np
from tqdm import tqdm

import jbeamshell as jb
from jbeamshell import plotting
from jbeamshell.measured.example import data_folder
from jbeamshell.mechanics.homogeneous import shear_coefficient
from jbeamshell.reference import filon_average_step, reaction_jump
from jbeamshell.scene import library

ORDERS = (0, 1, 2, 3, 4, 6)
NODES = (101, 201, 401, 801)
SHOWN = 401  # nodes of the profiles
END_SIZE = 0.02  # smallest elements over H, before the number of nodes scales all
EXACT = [(order, 201) for order in (0, 3)]  # once more with exact kinematics
EDGE, PRESSURE = 50.0, 100.0  # mm, MPa
WINDOW = (45.0, 55.0)  # mm, of the rms error
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


def solved(order: int, nodes: int, kinematics: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Figures and profiles of both problems on one grid."""
    section = f"p{order}" if order else "squeeze"
    change = {"model.section": section, "model.kinematics": kinematics}
    squeezed = jb.solve(library.squeezed().replace(change).on_grid(nodes, END_SIZE))
    receding = jb.solve(library.receding().replace(change).on_grid(nodes, END_SIZE))
    jax.clear_caches()  # every case compiles programs of its own
    figures = {
        "order": order,
        "nodes": nodes,
        "kinematics": kinematics,
        "squeezed": squeeze_figures(squeezed),
        "receding": contact_figures(receding) | {"closed_step_MPa": closed_step(order)},
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
    lines = [
        "p  nodes  kinematics  tension MPa at mm   rms MPa  x_c - a mm  R max MPa at mm     "
        "R across the step  lift slope"
    ]
    for row in record["sections"]:
        s, r = row["squeezed"], row["receding"]
        at = "-" if s["tension_at_mm"] is None else format(s["tension_at_mm"], ".3f")
        lines.append(
            f"{row['order']}  {row['nodes']:5d}  {row['kinematics']:10s}  "
            f"{s['tension_MPa']:11.4f} {at:>5s}   {s['rms_MPa']:7.4f}  {r['contact_end_mm']:10.4f}"
            f"  {r['reaction_max_MPa']:9.3f} {r['reaction_max_at_mm']:.3f}    "
            f"{r['reaction_before_step_MPa']:6.2f} -> {r['reaction_after_step_MPa']:6.2f}  "
            f"  {r['lift_slope']:.4e}"
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

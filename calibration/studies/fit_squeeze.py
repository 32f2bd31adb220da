"""Fits of the squeeze-shear factor kappa_s to a squeezed strip.

kappa_s alone is fitted to the mean sigma_y of a strip squeezed over its middle (finite elements;
Brink 2015, section 4.7.2), for both sets of constants, several windows and several grids.  What
loops of friction tell of it is seen in fit_finite_elements and recover_under_noise.
"""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from tqdm import tqdm

import jbeamshell as jb
from jbeamshell import identify, plotting
from jbeamshell.measured.curves import SqueezeCurve
from jbeamshell.measured.example import data_folder
from jbeamshell.reference import best_kappa_s, squeeze_decay_length
from jbeamshell.scene import library

EDGE = 50.0  # mm, where the pressure ends
START = {"consistent": 1.0, "printed": 0.05}
WINDOW = 5.0  # mm, to either side of the edge
WINDOWS = (1.0, 2.0, 10.0, 20.0)
GRIDS = (201, 401, 801)
SHOWN = 3.0  # mm to either side of the edge that are drawn


def squeezed_curve() -> SqueezeCurve:
    """Mean sigma_y of the squeezed strip by finite elements."""
    path = data_folder() / "squeeze" / "b2.csv"
    table = np.genfromtxt(path, delimiter=",", names=True)
    return SqueezeCurve(table["x_mm"], table["sy_avg"], label="finite elements")


def fitted(half_window: float, nodes: int, constants: str) -> tuple[dict[str, Any], identify.Fit]:
    """Figures of a fit in a window around the edge of the load, and the fit."""
    start = {"strip.kappa_s": START[constants], "model.constants": constants, "model.nodes": nodes}
    scene = library.squeezed().replace(start)
    curve = squeezed_curve().between(EDGE - half_window, EDGE + half_window)
    fit = identify.fit(curve, scene, ["strip.kappa_s"])
    kappa_s, strip = fit.values["strip.kappa_s"], scene.strip
    per_consistent = 1.0 if constants == "consistent" else 24.0
    decay = squeeze_decay_length(strip.half_height, per_consistent * kappa_s, strip.poisson_ratio)
    return {
        "constants": constants,
        "half_window_mm": half_window,
        "nodes": nodes,
        "points": curve.x.size,
        "kappa_s": kappa_s,
        "error": fit.errors["strip.kappa_s"],
        "rms_MPa": fit.misfit * float(np.ptp(curve.stress)),
        "decay_length_mm": float(decay),
        "status": fit.status.name.lower(),
        "model_runs": fit.model_runs,
    }, fit


def measure() -> dict[str, Any]:
    """Run all fits; the stress beside the edge is kept to be drawn."""
    cases = [(WINDOW, nodes, constants) for constants in START for nodes in GRIDS]
    cases += [(window, GRIDS[-1], "consistent") for window in WINDOWS]
    rows, profiles = [], {}
    for case in tqdm(cases, disable=None, unit="fit"):
        figures, fit = fitted(*case)
        rows.append(figures)
        if case[:2] == (WINDOW, GRIDS[-1]):
            profiles[case[2]] = _profile(fit.model[0])
            if case[2] == "consistent":
                wide = jb.solve(fit.scene.replace({"strip.kappa_s": 1.0}))
                stress = np.asarray(wide.squeeze_stress[-1])
                profiles["wide"] = _profile(SqueezeCurve(np.asarray(wide.middles), stress))
    return {"squeeze": rows, "profiles": profiles}


def _profile(curve: SqueezeCurve) -> list[list[float]]:
    """Positions and stresses of the part that is drawn."""
    near = np.abs(curve.x - EDGE) <= SHOWN
    return [curve.x[near].tolist(), curve.stress[near].tolist()]


def tell(record: dict[str, Any]) -> str:
    """Figures, a line for each fit."""
    return "\n".join(
        f"{row['constants']:10s} {row['nodes']} nodes, {EDGE:g} +- {row['half_window_mm']:g} mm: "
        f"kappa_s = {row['kappa_s']:.5f} +- {row['error']:.5f}, "
        f"lam = {row['decay_length_mm']:.4f} mm, rms {row['rms_MPa']:.3f} MPa"
        for row in record["squeeze"]
    )


def draw(record: dict[str, Any]) -> plt.Figure:
    """Picture of the stress beside the edge, and of kappa_s by window and grid."""
    with plotting.style():
        figure, (edge, study) = plt.subplots(1, 2, figsize=(11.0, 3.9), width_ratios=(3, 2))
        draw_edge(record, edge)
        draw_windows_and_grids(record["squeeze"], study)
    return figure


def draw_edge(record: dict[str, Any], axes: plt.Axes) -> None:
    """Draw the squeeze stress around the edge of the pressure."""
    curve, profiles = squeezed_curve().between(EDGE - SHOWN, EDGE + SHOWN), record["profiles"]
    best = {
        row["constants"]: row["kappa_s"]
        for row in record["squeeze"]
        if (row["half_window_mm"], row["nodes"]) == (WINDOW, GRIDS[-1])
    }
    blue, _, green, _, yellow, _ = plotting.PALETTE
    zoom = axes.inset_axes((0.6, 0.13, 0.38, 0.45), xlim=(EDGE + 0.4, EDGE + 2.4), ylim=(-7, 2))
    for panel in (axes, zoom):
        label = rf"model, $\kappa_s$ = {best['consistent']:.3f} (fitted)"
        panel.plot(*profiles["consistent"], color=blue, linewidth=2.6, label=label)
        label = rf"printed constants, $\kappa_s$ = {best['printed']:.4f} (fitted)"
        panel.plot(*profiles["printed"], "--", color=yellow, label=label)
        panel.plot(*profiles["wide"], color=green, label=r"model, $\kappa_s$ = 1")
        panel.plot(curve.x, curve.stress, ".", color=plotting.DATA, ms=3.5, label=curve.label)
    zoom.set_title("no single $\\psi$ has Filon's tension", fontsize=9)
    axes.set(
        xlim=(EDGE - 2.4, EDGE + 2.4),
        xlabel="$X$  [mm]",
        ylabel=r"mean of $\sigma_y$  [MPa]",
        title="a strip squeezed up to $X$ = 50 mm",
    )
    axes.legend(loc="upper left")


def draw_windows_and_grids(rows: list[dict], axes: plt.Axes) -> None:
    """Draw kappa_s by window and by grid, side by side."""
    same = [row for row in rows if row["constants"] == "consistent"]
    windows = [row for row in same if row["nodes"] == GRIDS[-1]]
    windows.sort(key=lambda row: row["half_window_mm"])
    grids = [row for row in same if row["half_window_mm"] == WINDOW]
    ticks = [f"$\\pm${row['half_window_mm']:g}" for row in windows]
    ticks += [f"{row['nodes']}" for row in grids]
    values, errors = ([row[name] for row in (*windows, *grids)] for name in ("kappa_s", "error"))
    place = np.append(np.arange(len(windows)), len(windows) + 0.8 + np.arange(len(grids)))
    exact = float(best_kappa_s(0.3))
    axes.axhline(exact, color=plotting.FAINT, linewidth=1.0, label=f"exact stress: {exact:.4f}")
    axes.errorbar(place, values, errors, fmt="o", color=plotting.PALETTE[0], capsize=3.0)
    axes.set_xticks(place, ticks)
    axes.set(
        xlabel="window about the edge  [mm]          nodes",
        ylabel=r"$\kappa_s$  [1]",
        title=f"fitted, with {GRIDS[-1]} nodes          within $\\pm${WINDOW:g} mm",
    )
    axes.legend(loc="best")

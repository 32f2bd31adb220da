"""Error of every section in load steps, over heights and loads.

The sections are on one grid over all heights and amplitudes that finite elements have computed.
Times and errors side by side are those of work_precision.
"""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.patheffects import withStroke
from tqdm import tqdm

import jbeamshell as jb
from calibration.charts import Record
from calibration.tables import energies
from jbeamshell.common.errors import InputError
from jbeamshell.plotting.style import single, style

CYCLES = 2
SECTIONS = ("bar", "shell", "squeeze")
NODES, END_SIZE = 81, 1.0 / 6.0  # smallest elements over H
STEPS = 10  # load steps per half cycle
CONTOURS = (1.0, 5.0, 20.0)  # per cent
SMALLEST = 1e-3  # per cent, of errors drawn
SHADES = (0.1, 100.0)  # per cent, of the lightest and the darkest colour
CELL = {"xlabel": "$\\eta = H/(L/2)$  [1]", "ylabel": "$A\\,/\\,(\\mu F_N L/2)$  [1]"}


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
        .on_grid(NODES, END_SIZE)
    )
    return scene.by_load_steps()


def ratio(history: jb.History, strip: tuple[float, float]) -> float:
    """Dissipation over that of the finite elements."""
    return float(history.dissipation) / energies()[strip]["D"]


def measure() -> dict[str, Any]:
    """Every section on one grid over all cells."""
    rows: dict[Any, dict[str, float]] = {
        cell: {"eta": cell[0], "A": cell[1], "over_cubic_law": row["ratio"]}
        for cell, row in energies().items()
    }
    for section in tqdm(SECTIONS, disable=None, unit="section", desc="map"):
        for cell, row in rows.items():
            row[section] = ratio(jb.solve(modelled(cell, section)), cell)
    return {
        "kinematics": "linear",
        "nodes": NODES,
        "steps": STEPS,
        "sections": list(SECTIONS),
        "cells": list(rows.values()),
    }


# --- chart ----------------------------------------------------------------------------------------


def error_map(
    record: Record, section: str, axes: Axes | None = None, *, colour_bar: bool = True
) -> Axes:
    """Draw the error of a section's dissipation over heights and amplitudes.

    Parameters
    ----------
    record : record of this study
    section : one of the record's map
    axes : where to draw; new ones when not given
    colour_bar : True to explain the colours by a bar beside the axes

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into, the map first among their collections

    Raises
    ------
    InputError
        if the map does not have the section
    """
    if section not in record["sections"]:
        raise InputError(f"section = {section!r}: the map has {', '.join(record['sections'])}")
    eta, amplitude, ratio = _grid(record["cells"], section)
    off = np.maximum(100.0 * abs(ratio - 1.0), SMALLEST)
    with style():
        axes = single(axes)
        shades: Any = {"norm": LogNorm(*SHADES), "cmap": "magma_r", "rasterized": True}
        mesh = axes.pcolormesh(*_edges(eta, amplitude), off, **shades)
        levels = np.log10(CONTOURS)
        lines = axes.contour(eta, amplitude, np.log10(off), levels, colors="0.1", linewidths=1.0)
        lines.set_path_effects([withStroke(linewidth=2.5, foreground="white")])
        names = {np.log10(level): f"{level:g} %" for level in CONTOURS}
        for text in axes.clabel(lines, fmt=names, fontsize=8):
            text.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.8})
        _cell_axes(axes, eta, section)
        if colour_bar:
            axes.figure.colorbar(mesh, ax=axes, extend="both", label="error of the dissipation [%]")
    return axes


def _grid(rows: list[dict[str, Any]], name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Eta, amplitude and a column of the rows, (amplitudes, etas); None where there is no row."""
    eta, amplitude = (np.array(sorted({row[key] for row in rows})) for key in ("eta", "A"))
    by_cell = {(row["A"], row["eta"]): row[name] for row in rows}
    return eta, amplitude, np.array([[by_cell.get((a, e)) for e in eta] for a in amplitude])


def _edges(eta: np.ndarray, amplitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges of cells half way between the values, those of eta on a logarithmic scale."""

    def between(values: np.ndarray) -> np.ndarray:
        middles = 0.5 * (values[1:] + values[:-1])
        ends = 2.0 * values[[0, -1]] - middles[[0, -1]]
        return np.concatenate([ends[:1], middles, ends[1:]])

    return np.exp(between(np.log(eta))), between(amplitude)


def _cell_axes(axes: Axes, eta: np.ndarray, title: str) -> None:
    """Scale, marks and words of axes over heights and amplitudes."""
    axes.grid(False)
    axes.set(xscale="log", title=title, **CELL)
    axes.set_xticks(eta, [f"{value:.2g}".lstrip("0") for value in eta])
    axes.minorticks_off()

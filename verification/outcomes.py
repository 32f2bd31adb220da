"""Outcomes of runs: right, slow, wrong or failed; and charts of the record of failure_map.py.

A cell of the record is a row of figures of one run: the ratio of its dissipation to the bar's, the
estimates of the errors from the grid and from the corner, the closure of the loop, the Newton
iterations per load step, the status, the reference ratio of a fine grid, and the number of doubts.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from calibration.charts import Record
from jbeamshell.common.errors import InputError
from jbeamshell.history.reliability import CLOSES, TOLERANCE
from jbeamshell.plotting.style import single, style

# Outcomes of a run with their colours, told apart by colour-blind readers too.
OUTCOMES: dict[str, str] = {
    "right": "#CFE8DA",
    "right, but slow": "#56B4E9",
    "right, but doubted": "#F0E442",
    "wrong, and says so": "#E69F00",
    "fails, and says so": "#8C8C8C",
    "wrong, silently": "#C0143C",
    "no reference": "white",
}
SLOW = 15.0  # Newton iterations per load step
NEGLIGIBLE = 1e-6  # of the bar's dissipation
SHOWN = (1e-4, 1e2)  # per cent, of errors drawn
NAMES = {
    "eta": r"$\eta = H/(L/2)$",
    "mu": r"$\mu$",
    "load": r"$A\,/\,\mu F_N L$",
    "nu": r"$\nu$",
    "kappa_s": r"$\kappa_s$",
    "alpha": r"$\alpha$",
}


def error_of(cell: Sequence[Any]) -> float:
    """Relative error of a cell's dissipation; NaN where there is none."""
    ratio, reference = cell[0], cell[6]
    if ratio is None or reference is None:
        return np.nan
    return float((ratio - reference) / max(abs(reference), NEGLIGIBLE))


def outcome(cell: Sequence[Any]) -> str:
    """Name of a cell's outcome, one of `OUTCOMES`."""
    _, grid, corner, closure, effort, status, reference, *_ = cell
    if status != 0:
        return "fails, and says so"
    if reference is None:
        return "no reference"
    doubted = grid is None or corner is None or max(grid, corner) > TOLERANCE
    doubted |= closure is None or abs(closure) > CLOSES or cell[7] > 0
    if not abs(error_of(cell)) <= TOLERANCE:
        return "wrong, and says so" if doubted else "wrong, silently"
    if doubted:
        return "right, but doubted"
    return "right, but slow" if effort > SLOW else "right"


def maps(record: Record) -> dict[str, Any]:
    """Maps of the record by name."""
    return {name: part for name, part in record.items() if "cells" in part}


def outcome_map(record: Record, name: str, axes: Axes | None = None) -> Axes:
    """Draw the outcome of every run of a map, with the error of its dissipation in per cent.

    Parameters
    ----------
    record : record of verification/failure_map.py
    name : name of one of its maps
    axes : where to draw; new ones when not given

    Raises
    ------
    InputError
        if the record has no such map
    """
    known = maps(record)
    if name not in known:
        raise InputError(f"name = {name!r}: the record has {', '.join(known)}")
    chart = known[name]
    kinds, shades = list(OUTCOMES), ListedColormap(list(OUTCOMES.values()))
    places = np.array([[kinds.index(outcome(cell)) for cell in row] for row in chart["cells"]])
    with style():
        axes = single(axes)
        limits = {"vmin": -0.5, "vmax": len(kinds) - 0.5}
        axes.pcolormesh(places, cmap=shades, edgecolors="white", linewidth=0.8, **limits)
        for y, row in enumerate(chart["cells"]):
            for x, cell in enumerate(row):
                text = _per_cent(error_of(cell)) if cell[5] == 0 else ""
                axes.text(x + 0.5, y + 0.5, text, ha="center", va="center", fontsize=6)
        axes.grid(False)
        for values, mark in ((chart["columns"], axes.set_xticks), (chart["rows"], axes.set_yticks)):
            texts = [value if isinstance(value, str) else f"{value:.4g}" for value in values]
            mark(np.arange(len(values)) + 0.5, texts)
        axes.tick_params(length=0, labelsize=7)
        axes.tick_params(axis="x", rotation=45)
        xlabel, ylabel = (NAMES.get(chart[axis], chart[axis]) for axis in "xy")
        axes.set(xlabel=xlabel, ylabel=ylabel, title=name)
    return axes


def scatter(record: Record, axes: Axes | None = None) -> Axes:
    """Draw a dot for every random strip with a reference: its error, and its own estimate of it.

    Parameters
    ----------
    record : record of verification/failure_map.py
    axes : where to draw; new ones when not given
    """
    counts = Counter(map(outcome, record["scenes"]))
    cells = [cell for cell in record["scenes"] if cell[5] == 0 and cell[6] is not None]
    kinds = np.array([outcome(cell) for cell in cells])
    error = np.clip([100.0 * abs(error_of(cell)) for cell in cells], *SHOWN)
    guesses = [np.inf if None in cell[1:3] else max(cell[1:3]) for cell in cells]
    estimate = 100.0 * np.minimum(guesses, 10.0)
    look: dict[str, Any] = {"edgecolors": "0.3", "linewidths": 0.3}
    with style():
        axes = single(axes)
        for kind, colour in OUTCOMES.items():
            own = kinds == kind
            if own.any():
                label = f"{kind}: {counts[kind]}"
                axes.scatter(error[own], estimate[own], 12.0, label=label, color=colour, **look)
        for draw in (axes.axvline, axes.axhline):
            draw(100.0 * TOLERANCE, color="0.3", linewidth=0.8, linestyle="--")
        axes.set(xscale="log", yscale="log")
        axes.set_xlabel("error of the dissipation, against a fine grid  [%]")
        axes.set_ylabel("estimate of it by the run itself  [%]")
        failed = counts["fails, and says so"]
        axes.set_title(f"{len(record['scenes'])} random strips, defaults; {failed} fail and say so")
        axes.legend(fontsize=7)
    return axes


def draw(record: Record) -> dict[str, Figure]:
    """Picture of the random strips, by its name."""
    with style():
        figure = plt.subplots(figsize=(6.4, 5.2))[0]
        scatter(record, figure.axes[0])
    return {"scenes": figure}


def _per_cent(error: float) -> str:
    """Text of a relative error, in per cent with its sign."""
    size = 100.0 * abs(error)
    if np.isnan(error) or size < 0.05:
        return "" if np.isnan(error) else "0"
    return f"{100.0 * error:+.0f}" if size >= 10.0 else f"{100.0 * error:+.1f}"

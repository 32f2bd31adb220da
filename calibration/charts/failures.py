"""Pictures of the failure maps: where a method is right, slow, wrong or fails, and if it says so.

The record is that of calibration/failure_map.py, a dictionary as its JSON holds it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from jbeamshell.common.errors import InputError
from jbeamshell.history.reliability import CLOSES, TOLERANCE
from jbeamshell.plotting.style import single, style

Record = Mapping[str, Any]

# What can become of a run, with its colour; told apart by colour-blind readers too.
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
NAMES = {
    "eta": r"$\eta = H/(L/2)$",
    "mu": r"$\mu$",
    "load": r"$A\,/\,\mu F_N L$",
    "nu": r"$\nu$",
    "kappa_s": r"$\kappa_s$",
    "alpha": r"$\alpha$",
    "stiffness": r"$E'\,2H$",
    "k_n": r"$k_n\,H/E'$",
    "m": r"$m$",
}


def off(cell: Sequence[Any]) -> float:
    """Relative error of a cell's dissipation; NaN where there is none."""
    ratio, reference = cell[0], cell[6]
    if ratio is None or reference is None:
        return np.nan
    return float((ratio - reference) / max(abs(reference), NEGLIGIBLE))


def outcome(cell: Sequence[Any]) -> str:
    """Which of `OUTCOMES` a cell is: a row of figures as the record names them."""
    _, grid, corner, closure, effort, status, reference, *_ = cell
    if status != 0:
        return "fails, and says so"
    if reference is None:
        return "no reference"
    doubted = grid is None or corner is None or max(grid, corner) > TOLERANCE
    doubted |= closure is None or abs(closure) > CLOSES or cell[7] > 0
    if not abs(off(cell)) <= TOLERANCE:
        return "wrong, and says so" if doubted else "wrong, silently"
    if doubted:
        return "right, but doubted"
    return "right, but slow" if effort > SLOW else "right"


def failure_map(record: Record, name: str, axes: Axes | None = None) -> Axes:
    """Draw what becomes of every run of a map, with the error of its dissipation in per cent.

    Parameters
    ----------
    record : of calibration/failure_map.py
    name : one of its maps
    axes : where to draw; new ones when not given

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into

    Raises
    ------
    InputError
        if the record has no such map
    """
    if name not in record["maps"]:
        raise InputError(f"name = {name!r}: the record has {', '.join(record['maps'])}")
    chart = record["maps"][name]
    kinds = list(OUTCOMES)
    places = np.array([[kinds.index(outcome(c)) for c in row] for row in chart["cells"]])
    with style():
        axes = single(axes)
        axes.pcolormesh(
            places,
            cmap=ListedColormap(list(OUTCOMES.values())),
            vmin=-0.5,
            vmax=len(kinds) - 0.5,
            edgecolors="white",
            linewidth=0.8,
        )
        for y, row in enumerate(chart["cells"]):
            for x, one in enumerate(row):
                text = _percent(off(one)) if one[5] == 0 else ""
                axes.text(x + 0.5, y + 0.5, text, ha="center", va="center", fontsize=6)
        axes.grid(False)
        axes.set_xticks(np.arange(len(chart["columns"])) + 0.5, _labels(chart["columns"]))
        axes.set_yticks(np.arange(len(chart["rows"])) + 0.5, _labels(chart["rows"]))
        axes.tick_params(length=0, labelsize=7)
        axes.tick_params(axis="x", rotation=45)
        ylabel = "" if chart["y"] == "method" else NAMES.get(chart["y"], chart["y"])
        axes.set(xlabel=NAMES.get(chart["x"], chart["x"]), ylabel=ylabel, title=name)
    return axes


def failure_scatter(record: Record, axes: Axes | None = None) -> Axes:
    """Draw what becomes of the random strips: dissipation over that of the bar, and the error.

    Parameters
    ----------
    record : of calibration/failure_map.py
    axes : where to draw; new ones when not given

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into, a dot for every strip that has a reference
    """
    cells = [cell for cell in record["scenes"] if cell[5] == 0 and cell[6] is not None]
    kinds = [outcome(cell) for cell in cells]
    counts = Counter(map(outcome, record["scenes"]))
    error = 100.0 * np.clip(np.abs([off(cell) for cell in cells]), 1e-4, 1e2)
    estimate = 100.0 * np.array([min(_estimate(cell), 10.0) for cell in cells])
    with style():
        axes = single(axes)
        for kind, colour in OUTCOMES.items():
            own = np.array([k == kind for k in kinds], dtype=bool)
            if own.any():
                look: dict[str, Any] = {"color": colour, "edgecolors": "0.3", "linewidths": 0.3}
                axes.scatter(
                    error[own], estimate[own], 12.0, label=f"{kind}: {counts[kind]}", **look
                )
        for draw in (axes.axvline, axes.axhline):
            draw(100.0 * TOLERANCE, color="0.3", linewidth=0.8, linestyle="--")
        axes.set(
            xscale="log",
            yscale="log",
            xlabel="error of the dissipation, to a fine grid  [%]",
            ylabel="the run's own estimate of it  [%]",
            title=f"{len(record['scenes'])} random strips, defaults; "
            f"{counts['fails, and says so']} fail and say so",
        )
        axes.legend(fontsize=7)
    return axes


def failure_sheets(record: Record) -> dict[str, Figure]:
    """Sheets with all maps of the record, by name, each with a key to the colours."""
    names = list(record["maps"])
    by_method = [name for name in names if record["maps"][name]["y"] == "method"]
    sheets = {"methods": by_method, "settings": [name for name in names if name not in by_method]}
    figures = {}
    with style():
        for sheet, some in sheets.items():
            if some:
                figures[sheet] = _sheet(record, some)
        if record.get("scenes"):
            figures["scenes"] = plt.subplots(figsize=(6.4, 5.2))[0]
            failure_scatter(record, figures["scenes"].axes[0])
    return figures


def _sheet(record: Record, names: Sequence[str]) -> Figure:
    rows = -(-len(names) // 2)
    figure, grid = plt.subplots(rows, 2, figsize=(13.0, 3.6 * rows), squeeze=False)
    for axes in grid.flat[len(names) :]:
        axes.set_axis_off()
    for name, axes in zip(names, grid.flat, strict=False):
        failure_map(record, name, axes)
    keys = [Patch(facecolor=c, edgecolor="0.4", label=kind) for kind, c in OUTCOMES.items()]
    title = "in the cells: error of the dissipation [%]"
    figure.legend(handles=keys, loc="outside upper center", ncols=len(keys), title=title)
    return figure


def _estimate(cell: Sequence[Any]) -> float:
    return np.inf if None in cell[1:3] else max(cell[1:3])


def _percent(error: float) -> str:
    size = 100.0 * abs(error)
    if np.isnan(error) or size < 0.05:
        return "" if np.isnan(error) else "0"
    return f"{100.0 * error:+.0f}" if size >= 10.0 else f"{100.0 * error:+.1f}"


def _labels(values: Sequence[Any]) -> list[str]:
    return [value if isinstance(value, str) else f"{value:.4g}" for value in values]

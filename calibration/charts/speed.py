"""Charts of times beside their errors, from the record of tests/benchmarks/speed.py."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from calibration.charts import table
from calibration.charts.table import Chart, Curve, column
from jbeamshell.plotting.style import DATA, FAINT, PALETTE

FAMILIES: dict[str, str] = {
    "jbeamshell": PALETTE[0],
    "jbeamshell without the flag": PALETTE[5],
    "condensed elements": PALETTE[1],
    "peer": PALETTE[4],
    "NumPy": PALETTE[2],
    "Iwan": PALETTE[3],
    "CalculiX": DATA,
}
MARKERS = "osD^vP*X<"  # of the members of a family
SMALLEST = 1e-3  # per cent, of errors drawn
NODES = "nodes  [1]"


def _errors(axes: Axes, section: Any) -> None:
    """Marks at the time of each way to a cycle's dissipation and at its two errors.

    Filled marks are at the error against the same model on a fine grid, hollow ones at that against
    finite elements.
    """
    members, keys = dict.fromkeys(FAMILIES, 0), []
    for row in section["rows"]:
        family, time = row["by"], row["median_us"]
        look = {"color": FAMILIES[family], "marker": MARKERS[members[family] % len(MARKERS)]}
        members[family] += 1
        own, other = _per_cent(row["error"]), _per_cent(row["error_to_elements"])
        axes.plot([time, time], [own, other], color=FAMILIES[family], linewidth=0.6, alpha=0.6)
        axes.plot(time, other, linestyle="", markersize=5.0, markerfacecolor="white", **look)
        axes.plot(time, own, linestyle="", markersize=6.0, **look)
        keys.append(Line2D([], [], linestyle="", markersize=5.5, label=row["what"], **look))
    axes.yaxis.set_major_formatter(table.PLAIN)
    axes.legend(handles=keys, loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7)


def _nodes(section: Any) -> Iterator[Curve]:
    """Times of a run, median and best, and the slope fitted to them."""
    rows, slope = section["rows"], section["slope"]
    count, us = column(rows, "nodes"), column(rows, "median_us")
    fit = np.exp(np.mean(np.log(us)) + slope * (np.log(count) - np.mean(np.log(count))))
    blue = {"color": PALETTE[0]}
    yield Curve("median", count, us, look=blue)
    yield Curve("best", count, column(rows, "best_us"), look=blue | {"ls": "", "marker": "."})
    dashed = {"color": FAINT, "linestyle": "--", "linewidth": 1.2, "marker": ""}
    yield Curve(f"slope {slope:.2f}", count, fit, look=dashed)


def _derivative(section: Any) -> Iterator[Curve]:
    """Errors of the dissipation's derivative along eta, and dashed of the dissipation itself."""
    rows = _compared(section)
    for size in dict.fromkeys(row["end_size"] for row in rows):
        own = [row for row in rows if row["end_size"] == size]
        error, of_itself = (_per_cent(column(own, name)) for name in ("error", "D_error"))
        label = f"$dD/d\\eta$, end element {size} $H$ before scaling"
        yield Curve(label, column(own, "nodes"), error, of_itself)


def _compared(section: Any) -> list[Any]:
    """Grids of the study but the reference itself."""
    return [row for row in section["study"]["rows"] if row["error"] != 0.0]


def _against(section: Any) -> str:
    """Reference of the study."""
    against = section["study"]["against"]
    reference = f"{against['nodes']} nodes, {against['end_size']} $H$"
    return f"error against {reference}  [%]\ndashed: of $D$"


def _gradients(axes: Axes, section: Any) -> None:
    """Bars of the median costs of gradients, lines at the best."""
    _bars(axes, section["rows"], "median_runs")
    best = column(section["rows"], "best_runs")
    axes.plot(np.arange(best.size), best, color=DATA, marker="_", markersize=14.0, linestyle="")


def _bars(axes: Axes, rows: list[Any], name: str) -> None:
    """Bars of a column, each with its height over that of the first above it."""
    height = column(rows, name)
    bars = axes.bar(np.arange(height.size), height, width=0.6, color=PALETTE[: height.size])
    axes.bar_label(bars, [f"{value / height[0]:.2f}" for value in height], padding=3.0, fontsize=9)
    axes.set_xticks(np.arange(height.size), [row["what"] for row in rows])
    axes.margins(y=0.12)
    axes.grid(False, axis="x")


def _per_cent(error: Any) -> Any:
    """Sizes of errors in per cent, not below what is drawn."""
    return np.maximum(100.0 * np.abs(error), SMALLEST)


CHARTS = {
    "errors": Chart(
        "one",
        "median time of a run  [µs]",
        "error of the dissipation  [%]\nfilled: own limit; hollow: finite elements",
        lambda section: f"$\\eta = {section['eta']:g}$, $A = {section['A']:g}$, one cycle",
        log="xy",
        extra=_errors,
        width=1.5,
    ),
    "nodes": Chart(
        "nodes",
        NODES,
        "time of a run  [µs]",
        lambda section: f"dissipation, {section['steps']} load step per half cycle",
        _nodes,
        "xy",
        ticks=lambda section: column(section["rows"], "nodes"),
    ),
    "gradients": Chart(
        "gradient",
        "",
        "time over that of a run  [1]\nbars: median; lines: best",
        lambda section: f"misfit and its gradient in {len(section['parameters'])} parameters",
        extra=_gradients,
    ),
    "derivative": Chart(
        "gradient",
        NODES,
        _against,
        lambda section: f"{section['study']['steps']} load steps per half cycle",
        _derivative,
        "xy",
        ticks=lambda section: np.unique(column(_compared(section), "nodes")),
        extra=lambda axes, _: axes.yaxis.set_major_formatter(table.PLAIN),
    ),
}
draw = functools.partial(table.draw, CHARTS)
sheet = functools.partial(table.sheet, CHARTS)

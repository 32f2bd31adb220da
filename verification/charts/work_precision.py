"""Chart of the record of tests/benchmarks/work_precision.py: error to elasticity over time."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
from calibration.charts.table import Record, plain_numbers
from matplotlib.axes import Axes

from jbeamshell.plotting.style import DATA, FAINT, style

LOOKS: dict[str, dict[str, Any]] = {  # by family
    "bar": {"color": "0.6", "marker": "s"},
    "shell": {"color": "#D55E00", "marker": "v"},
    "squeeze": {"color": "#CC79A7", "marker": "o"},
    "p2": {"color": "#56B4E9", "marker": "^"},
    "p4": {"color": "#009E73", "marker": "X"},
    "p6": {"color": "#332288", "marker": "P"},
    "plane": {"color": "#117733", "marker": "h"},
    "plain call": {"color": "#E69F00", "marker": "*", "markersize": 13.0},
    "response": {"color": "#E69F00", "marker": "D"},
    "sweep": {"color": "#E69F00", "marker": "<", "markersize": 8.0},
    "condensed elements": {"color": DATA, "marker": "+", "markersize": 8.0},
    "CalculiX": {"color": DATA, "marker": "H", "markersize": 8.0},
}
LEAST = 0.01  # per cent, lower end of the errors


def chart(record: Record) -> plt.Figure:
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


def _strip(axes: Axes, record: Record, truth: dict[str, Any]) -> None:
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

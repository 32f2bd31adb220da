"""Pictures of the speed record: times beside their errors, and how they grow.

The record is that of tests/benchmarks/speed.py, a dictionary as its JSON holds it, or some of its
sections.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

from jbeamshell.common.errors import InputError
from jbeamshell.plotting.style import DATA, FAINT, PALETTE, single, style

Record = Mapping[str, Any]

FAMILIES: dict[str, str] = {
    "jbeamshell": PALETTE[0],
    "jbeamshell without the flag": PALETTE[5],
    "condensed elements": PALETTE[1],
    "peer": PALETTE[4],
    "NumPy": PALETTE[2],
    "Iwan": PALETTE[3],
    "CalculiX": DATA,
}
MARKERS = "osD^vP*X<"  # of a family's members
SMALLEST = 1e-3  # per cent, of errors drawn
LANES = "sweep, lanes per second  [1/s]"
NODES = "nodes  [1]"


def speed_errors(record: Record, axes: Axes | None = None) -> Axes:
    """Draw the error of every way to a cycle's dissipation over the time that it takes.

    Parameters
    ----------
    record : of tests/benchmarks/speed.py
    axes : where to draw; new ones when not given

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into: for each way a filled mark at its error against the same model on a
        fine grid, and a hollow one at that against finite elements

    Raises
    ------
    InputError
        if the record has no section "one"
    """
    section = _section(record, "one")
    members = dict.fromkeys(FAMILIES, 0)
    keys = []
    with style():
        axes = single(axes)
        for row in section["rows"]:
            colour = FAMILIES[row["by"]]
            marker = MARKERS[members[row["by"]] % len(MARKERS)]
            members[row["by"]] += 1
            time = row["median_us"]
            own, other = (_per_cent(row[name]) for name in ("error", "error_to_elements"))
            axes.plot([time, time], [own, other], color=colour, linewidth=0.6, alpha=0.6)
            look: dict[str, Any] = {"color": colour, "marker": marker, "linestyle": ""}
            axes.plot(time, other, markersize=5.0, markerfacecolor="white", **look)
            axes.plot(time, own, markersize=6.0, **look)
            keys.append(Line2D([], [], markersize=5.5, label=row["what"], **look))
        axes.set(xscale="log", yscale="log", xlabel="median time of a run  [µs]")
        axes.set_ylabel("error of the dissipation  [%]\nfilled: own limit; hollow: finite elements")
        axes.set_title(f"$\\eta = {section['eta']:g}$, $A = {section['A']:g}$, one cycle")
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.legend(handles=keys, loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7)
    return axes


def speed_nodes(record: Record, axes: Axes | None = None) -> Axes:
    """Draw the time of a run over the nodes, with the slope fitted to it.

    Parameters
    ----------
    record : of tests/benchmarks/speed.py
    axes : where to draw; new ones when not given

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into

    Raises
    ------
    InputError
        if the record has no section "nodes"
    """
    section = _section(record, "nodes")
    count, us, best = _columns(section["rows"], "nodes", "median_us", "best_us")
    slope = section["slope"]
    with style():
        axes = single(axes)
        axes.plot(count, us, color=PALETTE[0], marker="o", markersize=5.0, label="median")
        axes.plot(count, best, color=PALETTE[0], marker=".", linestyle="", label="best")
        fit = np.exp(np.mean(np.log(us)) + slope * (np.log(count) - np.mean(np.log(count))))
        axes.plot(
            count, fit, color=FAINT, linestyle="--", linewidth=1.2, label=f"slope {slope:.2f}"
        )
        steps = section["steps"]
        axes.set(xscale="log", yscale="log", xlabel=NODES, ylabel="time of a run  [µs]")
        axes.set_title(f"dissipation, {steps} load step per half cycle")
        _ticks(axes, count)
        axes.legend()
    return axes


def speed_batches(record: Record, axes: Axes | None = None) -> Axes:
    """Draw how many lanes a second a sweep runs, over how many it has.

    Parameters
    ----------
    record : of tests/benchmarks/speed.py
    axes : where to draw; new ones when not given

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into; the legend holds the errors of the lanes

    Raises
    ------
    InputError
        if the record has no section "batch"
    """
    section = _section(record, "batch")
    with style():
        axes = single(axes)
        axes.set(xscale="log", yscale="log")
        for row, colour in zip(section["rows"], PALETTE, strict=False):
            own = [s for s in section["sizes"] if s["nodes"] == row["nodes"]]
            count, rate = _columns(own, "lanes", "lanes_per_s")
            steps = f"{row['steps']} step" + "s" * (row["steps"] > 1)
            off = [_per_cent(row[f"error_{name}"]) for name in ("median", "p90", "worst")]
            label = (
                f"{row['nodes']} nodes, {steps}\nerror {off[0]:.2g} %, 90 % below {off[1]:.2g} %"
            )
            label += f", worst {off[2]:.2g} %"
            axes.plot(count, rate, color=colour, marker="o", markersize=5.0, label=label)
            _ticks(axes, count)
        axes.set(xlabel="lanes of the sweep  [1]", ylabel=LANES)
        axes.legend(fontsize=7.5)
    return axes


def speed_gradients(record: Record, axes: Axes | None = None) -> Axes:
    """Draw what gradients of a misfit cost, in runs.

    Parameters
    ----------
    record : of tests/benchmarks/speed.py
    axes : where to draw; new ones when not given

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into: bars of medians, dots of the best

    Raises
    ------
    InputError
        if the record has no section "gradient"
    """
    section = _section(record, "gradient")
    rows = section["rows"]
    with style():
        axes = single(axes)
        _bars(axes, rows, "median_runs")
        (best,) = _columns(rows, "best_runs")
        axes.plot(np.arange(best.size), best, color=DATA, marker="_", markersize=14.0, linestyle="")
        axes.set_ylabel("time over that of a run  [1]\nbars: median; lines: best")
        axes.set_title(f"misfit and its gradient in {len(section['parameters'])} parameters")
    return axes


def speed_derivative(record: Record, axes: Axes | None = None) -> Axes:
    """Draw the error of the dissipation's derivative along eta over nodes, and its own.

    Parameters
    ----------
    record : of tests/benchmarks/speed.py
    axes : where to draw; new ones when not given

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into; where a grid is the reference itself it is left out

    Raises
    ------
    InputError
        if the record has no section "gradient"
    """
    study = _section(record, "gradient")["study"]
    against = study["against"]
    with style():
        axes = single(axes)
        drawn: set[float] = set()
        sizes = dict.fromkeys(row["end_size"] for row in study["rows"])
        for end_size, colour in zip(sizes, PALETTE, strict=False):
            own = [r for r in study["rows"] if r["end_size"] == end_size and r["error"] != 0.0]
            for column, what, line in (
                ("error", "$dD/d\\eta$", "-"),
                ("D_error", "$D$", "--"),
            ):
                count, off = _columns(own, "nodes", column)
                drawn |= set(count)
                label = f"{what}, end element {end_size} $H$ before scaling"
                look: dict[str, Any] = {"color": colour, "linestyle": line, "marker": "o"}
                size = np.maximum(100.0 * np.abs(off), SMALLEST)
                axes.plot(count, size, markersize=4.0, label=label, **look)
        axes.set(xscale="log", yscale="log", xlabel=NODES)
        axes.set_ylabel(f"error against {against['nodes']} nodes, {against['end_size']} $H$  [%]")
        axes.set_title(f"{study['steps']} load steps per half cycle")
        _ticks(axes, np.array(sorted(drawn)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.legend(fontsize=7.5)
    return axes


def speed_processes(record: Record, axes: Axes | None = None) -> Axes:
    """Draw how many lanes a second several processes and devices run.

    Parameters
    ----------
    record : of tests/benchmarks/speed.py
    axes : where to draw; new ones when not given

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into

    Raises
    ------
    InputError
        if the record has no section "processes"
    """
    section = _section(record, "processes")
    with style():
        axes = single(axes)
        _bars(axes, section["rows"], "lanes_per_s")
        axes.set_ylabel(LANES + "\nwithout starting and compiling")
        axes.set_title(f"{section['lanes']:,} lanes, {section['about']['machine']}")
    return axes


PANELS: tuple[tuple[str, Callable[..., Axes]], ...] = (
    ("one", speed_errors),
    ("nodes", speed_nodes),
    ("batch", speed_batches),
    ("gradient", speed_gradients),
    ("gradient", speed_derivative),
    ("processes", speed_processes),
)


def speed_sheet(record: Record) -> Figure:
    """Draw all that the record holds on one sheet.

    Parameters
    ----------
    record : of tests/benchmarks/speed.py

    Returns
    -------
    matplotlib.figure.Figure
        a panel for each of the sections that are there

    Raises
    ------
    InputError
        if the record has none of them
    """
    there = [draw for name, draw in PANELS if name in record]
    if not there:
        raise InputError("record: holds nothing to draw; run tests/benchmarks/speed.py first")
    columns = min(len(there), 3)
    rows = -(-len(there) // columns)
    with style():
        widths = [1.5 if there[0] is speed_errors else 1.0, *[1.0] * (columns - 1)]
        figure, grid = plt.subplots(
            rows,
            columns,
            figsize=(5.2 * sum(widths), 4.6 * rows),
            squeeze=False,
            gridspec_kw={"width_ratios": widths},
        )
        for axes in grid.flat[len(there) :]:
            axes.set_axis_off()
        for draw, axes in zip(there, grid.flat, strict=False):
            draw(record, axes)
    return figure


def _section(record: Record, name: str) -> Mapping[str, Any]:
    if name not in record:
        known = ", ".join(record) or "nothing"
        raise InputError(f"record: has no section {name!r}, but {known}")
    section: Mapping[str, Any] = record[name]
    return section


def _columns(rows: list[dict[str, Any]], *names: str) -> tuple[np.ndarray, ...]:
    return tuple(np.array([row[name] for row in rows], dtype=float) for name in names)


def _per_cent(error: float) -> float:
    return max(100.0 * abs(error), SMALLEST)


def _bars(axes: Axes, rows: list[dict[str, Any]], column: str) -> None:
    """A bar for every row, its height above it over that of the first."""
    (height,) = _columns(rows, column)
    bars = axes.bar(np.arange(height.size), height, width=0.6, color=PALETTE[: height.size])
    axes.bar_label(bars, [f"{value / height[0]:.2f}" for value in height], padding=3.0, fontsize=9)
    axes.set_xticks(np.arange(height.size), [row["what"] for row in rows])
    axes.margins(y=0.12)
    axes.grid(False, axis="x")


def _ticks(axes: Axes, count: np.ndarray) -> None:
    axes.xaxis.set_major_locator(FixedLocator(list(count)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_minor_formatter(NullFormatter())

"""Tables of charts: each chart is a row that says what it shows of a record.

A record is a dictionary as the JSON of a benchmark or study holds it, or some of its sections.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import ArrayLike

from jbeamshell.plotting.style import colours, style

Record = Mapping[str, Any]

OFF = "error of the dissipation  [1]"
COLUMNS = 3  # panels side by side on a sheet
PLAIN = FuncFormatter(lambda value, _: f"{value:g}")


class Curve(NamedTuple):
    """One family of points of a chart.

    Attributes
    ----------
    label : words of the legend
    x, y : (points,) values; on a logarithmic axis, y is drawn by its size
    dashed : (points,) further values over x, drawn dashed
    look : settings of the line that differ from the chart's own
    """

    label: str
    x: ArrayLike
    y: ArrayLike
    dashed: ArrayLike | None = None
    look: Mapping[str, Any] = {}


class Chart(NamedTuple):
    """One chart of a section of a record.

    Attributes
    ----------
    section : name of the section
    xlabel, ylabel, title : words at the axes
    curves : function of the section that gives its curves
    log : names of the logarithmic axes, such as "xy"
    extra : function of the axes and the section that draws anything else
    """

    section: str
    xlabel: str
    ylabel: str
    title: str
    curves: Callable[[Any], Iterable[Curve]]
    log: str = ""
    extra: Callable[[Axes, Any], None] | None = None


def sheet(charts: Mapping[str, Chart], record: Record) -> Figure:
    """Draw all charts of a table, a panel for each.

    Parameters
    ----------
    charts : table of charts by name
    record : record that the table is of
    """
    columns = min(COLUMNS, len(charts))
    rows = -(-len(charts) // columns)
    with style():
        size = (5.0 * columns, 4.3 * rows)
        figure, grid = plt.subplots(rows, columns, figsize=size, squeeze=False)
        for axes in grid.flat[len(charts) :]:
            axes.set_axis_off()
        for chart, axes in zip(charts.values(), grid.flat, strict=False):
            _draw(chart, record[chart.section], axes)
    return figure


def _draw(chart: Chart, section: Any, axes: Axes) -> None:
    axes.set(**{f"{axis}scale": "log" for axis in chart.log})
    axes.set(xlabel=chart.xlabel, ylabel=chart.ylabel, title=chart.title)
    curves = list(chart.curves(section))
    for curve, colour in zip(curves, colours(len(curves)), strict=True):
        _plot(axes, curve, colour)
    if chart.extra is not None:
        chart.extra(axes, section)
    if axes.get_legend_handles_labels()[1]:
        axes.legend(fontsize=7)


def sizes(values: ArrayLike) -> np.ndarray:
    """Sizes of values for a logarithmic axis; None and zero become gaps."""
    size = np.abs(np.asarray(values, float))
    return np.where(size > 0.0, size, np.nan)


def plain_numbers(*axes_of_one: Any) -> None:
    """Write the marks of logarithmic axes as plain numbers."""
    for axis in axes_of_one:
        axis.set_major_formatter(PLAIN)
        axis.set_minor_formatter(NullFormatter())


def _plot(axes: Axes, curve: Curve, colour: Any) -> None:
    """Plot one curve, and dashed what goes with it."""
    log = axes.get_yscale() == "log"
    look = {"color": colour, "marker": "o", "markersize": 4.0, "label": curve.label} | curve.look
    axes.plot(curve.x, sizes(curve.y) if log else curve.y, **look)
    if curve.dashed is not None:
        dashed = sizes(curve.dashed) if log else curve.dashed
        axes.plot(curve.x, dashed, linestyle="--", color=colour, alpha=0.6)

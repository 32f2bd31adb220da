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

from jbeamshell.common.errors import InputError
from jbeamshell.plotting.style import colours, single, style

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


Words = str | Callable[[Any], str]  # fixed, or a function of the section


class Chart(NamedTuple):
    """One chart of a section of a record.

    Attributes
    ----------
    section : name of the section
    xlabel, ylabel, title : words at the axes
    curves : function of the section that gives its curves
    log : names of the logarithmic axes, such as "xy"
    ticks : function of the section that gives the only marks of the x axis
    extra : function of the axes and the section that draws anything else
    """

    section: str
    xlabel: Words
    ylabel: Words
    title: Words = ""
    curves: Callable[[Any], Iterable[Curve]] = lambda section: ()
    log: str = ""
    ticks: Callable[[Any], Iterable[float]] | None = None
    extra: Callable[[Axes, Any], None] | None = None


def draw(charts: Mapping[str, Chart], record: Record, name: str, axes: Axes | None = None) -> Axes:
    """Draw one chart of a table.

    Parameters
    ----------
    charts : table of charts by name
    record : record that the table is of
    name : name of the chart
    axes : where to draw; new ones when not given

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into

    Raises
    ------
    InputError
        if there is no chart of that name, or the record does not have its section
    """
    if name not in charts:
        raise InputError(f"name = {name!r}: choose one of {', '.join(charts)}")
    chart = charts[name]
    if chart.section not in record:
        known = ", ".join(record) or "nothing"
        raise InputError(f"record: has no section {chart.section!r}, but {known}")
    section = record[chart.section]
    with style():
        axes = single(axes)
        axes.set(**{f"{axis}scale": "log" for axis in chart.log})
        for name in ("xlabel", "ylabel", "title"):
            words = getattr(chart, name)
            axes.set(**{name: words(section) if callable(words) else words})
        curves = list(chart.curves(section))
        for curve, colour in zip(curves, colours(len(curves)), strict=True):
            _plot(axes, curve, colour)
        if chart.extra is not None:
            chart.extra(axes, section)
        if chart.ticks is not None:
            ticks = list(chart.ticks(section))
            axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
            axes.set_xticks([], minor=True)
        if axes.get_legend() is None and axes.get_legend_handles_labels()[1]:
            axes.legend(fontsize=7)
    return axes


def sheet(charts: Mapping[str, Chart], record: Record) -> Figure:
    """Draw all charts of a table of which the record has the section.

    Parameters
    ----------
    charts : table of charts by name
    record : record that the table is of

    Returns
    -------
    matplotlib.figure.Figure
        the sheet, a panel for each chart

    Raises
    ------
    InputError
        if the record has the section of none
    """
    names = [name for name, chart in charts.items() if chart.section in record]
    if not names:
        sections = ", ".join(dict.fromkeys(chart.section for chart in charts.values()))
        raise InputError(f"record: has nothing to draw: give one with a section of {sections}")
    columns = min(COLUMNS, len(names))
    rows = -(-len(names) // columns)
    with style():
        figure, grid = plt.subplots(
            rows,
            columns,
            figsize=(5.0 * columns, 4.3 * rows),
            squeeze=False,
        )
    for axes in grid.flat[len(names) :]:
        axes.set_axis_off()
    for name, axes in zip(names, grid.flat, strict=False):
        draw(charts, record, name, axes)
    return figure


def sizes(values: ArrayLike) -> np.ndarray:
    """Sizes of values for a logarithmic axis; None and zero become gaps."""
    size = np.abs(np.asarray(values, float))
    return np.where(size > 0.0, size, np.nan)


def plain_numbers(*axes_of_one: Any) -> None:
    """Write the marks of logarithmic axes as plain numbers."""
    for axis in axes_of_one:
        axis.set_major_formatter(PLAIN)
        axis.set_minor_formatter(NullFormatter())


def column(rows: Iterable[Mapping[str, Any]], name: str) -> np.ndarray:
    """One column of a record's rows, (rows,); NaN where there is None."""
    return np.array([row[name] for row in rows], dtype=float)


def _plot(axes: Axes, curve: Curve, colour: Any) -> None:
    """Plot one curve, and dashed what goes with it."""
    log = axes.get_yscale() == "log"
    look = {"color": colour, "marker": "o", "markersize": 4.0, "label": curve.label} | curve.look
    axes.plot(curve.x, sizes(curve.y) if log else curve.y, **look)
    if curve.dashed is not None:
        dashed = sizes(curve.dashed) if log else curve.dashed
        axes.plot(curve.x, dashed, linestyle="--", color=colour, alpha=0.6)

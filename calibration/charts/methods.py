"""Pictures of methods compared on the same scenes: what decides between them.

The record is that of calibration/methods, a dictionary as its JSON holds it, or some of its
sections.
"""

from __future__ import annotations

from collections.abc import Callable

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from calibration.charts.discretisations import (
    OFF,
    Record,
    methods_contacts,
    methods_grids,
    methods_locking,
    methods_oscillation,
    methods_shooting,
    section_of,
    sizes,
)
from jbeamshell.common.errors import InputError
from jbeamshell.plotting.style import DATA, PALETTE, colours, single, style

STEPS = "load steps per half cycle  [1]"


def methods_laws(record: Record, axes: Axes | None = None, scene: str = "standard") -> Axes:
    """Draw how each friction law's dissipation depends on the number of load steps.

    Parameters
    ----------
    record : of calibration/methods
    axes : where to draw; new ones when not given
    scene : one of the record's

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into: the error against the sharp slider in its finest steps, with each
        law's drift per one-sided cycle in the key

    Raises
    ------
    InputError
        if the record has no section "laws" or no such scene
    """
    rows = [row for row in section_of(record, "laws")["rows"] if row["scene"] == scene]
    if not rows:
        raise InputError(f"scene = {scene!r}: the record's laws were not run on it")
    exact = next(row for row in rows if row["law"] == "sharp")["dissipation"][-1]
    with style():
        axes = single(axes)
        for row, colour in zip(rows, PALETTE, strict=False):
            off = sizes(np.array(row["dissipation"], float) / exact - 1.0)
            drift = "fails" if row["drift"] is None else f"drift {row['drift']:.0e}"
            axes.loglog(row["steps"], off, color=colour, marker="o", label=f"{row['law']}: {drift}")
        axes.set(xlabel=STEPS, ylabel=OFF, title=f"friction laws, {scene}")
        axes.legend(fontsize=7)
    return axes


def methods_steps(record: Record, axes: Axes | None = None) -> Axes:
    """Draw the error of load steps against the exact path from event to event.

    Parameters
    ----------
    record : of calibration/methods
    axes : where to draw; new ones when not given

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into: the slip work of every scene, and dashed the area of its loop

    Raises
    ------
    InputError
        if the record has no section "steps"
    """
    section = section_of(record, "steps")
    rows = section["rows"]
    with style():
        axes = single(axes)
        for row, colour in zip(rows, colours(len(rows)), strict=True):
            axes.loglog(
                section["steps"], sizes(row["off"]), color=colour, marker="o", label=row["scene"]
            )
            axes.loglog(section["steps"], sizes(row["area_off"]), "--", color=colour, alpha=0.5)
        axes.set(xlabel=STEPS, ylabel=OFF, title="load steps against events (dashed: loop area)")
        axes.legend(fontsize=7)
    return axes


def methods_controls(record: Record, axes: Axes | None = None, far_end: str = "free") -> Axes:
    """Draw the force that is reached over what is prescribed, under each control.

    Parameters
    ----------
    record : of calibration/methods
    axes : where to draw; new ones when not given
    far_end : one of the record's

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into; crosses are loads without equilibrium

    Raises
    ------
    InputError
        if the record has no section "controls"
    """
    pulls = section_of(record, "controls")["pulls"]
    with style():
        axes = single(axes)
        for pull, colour in zip(
            [p for p in pulls if p["far_end"] == far_end], PALETTE, strict=False
        ):
            part, force = (np.array([row[k] for row in pull["rows"]]) for k in ("part", "force"))
            failed = np.array([row["unfound"] > 0 for row in pull["rows"]])
            axes.plot(part, force, color=colour, marker="o", markersize=4.0, label=pull["control"])
            axes.plot(part[failed], force[failed], "x", color=DATA, markersize=9.0)
        axes.set(xlabel="prescribed, over its value at gross slip  [1]")
        axes.set(ylabel=r"$F\,/\,\mu F_N L$ reached  [1]", title=f"control, far end {far_end}")
        axes.legend()
    return axes


def methods_solvers(record: Record, axes: Axes | None = None) -> Axes:
    """Draw how often each way to iterate finds all equilibria, and is wrong if nobody looks.

    Parameters
    ----------
    record : of calibration/methods
    axes : where to draw; new ones when not given

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into, with the iterations per load step at the bars

    Raises
    ------
    InputError
        if the record has no section "solvers"
    """
    section = section_of(record, "solvers")
    rows = section["rows"][::-1]
    names = [row["method"] for row in rows]
    place = np.arange(len(rows))
    with style():
        axes = single(axes)
        for shift, key, colour, label in (
            (0.2, "found", PALETTE[2], "every step found"),
            (-0.2, "wrong", PALETTE[1], "wrong, if nobody reads the flag"),
        ):
            share = [100.0 * row[key] for row in rows]
            axes.barh(place + shift, share, height=0.38, color=colour, label=label)
        for y, row in zip(place, rows, strict=True):
            effort = row["iterations"]
            text = "none" if effort is None else f"{effort:.1f} iterations"
            axes.text(102.0, float(y), text, va="center", fontsize=7)
        axes.set_yticks(place, names, fontsize=7)
        axes.set(xlim=(0.0, 130.0), xlabel=f"of {section['strips']} random strips  [%]")
        axes.legend(fontsize=7, loc="lower center", bbox_to_anchor=(0.4, 1.0), ncols=2)
    return axes


CHARTS: dict[Callable[..., Axes], str] = {
    methods_laws: "laws",
    methods_steps: "steps",
    methods_controls: "controls",
    methods_solvers: "solvers",
    methods_locking: "grids",
    methods_oscillation: "grids",
    methods_grids: "grids",
    methods_shooting: "shooting",
    methods_contacts: "contacts",
}


def methods_sheet(record: Record) -> Figure:
    """Draw all charts of which the record has the section.

    Parameters
    ----------
    record : of calibration/methods

    Returns
    -------
    matplotlib.figure.Figure
        the sheet

    Raises
    ------
    InputError
        if there is nothing to draw
    """
    charts = [draw for draw, name in CHARTS.items() if name in record]
    if not charts:
        raise InputError("record: there is nothing to draw")
    rows = -(-len(charts) // 3)
    with style():
        figure, grid = plt.subplots(
            rows, min(3, len(charts)), figsize=(15.0, 4.2 * rows), squeeze=False
        )
        for axes in grid.flat[len(charts) :]:
            axes.set_axis_off()
        for draw, axes in zip(charts, grid.flat, strict=False):
            draw(record, axes)
    return figure

"""Picture of measured data: their loops, and both columns in the order of time."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import EngFormatter

from jbeamshell.plotting.style import FAINT, PALETTE, PANEL, given_axes, looks, style

LAYOUT: Any = [["loop", "force"], ["loop", "displacement"]]
MOST_NAMED = 6  # loops in a legend


def inspection(seen: Any, axes: Any = None) -> list[Axes]:
    """Draw what an inspection found: the recording, its mean loops, and both columns over time.

    Parameters
    ----------
    seen : result of `jbeamshell.inspect`
    axes : three axes, for the loops, the force and the displacement; new ones when not given

    Returns
    -------
    list of matplotlib.axes.Axes
        the three axes
    """
    with style():
        if axes is None:
            axes = list(
                plt.subplot_mosaic(LAYOUT, figsize=(2.2 * PANEL[0], 1.3 * PANEL[1]))[1].values()
            )
        panels = list(given_axes(axes, 3, "an inspection's pictures").ravel())
        loops, *courses = panels
        levels = [level for view in seen.views for level in view.levels]
        own = iter(looks(len(levels)))
        first = seen.views[0].recording
        for view in seen.views:
            recording = view.recording
            shown: dict[str, Any] = {"color": FAINT, "linewidth": 0.8}
            loops.plot(recording.displacement, recording.force, label="_nolegend_", **shown)
            for level in view.levels:
                told = f"{level.cycles} cycles: " if level.cycles > 1 else ""
                mean = level.loop.displacement, level.loop.force
                loops.plot(*mean, **next(own), label=f"{told}{level.shape.kind}")
            timed = all(one.recording.time is not None for one in seen.views)
            count = np.arange(recording.force.size)
            for panel, name in zip(courses, ("force", "displacement"), strict=True):
                clock = recording.time if timed else count
                panel.plot(clock, getattr(recording, name), color=PALETTE[0], linewidth=0.9)
                panel.set(xlabel=_label("time", first) if timed else "point")
        for panel, axis, name in (
            (loops, "x", "displacement"),
            (loops, "y", "force"),
            (courses[0], "y", "force"),
            (courses[1], "y", "displacement"),
        ):
            panel.set(**{f"{axis}label": _label(name, first)})
            if first.unit(name):
                one = panel.xaxis if axis == "x" else panel.yaxis
                one.set_major_formatter(EngFormatter(sep="", usetex=False))
        loops.set_title(_title(seen), wrap=True)
        if 0 < len(levels) <= MOST_NAMED:
            loops.legend(loc="best")
    return panels


def _label(name: str, recording: Any) -> str:
    """Label of an axis, with the unit of its numbers."""
    return f"{name}  [{recording.unit(name) or 'scene'}]"


def _title(seen: Any) -> str:
    """Label of the data with the words of its findings, grave ones first."""
    label = seen.views[0].recording.label if len(seen.views) == 1 else f"{len(seen.views)} loops"
    found = {finding.name: finding.grave for view in seen.views for finding in view.findings}
    grave = [name for name, is_grave in found.items() if is_grave]
    doubts = [name for name, is_grave in found.items() if not is_grave]
    words = [f"refused: {', '.join(grave)}"] if grave else []
    words += [f"doubts: {', '.join(doubts)}"] if doubts else []
    return "\n".join([label, *words])

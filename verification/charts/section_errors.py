"""Chart of the sections' errors over the slip length, for each way in which the force enters.

Drawn from the record of calibration/section_errors.py:

    python -m calibration.charts.section_errors
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from jbeamshell.plotting.style import PALETTE, close, save, style

FOLDER = Path(__file__).parents[1]
SECTIONS = ("shell", "squeeze", "p2", "p4", "p6")
KINDS = ("table", "patch", "laminate", "double shear", "single lap")
EDGES = np.geomspace(0.1, 60.0, 15)
LEAST = 0.02  # per cent, lower end of the charts


def read() -> dict[str, Any]:
    """Errors by kind, entry and section."""
    text = (FOLDER / "section_errors.json").read_text(encoding="utf-8")
    errors: dict[str, Any] = json.loads(text)["errors"]
    return errors


def draw(axes: Axes, rows: dict[str, Any], colour: str, label: str, dots: bool) -> None:
    """Draw the median size of the error of D [%] in bins of the slip length, and its rows."""
    slip, off, share = (np.array(rows[key]) for key in ("slip_over_H", "D_percent", "D_over_bar"))
    kept = share > 1e-4
    slip, off = slip[kept], np.maximum(np.abs(off[kept]), LEAST)
    if dots:
        axes.plot(slip, off, ".", color=colour, markersize=2, alpha=0.4)
    bins = np.digitize(slip, EDGES)
    points = [
        (np.exp(np.mean(np.log(slip[bins == i]))), np.median(off[bins == i]))
        for i in range(1, EDGES.size)
        if np.sum(bins == i) >= 3
    ]
    axes.plot(*np.reshape(points, (-1, 2)).T, color=colour, label=label)


def charts(errors: dict[str, Any]) -> plt.Figure:
    """Sections under an even pressure above, the section squeeze of other kinds below."""
    entries = list(errors["even"])
    figure, panels = plt.subplots(
        2, len(entries), figsize=(10.2, 5.4), sharex=True, sharey=True, layout="constrained"
    )
    for entry, above, below in zip(entries, *panels, strict=True):
        for section, colour in zip(SECTIONS, PALETTE, strict=False):
            rows = errors["even"][entry][section]
            draw(above, rows, colour, section, dots=section == "squeeze")
        for kind, colour in zip(KINDS, PALETTE, strict=False):
            if kind in errors:
                draw(below, errors[kind][entry]["squeeze"], colour, kind, dots=False)
        above.set(title=entry, xscale="log", yscale="log", xlim=(0.1, 60.0), ylim=(LEAST, 1e3))
        below.set_xlabel("slip length over $H$")
    panels[0, 0].set_ylabel("error of $D$, even pressure  [%]")
    panels[1, 0].set_ylabel("error of $D$, squeeze  [%]")
    for row in panels:
        row[-1].legend(fontsize=7)
    return figure


def main() -> None:
    """Draw the chart beside the record."""
    with style():
        figure = charts(read())
        save(figure, FOLDER / "section_errors.png")
        close(figure)


if __name__ == "__main__":
    main()

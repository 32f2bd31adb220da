"""Charts of what a scene chooses for itself: errors of random scenes, and error against cost.

The records are those of calibration/campaign.py and calibration/default_settings.py.

python -m calibration.charts.settings
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from calibration.charts.campaign import chosen, read
from calibration.charts.table import OFF, Chart, Curve, Record
from calibration.charts.table import draw as draw_one
from jbeamshell.plotting.style import close, save, style

TOLERANCE = 0.005
TIMES = (3, 5, 10, 20, 50)  # ms, with a label
SMALLEST, LARGEST = 1e-5, 1.0  # errors that are drawn


def _by_solution(rows: list[dict[str, Any]]) -> Iterable[Curve]:
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        line = row.get("engine") == "contact line"
        groups.setdefault("on the contact line" if line else "in load steps", []).append(row)
    for words, group in groups.items():
        errors = np.sort([choice.error for choice in chosen(group)])
        part = np.arange(1, errors.size + 1) / errors.size
        yield Curve(words, np.clip(errors, SMALLEST, LARGEST), part, look={"marker": ""})


def solved(rows: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows of scenes that were solved for a tolerance and on a fine mesh."""
    return [row for row in rows if row["converged"]]


def _by_tolerance(rows: list[dict[str, Any]]) -> Iterable[Curve]:
    tolerances = sorted({row["tolerance"] for row in rows})
    groups = [[row for row in solved(rows) if row["tolerance"] == t] for t in tolerances]
    ms = [np.median([row["ms"] for row in group]) for group in groups]
    for label, quantile in (("98 % of the strips", 0.98), ("median", 0.5)):
        yield Curve(label, ms, [_quantile(group, quantile) for group in groups])
    yield Curve("tolerance", ms, tolerances, look={"marker": "", "linestyle": "--"})


def _quantile(rows: list[dict[str, Any]], part: float) -> float:
    return float(np.quantile([row["dissipation"] for row in rows], part))


def _limit(axes: Axes, rows: Any) -> None:
    axes.axvline(TOLERANCE, color="0.5", linestyle="--", linewidth=0.8)


def _plain_times(axes: Axes, rows: Any) -> None:
    axes.set_xticks(TIMES, map(str, TIMES))
    axes.minorticks_off()


CHARTS = {
    "kinds": Chart("kinds", OFF, "part of the scenes", "", _by_solution, "x", extra=_limit),
    "tolerances": Chart(
        "tolerances", "time of a run  [ms]", OFF, "", _by_tolerance, "xy", extra=_plain_times
    ),
}


def draw(record: Record, name: str, axes: Axes | None = None) -> Axes:
    """Draw one chart of `CHARTS`."""
    return draw_one(CHARTS, record, name, axes)


def main() -> None:
    """Draw the charts beside the other pictures of the studies."""
    folder = Path(__file__).parents[1]
    record = json.loads((folder / "default_settings.json").read_text(encoding="utf-8"))
    record["kinds"] = read(folder)
    with style():
        figure, panels = plt.subplots(1, len(CHARTS), figsize=(9.0, 3.6), layout="constrained")
        for name, axes in zip(CHARTS, panels, strict=True):
            draw(record, name, axes)
        save(figure, folder / "default_settings.png")
        close(figure)


if __name__ == "__main__":
    main()

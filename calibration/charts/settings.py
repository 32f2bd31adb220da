"""Charts of the record of calibration/default_settings.py: what a scene chooses for itself.

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

from calibration.charts.table import OFF, Chart, Curve, Record
from calibration.charts.table import draw as draw_one
from jbeamshell.plotting.style import close, save, style

TOLERANCE = 0.005
SMALLEST = 1e-5  # error that is drawn as the smallest


def solved(rows: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows of scenes that were solved on both meshes, and slip."""
    return [row for row in rows if row.get("converged") and np.isfinite(row["dissipation"])]


def _by_kind(rows: list[dict[str, Any]]) -> Iterable[Curve]:
    for kind in dict.fromkeys(row["kind"] for row in rows):
        errors = np.sort([row["dissipation"] for row in solved(rows) if row["kind"] == kind])
        part = np.arange(1, errors.size + 1) / max(errors.size, 1)
        yield Curve(kind, np.maximum(errors, SMALLEST), part, look={"marker": ""})


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


CHARTS = {
    "kinds": Chart("kinds", OFF, "part of the scenes", "", _by_kind, "x", extra=_limit),
    "tolerances": Chart("tolerances", "time of a run  [ms]", OFF, "", _by_tolerance, "xy"),
}


def draw(record: Record, name: str, axes: Axes | None = None) -> Axes:
    """Draw one chart of `CHARTS`."""
    return draw_one(CHARTS, record, name, axes)


def main() -> None:
    """Draw the charts beside the other pictures of the studies."""
    folder = Path(__file__).parents[1]
    record = json.loads((folder / "default_settings.json").read_text(encoding="utf-8"))
    with style():
        figure, panels = plt.subplots(1, len(CHARTS), figsize=(9.0, 3.6), layout="constrained")
        for name, axes in zip(CHARTS, panels, strict=True):
            draw(record, name, axes)
        save(figure, folder / "default_settings.png")
        close(figure)


if __name__ == "__main__":
    main()

"""Charts of the record of calibration/four_parameters.py: Iwan's four parameters over geometry.

python -m calibration.charts.four_parameters
"""

from __future__ import annotations

import functools
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from calibration.charts.table import PLAIN, Chart, Curve, Record, sheet
from calibration.charts.table import draw as draw_one
from jbeamshell.plotting.style import close, save, style
from jbeamshell.reference import energy_exponent

LABELS = {
    "even": "even, up to the load",
    "middle": "middle half (bolt)",
    "tapered": "tapered (cone)",
    "single lap": "single lap, one bolt",
}
PARTS = {"even": ("loaded-end", 1.0), "middle": ("inside", 0.5)}  # edge, and pressed part of L
TYPICAL = {"mu": 0.1, "nu": 0.3}
HEIGHT = "height ratio  2H/L"

Rows = list[dict[str, Any]]


def typical(rows: Rows, patch: str) -> Rows:
    """Rows of a patch with usual friction and Poisson's ratio, over the height."""
    return [
        row
        for row in rows
        if row["patch"] == patch and all(row[key] == value for key, value in TYPICAL.items())
    ]


def _exponents(rows: Rows) -> Iterator[Curve]:
    points, lines = [], []
    for patch, (edge, part) in PARTS.items():
        own = typical(rows, patch)
        x = np.concatenate([2.0 * part * np.array(row["force"]) / row["eta"] for row in own])
        n = np.concatenate([row["exponents"] for row in own])
        points.append(Curve(LABELS[patch], x, n, look={"linestyle": "", "markersize": 3.0}))
        line = np.geomspace(np.min(x), np.max(x), 200)
        look = {"marker": "", "color": "0.4", "linewidth": 1.0}
        formula = np.asarray(energy_exponent(line, edge))
        lines.append(Curve("_" if lines else "short formulas", line, formula, look=look))
    yield from (*points, *lines)


def _parameter(rows: Rows, place: int, named: bool = False) -> Iterator[Curve]:
    """Parameter over the height: the fitted one, and dashed that of the formula."""
    for patch, words in LABELS.items():
        label = words if named else "_"
        own = typical(rows, patch)
        given = [row.get("formula", [np.nan] * 3)[place] for row in own]
        dashed = None if np.all(np.isnan(given)) else given
        fitted = [row["fitted"][place] for row in own]
        yield Curve(label, [row["eta"] for row in own], fitted, dashed)


def _errors(rows: Rows, place: int) -> Iterator[Curve]:
    """Errors of D over the height, worst over friction; dashed those of the formula."""
    for patch in LABELS:
        own = [row for row in rows if row["patch"] == patch and row["nu"] == TYPICAL["nu"]]
        heights = sorted({row["eta"] for row in own})
        found = []
        for name in ("fitted_errors", "formula_errors"):
            by_height = [[r.get(name, [np.nan] * 2) for r in own if r["eta"] == h] for h in heights]
            found.append([float(np.max(np.array(each)[:, place])) for each in by_height])
        dashed = None if np.all(np.isnan(found[1])) else found[1]
        yield Curve("_", heights, found[0], dashed)


def _plain(axes: Axes, rows: Any) -> None:
    axes.xaxis.set_major_formatter(PLAIN)


def _from_a_hundredth(axes: Axes, rows: Any) -> None:
    _plain(axes, rows)
    axes.set_ylim(bottom=0.003)


def _over_height(
    label: str, curves: Any, log: str = "x", title: str = "", extra: Any = _plain
) -> Chart:
    return Chart("rows", HEIGHT, label, title, curves, log, extra=extra)


NEAREST, SHORT = "nearest four parameters", "dashed: short formulas"
CHARTS = {
    "exponents": Chart(
        "rows", "slipped length  s/H", r"exponent $n$ of $D \sim F^n$", "", _exponents, "x",
        extra=_plain,
    ),
    "stiffness": _over_height(
        r"$K_T\, L / E'2H$", functools.partial(_parameter, place=0, named=True), "xy", NEAREST
    ),
    "chi": _over_height(r"$\chi$", functools.partial(_parameter, place=1), title=SHORT),
    "beta": _over_height(
        r"$\beta$", functools.partial(_parameter, place=2), "xy", extra=_from_a_hundredth
    ),
    "median": _over_height("median error of D  [1]", functools.partial(_errors, place=0), "xy"),
    "worst": _over_height("worst error of D  [1]", functools.partial(_errors, place=1), "xy"),
}  # fmt: skip


def draw(record: Record, name: str, axes: Axes | None = None) -> Axes:
    """Draw one chart of `CHARTS`."""
    return draw_one(CHARTS, record, name, axes)


def main() -> None:
    """Draw the charts beside the other pictures of the studies."""
    folder = Path(__file__).parents[1]
    record = json.loads((folder / "four_parameters.json").read_text(encoding="utf-8"))
    with style():
        figure = sheet(CHARTS, record)
        save(figure, folder / "four_parameters.png")
        close(figure)


if __name__ == "__main__":
    main()

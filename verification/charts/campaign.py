"""Charts of the record of calibration/campaign.py: outcomes by kind, and errors against estimates.

python -m calibration.charts.campaign
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from calibration.charts.failures import OUTCOMES
from calibration.charts.table import OFF
from jbeamshell.history.reliability import TOLERANCE
from jbeamshell.plotting.style import close, save, style

Row = dict[str, Any]
HATCHES = dict(zip(OUTCOMES, ("", "", "..", "//", "xx", "**", ""), strict=True))
MARKERS = {"right": "o", "right, but doubted": "s", "wrong, and says so": "^"}
SMALLEST, LARGEST = 1e-5, 10.0  # errors and estimates that are drawn


def read(folder: Path) -> list[Row]:
    """Rows of the record in a folder, without its provenance."""
    lines = (folder / "campaign.jsonl").read_text(encoding="utf-8").splitlines()
    return [json.loads(line) for line in lines][1:]


def counts(rows: Iterable[Row]) -> Counter[str]:
    """Number of scenes of each outcome."""
    return Counter(row["outcome"] for row in rows)


class Choice(NamedTuple):
    """Run whose grid and load steps were chosen.

    Attributes
    ----------
    kind : kind of its scene
    error : that of the dissipation or of the loop to a fine mesh, whichever is larger
    doubted : True if it doubts itself
    """

    kind: str
    error: float
    doubted: bool


def chosen(rows: Iterable[Row]) -> list[Choice]:
    """Runs whose grid and load steps were chosen, and that have a fine mesh beside them."""
    return [
        Choice(
            row["kind"], max(row["errors"]["refined"], row["errors"]["loop"]), any(row["doubts"])
        )
        for row in rows
        if row.get("chosen") and "refined" in row["errors"]
    ]


def outcomes(rows: list[Row], axes: Axes) -> Axes:
    """Draw the part of each outcome, by kind of scene."""
    kinds = {
        kind: [r for r in rows if r["kind"] == kind] for kind in sorted({r["kind"] for r in rows})
    }
    names = [f"{kind} ({len(found)})" for kind, found in kinds.items()]
    left = np.zeros(len(kinds))
    for outcome, colour in OUTCOMES.items():
        parts = np.array([counts(found)[outcome] / len(found) for found in kinds.values()])
        if parts.any():
            look = {"color": colour, "edgecolor": "0.3", "hatch": HATCHES[outcome]}
            axes.barh(names, parts, left=left, label=outcome, linewidth=0.4, **look)
            left += parts
    axes.invert_yaxis()
    axes.set(xlabel="part of the scenes", xlim=(0.0, 1.0))
    axes.tick_params(axis="y", labelsize=7)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=7)
    return axes


def estimates(rows: list[Row], axes: Axes) -> Axes:
    """Draw the error of the dissipation against the run's own estimate."""
    for outcome, marker in MARKERS.items():
        found = [r for r in rows if r["outcome"] == outcome and "refined" in r["errors"]]
        x, y = (
            np.clip(values, SMALLEST, LARGEST)
            for values in zip(
                *((r["estimate"], r["errors"]["refined"]) for r in found), strict=True
            )
        )
        look = {"color": OUTCOMES[outcome], "edgecolor": "0.3", "linewidth": 0.2}
        axes.scatter(x, y, 9.0, marker=marker, label=outcome, **look)
    for line in (axes.axhline, axes.axvline):
        line(TOLERANCE, color="0.5", linestyle="--", linewidth=0.8)
    axes.set(xscale="log", yscale="log", xlabel="estimate of the run  [1]", ylabel=OFF)
    axes.legend(fontsize=7)
    return axes


def main() -> None:
    """Draw the charts beside the other pictures of the studies."""
    folder = Path(__file__).parents[1]
    rows = read(folder)
    with style():
        figure, panels = plt.subplots(1, 2, figsize=(10.0, 4.6), layout="constrained")
        outcomes(rows, panels[0])
        estimates(rows, panels[1])
        save(figure, folder / "campaign.png")
        close(figure)


if __name__ == "__main__":
    main()

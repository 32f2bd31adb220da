"""Chart of the error to elasticity over the time of a cycle: plane elasticity beside its rivals.

Drawn from the records of tests/benchmarks/condensed.py and tests/benchmarks/speed.py:

    python -m calibration.charts.condensed
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from jbeamshell.plotting.style import DATA, PALETTE, close, save, single, style

RECORDS = Path(__file__).parents[2] / "tests" / "benchmarks"
SINGLE = {  # rows of the record of speeds, of another machine: label, colour and marker of each
    "dissipation, 1 step": ("beamshell, 41 nodes", PALETTE[2], "^"),
    "CalculiX, 4 steps": ("CalculiX", DATA, "P"),
    "CalculiX, 20 steps": ("", DATA, "P"),
}
KINDS = (("kept_us", "matrices kept", "-"), ("built_us", "building included", "--"))


def draw(axes: Axes, condensed: dict[str, Any], speeds: dict[str, Any]) -> None:
    """Draw errors of D against elasticity [%] over the time of a cycle [ms], both logarithmic."""
    rivals = (("ours", "plane", PALETTE[0], "o"), ("theirs", "condensed elements", PALETTE[1], "s"))
    for name, label, colour, marker in rivals:
        rows = [r for r in condensed["peer"][name] if r.get("steps_per_quarter", 10) == 10]
        error = [100.0 * abs(row["error"]) for row in rows]
        for kind, how, dashes in KINDS:
            times = [1e-3 * row[kind] for row in rows]
            axes.plot(times, error, dashes, color=colour, marker=marker, label=f"{label}, {how}")
    for row in speeds["one"]["rows"]:
        if row["what"] in SINGLE:
            label, colour, marker = SINGLE[row["what"]]
            place = 1e-3 * row["best_us"], 100.0 * abs(row["error_to_elements"])
            axes.plot(*place, linestyle="", color=colour, marker=marker, label=label or None)
    axes.set(xscale="log", yscale="log", xlim=(1e-2, 1e5))
    axes.set_xlabel("time of a cycle on one core  [ms]")
    axes.set_ylabel("error of the dissipation to elasticity  [%]")
    axes.legend(
        loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, fontsize=8, handlelength=3.5
    )


def main() -> None:
    """Draw the chart beside the other pictures of the studies."""
    records = (
        json.loads((RECORDS / name).read_text()) for name in ("condensed.json", "speed.json")
    )
    with style():
        axes = single(None)
        draw(axes, *records)
        save(axes.figure, Path(__file__).parents[1] / "condensed.png")
        close(axes.figure)


if __name__ == "__main__":
    main()

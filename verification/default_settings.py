"""Error and cost of the settings that a scene chooses for itself, over its tolerance.

Plain random scenes are solved for several tolerances, as they are and with the same model on a mesh
twice as fine.  The errors are those of the dissipation and of the loop (largest difference of the
response over its range).  `jbeamshell.scene.planning` takes its numbers from here and from
verification/campaign.py, which has scenes of all kinds; the picture shows both records.
"""

import time
from collections.abc import Iterable
from typing import Any

import jax
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from tqdm import tqdm

import jbeamshell as jb
from calibration.charts import OFF, Chart, Curve, sheet
from verification.campaign import Row, chosen, finer, loop_error, off, read
from verification.random_scenes import Values, plain

SEED = 20
TOLERANCES = (0.02, 0.01, 0.005, 0.0025)
SHOWN = 0.005  # tolerance of the scenes of the campaign
TIMES = (3, 5, 10, 20, 50)  # ms, with a label
SMALLEST, LARGEST = 1e-5, 1.0  # errors that are drawn


def compared(values: Values) -> Row:
    """Errors and time of one scene."""
    scene = jb.library.standard().replace(values)
    jb.solve(scene, throw=False)
    begun = time.perf_counter()
    found = jax.block_until_ready(jb.solve(scene, throw=False))
    took = time.perf_counter() - begun
    fine = jb.solve(finer(found.scene), throw=False)
    return {
        "dissipation": off(float(found.dissipation), float(fine.dissipation)),
        "loop": loop_error(found, fine),
        "converged": found.converged and fine.converged,
        "ms": 1e3 * took,
    }


def measure(scenes: int = 100) -> dict[str, Any]:
    """Rows of plain scenes, the same for each tolerance."""
    rows = []
    for tolerance in TOLERANCES:
        random = np.random.default_rng(SEED)
        for _ in tqdm(range(scenes), f"tolerance {tolerance:g}"):
            rows.append(
                {"tolerance": tolerance} | compared(plain(random) | {"model.tolerance": tolerance})
            )
    return {"seed": SEED, "tolerances": rows}


# --- chart ----------------------------------------------------------------------------------------


def _by_solution(rows: list[dict[str, Any]]) -> Iterable[Curve]:
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        line = row.get("engine") == "contact line"
        groups.setdefault("on the contact line" if line else "in load steps", []).append(row)
    for words, group in groups.items():
        errors = np.sort([choice.error for choice in chosen(group)])
        part = np.arange(1, errors.size + 1) / errors.size
        yield Curve(words, np.clip(errors, SMALLEST, LARGEST), part, look={"marker": ""})


def _by_tolerance(rows: list[dict[str, Any]]) -> Iterable[Curve]:
    tolerances = sorted({row["tolerance"] for row in rows})
    groups = [
        [row for row in rows if row["converged"] and row["tolerance"] == t] for t in tolerances
    ]
    ms = [np.median([row["ms"] for row in group]) for group in groups]
    for label, quantile in (("98 % of the strips", 0.98), ("median", 0.5)):
        yield Curve(label, ms, [_quantile(group, quantile) for group in groups])
    yield Curve("tolerance", ms, tolerances, look={"marker": "", "linestyle": "--"})


def _quantile(rows: list[dict[str, Any]], part: float) -> float:
    return float(np.quantile([row["dissipation"] for row in rows], part))


def _limit(axes: Axes, rows: Any) -> None:
    axes.axvline(SHOWN, color="0.5", linestyle="--", linewidth=0.8)


def _plain_times(axes: Axes, rows: Any) -> None:
    axes.set_xticks(TIMES, map(str, TIMES))
    axes.minorticks_off()


CHARTS = {
    "kinds": Chart("kinds", OFF, "part of the scenes", "", _by_solution, "x", extra=_limit),
    "tolerances": Chart(
        "tolerances", "time of a run  [ms]", OFF, "", _by_tolerance, "xy", extra=_plain_times
    ),
}


def draw(record: dict[str, Any]) -> Figure:
    """Errors of random scenes, and error against cost."""
    return sheet(CHARTS, record | {"kinds": read()})

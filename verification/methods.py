"""Methods that could solve the same scenes, compared by numbers that decide.

Friction laws, iterations, grids, load steps against events, shooting.  What the library has is
called; what it lacks is written in `compared`, each in a small file, to be measured and to fail
where all can see it.  Half an hour on one core.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any

import jax
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from tqdm import tqdm

import jbeamshell as jb
from calibration import charts
from calibration.charts import OFF, Chart, Curve, column
from jbeamshell.plotting.style import FAINT, PALETTE
from verification.compared import events, grids, laws, shooting, solvers, strips

PER_HALF_CYCLE = "load steps per half cycle  [1]"
STEPS = [2, 10, 40, 320]
FEWER_STEPS = [10, 40]  # of all scenes but the first
LAW_STRIPS, NODES = ("standard", "thick", "near gross slip"), 41  # on which laws are compared
STRIPS = 200
GROWTH = 60.0  # digits, the end of the axis
SMALLEST = 1e-17  # of the errors of shooting
EPS = float(np.finfo(float).eps)
Section = dict[str, Any]


def compared_laws() -> Section:
    """Dissipation over steps per half cycle, and drift, of every law on every scene."""
    rows = []
    pairs = [(name, law) for name in LAW_STRIPS for law in laws.LAWS]
    for name, law in tqdm(pairs, desc="laws", disable=None):
        steps = STEPS if name == LAW_STRIPS[0] else FEWER_STEPS
        work, area = zip(*laws.dissipations(name, law, steps, NODES), strict=True)
        row = {"scene": name, "law": law, "steps": steps, "dissipation": work, "area": area}
        rows.append(row | {"drift": laws.drift(name, law, nodes=NODES)})
    return {"rows": rows}


def compared_solvers() -> Section:
    """Success, wrong answers and iterations over random strips."""
    values = solvers.random_strips(STRIPS)
    names = [solvers.LIBRARY, *solvers.METHODS]
    nothing = solvers.NEGLIGIBLE * np.array([solvers.bar_dissipation(one) for one in values])
    right, rows = None, []
    for name in tqdm(names, desc="solvers", disable=None):
        run = solvers.runner(name)
        runs = [jax.tree.map(float, run(one)) for one in values]
        if right is None:
            right = np.array([one.dissipation for one in runs])
        found = solvers.tally(runs, right, nothing)._asdict()
        rows.append({"method": name} | {k: strips.number(v) for k, v in found.items()})
        jax.clear_caches()
    return {
        "strips": len(values),
        "tries": solvers.TRIES,
        "wrong_by": solvers.WRONG,
        "rows": rows,
    }


def compared_grids() -> Section:
    """Locking and oscillation."""
    heights = [float(eta) for eta in np.geomspace(0.005, 0.4, 12)]
    sizes = [0.25, 0.5, 1.0, 2.0, 4.0, 8.0]
    locking = {name: [grids.cantilever(eta, name) for eta in heights] for name in grids.RULES}
    oscillation = {name: [grids.squeezed(size, name) for size in sizes] for name in grids.RULES}
    return {
        "heights": heights,
        "locking": locking,
        "elements_per_height": sizes,
        "oscillation": oscillation,
    }


def compared_steps() -> Section:
    """Load steps against the exact path from event to event."""
    counts = [1, 2, 4, 10, 40, 160]
    rows = []
    for name in tqdm(strips.STRIPS, desc="events", disable=None):
        scene = strips.scene_of(name, 41)
        exact, stiffness, changes = events.dissipation(scene)
        found = [
            jb.solve(scene.replace({"load.steps_per_half_cycle": n}), throw=False) for n in counts
        ]
        rows.append(
            {
                "scene": name,
                "dissipation": exact,
                "events": changes,
                "off": [strips.number(h.dissipation / exact - 1.0) for h in found],
                "area_off": [strips.number(h.dissipation_loop / exact - 1.0) for h in found],
                "stiffness_off": [
                    strips.number(h.secant_stiffness / stiffness - 1.0) for h in found
                ],
            }
        )
    return {"steps": counts, "rows": rows}


def compared_shooting() -> Section:
    """Errors of shooting over the growth of its solutions."""
    lengths = [float(x) for x in np.geomspace(1.0, 100.0, 25)]
    return {"squeeze": [shooting.shoot_squeeze(x)._asdict() for x in lengths]}


PARTS = {
    "shooting": compared_shooting,
    "steps": compared_steps,
    "grids": compared_grids,
    "solvers": compared_solvers,
    "laws": compared_laws,
}


# --- charts ---------------------------------------------------------------------------------------


def _laws(section: Any) -> Iterator[Curve]:
    """Friction laws against the sharp slider in its finest steps; drift per one-sided cycle."""
    rows = [row for row in section["rows"] if row["scene"] == LAW_STRIPS[0]]
    exact = next(row for row in rows if row["law"] == "sharp")["dissipation"][-1]
    for row in rows:
        drift = "fails" if row["drift"] is None else f"drift {row['drift']:.0e}"
        off = np.array(row["dissipation"], float) / exact - 1.0
        yield Curve(f"{row['law']}: {drift}", row["steps"], off)


def _steps(section: Any) -> Iterator[Curve]:
    """Load steps against the exact path from event to event, by slip work and by loop area."""
    for row in section["rows"]:
        yield Curve(row["scene"], section["steps"], row["off"], row["area_off"])


def _solvers(axes: Axes, section: Any) -> None:
    """Bars of how often each solver finds every step, and is wrong if nobody reads its flag."""
    rows = section["rows"][::-1]
    place = np.arange(len(rows))
    for shift, name, colour, label in (
        (0.2, "found", PALETTE[2], "every step found"),
        (-0.2, "wrong", PALETTE[1], "wrong, if nobody reads the flag"),
    ):
        share = 100.0 * column(rows, name)
        axes.barh(place + shift, share, height=0.38, color=colour, label=label)
    for y, row in zip(place, rows, strict=True):
        effort = row["iterations"]
        text = "none" if effort is None else f"{effort:.1f} iterations"
        axes.text(102.0, float(y), text, va="center", fontsize=7)
    axes.set_xlim(0.0, 130.0)
    axes.set_yticks(place, [row["method"] for row in rows], fontsize=7)
    axes.legend(fontsize=7, loc="lower center", bbox_to_anchor=(0.4, 1.0), ncols=2)


def _shooting(section: Any) -> Iterator[Curve]:
    """Errors of shooting over the digits by which its solution grows."""
    rows = section["squeeze"]
    error, look = np.maximum(column(rows, "error"), SMALLEST), {"linestyle": ""}
    yield Curve("squeezed strip", column(rows, "growth"), error, look=look)


def _rounding(axes: Axes, section: Any) -> None:
    """Rounding error times the growth, over all of the axis."""
    axes.set(xlim=(0.0, GROWTH), ylim=(SMALLEST, 1e6))
    digits = np.array([0.0, GROWTH])
    axes.plot(digits, EPS * 10.0**digits, color=FAINT, label="rounding times growth")


def _families(x: str, name: str, section: Any) -> Iterator[Curve]:
    """Families of a figure by quadrature, over one column of the section."""
    for label, values in section[name].items():
        yield Curve(label, section[x], values)


CHARTS = {
    "laws": Chart("laws", PER_HALF_CYCLE, OFF, f"friction laws, {LAW_STRIPS[0]}", _laws, "xy"),
    "steps": Chart(
        "steps", PER_HALF_CYCLE, OFF, "load steps against events (dashed: loop area)", _steps, "xy"
    ),
    "solvers": Chart(
        "solvers", lambda section: f"of {section['strips']} random strips  [%]", "", extra=_solvers
    ),
    "locking": Chart(
        "grids",
        r"$\eta = H/(L/2)$  [1]",
        "deflection over exact  [1]",
        "locking of 20 elements",
        functools.partial(_families, "heights", "locking"),
        "x",
    ),
    "oscillation": Chart(
        "grids",
        "elements per $H$  [1]",
        "overshoot over the load  [1]",
        "oscillation of the squeeze",
        functools.partial(_families, "elements_per_height", "oscillation"),
        "x",
        ticks=lambda section: section["elements_per_height"],
    ),
    "shooting": Chart(
        "shooting",
        "growth of the fastest solution  [digits]",
        "error of the fields  [1]",
        "shooting in double precision",
        _shooting,
        "y",
        extra=_rounding,
    ),
}
chart = functools.partial(charts.draw, CHARTS)


def draw(record: Section) -> plt.Figure:
    """Sheet of all charts."""
    return charts.sheet(CHARTS, record)

"""Charts of methods compared on the same scenes, from the record of calibration/methods."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from calibration.charts import table
from calibration.charts.table import OFF, Chart, Curve, column
from jbeamshell.plotting.style import DATA, FAINT, PALETTE

STEPS = "load steps per half cycle  [1]"
SCENE = "standard"  # whose friction laws are drawn
FAR_END = "free"  # whose controls are drawn
GROWTH = 60.0  # digits, the end of the axis
SMALLEST = 1e-17  # of the errors of shooting
EPS = float(np.finfo(float).eps)
CONTACT = {"contact_end": "end of contact", "reaction_max": "largest R", "lift_slope": "slope"}


def _laws(section: Any) -> Iterator[Curve]:
    """Friction laws against the sharp slider in its finest steps; drift per one-sided cycle."""
    rows = [row for row in section["rows"] if row["scene"] == SCENE]
    exact = next(row for row in rows if row["law"] == "sharp")["dissipation"][-1]
    for row in rows:
        drift = "fails" if row["drift"] is None else f"drift {row['drift']:.0e}"
        off = np.array(row["dissipation"], float) / exact - 1.0
        yield Curve(f"{row['law']}: {drift}", row["steps"], off)


def _steps(section: Any) -> Iterator[Curve]:
    """Load steps against the exact path from event to event, by slip work and by loop area."""
    for row in section["rows"]:
        yield Curve(row["scene"], section["steps"], row["off"], row["area_off"])


def _controls(section: Any) -> Iterator[Curve]:
    """Force that is reached, by the control."""
    for pull in _pulls(section):
        yield Curve(pull["control"], column(pull["rows"], "part"), column(pull["rows"], "force"))


def _no_equilibrium(axes: Axes, section: Any) -> None:
    """Crosses at loads without equilibrium."""
    failed = [row for pull in _pulls(section) for row in pull["rows"] if row["unfound"] > 0]
    axes.plot(column(failed, "part"), column(failed, "force"), "x", color=DATA, markersize=9.0)


def _pulls(section: Any) -> list[Any]:
    """Pulls of strips with the far end that is drawn."""
    return [pull for pull in section["pulls"] if pull["far_end"] == FAR_END]


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


def _grids(section: Any) -> Iterator[Curve]:
    """Grids by their errors of dissipation and of secant stiffness."""
    for row in section["rows"]:
        label = f"{row['grid']}, {row['scene']}"
        yield Curve(label, section["nodes"], row["dissipation_off"], row["stiffness_off"])


def _shooting(section: Any) -> Iterator[Curve]:
    """Errors of shooting over the digits by which the fastest solution grows."""
    families = {"squeezed": ("o", section["squeeze"], "error")}
    for alpha in sorted({row["alpha"] for row in section["stuck"]}):
        rows = [r for r in section["stuck"] if r["alpha"] == alpha and r["path_error"] is not None]
        families[rf"stuck, $\alpha = {alpha:g}$"] = ("s", rows, "path_error")
    for label, (marker, rows, name) in families.items():
        error = np.maximum(column(rows, name), SMALLEST)
        yield Curve(label, column(rows, "growth"), error, look={"marker": marker, "linestyle": ""})


def _rounding(axes: Axes, section: Any) -> None:
    """Rounding error times the growth, over all of the axis."""
    axes.set(xlim=(0.0, GROWTH), ylim=(SMALLEST, 1e6))
    digits = np.array([0.0, GROWTH])
    axes.plot(digits, EPS * 10.0**digits, color=FAINT, label="rounding times growth")


def _contacts(section: Any) -> Iterator[Curve]:
    """Compliant contact against the active set, by three figures of receding contact."""
    rigid, *soft = section["receding"]
    for name, label in CONTACT.items():
        yield Curve(label, column(soft, "k_n"), column(soft, name) / rigid[name] - 1.0)


def _iterations(section: Any) -> str:
    """Iterations of both kinds of contact."""
    rigid, *soft = (row["iterations"] for row in section["receding"])
    return f"compliance: {min(soft)} to {max(soft)} iterations; active set: {rigid}"


def _families(x: str, name: str, section: Any) -> Iterator[Curve]:
    """Families of a figure by quadrature, over one column of the section."""
    for label, values in section[name].items():
        yield Curve(label, section[x], values)


CHARTS = {
    "laws": Chart("laws", STEPS, OFF, f"friction laws, {SCENE}", _laws, "xy"),
    "steps": Chart(
        "steps", STEPS, OFF, "load steps against events (dashed: loop area)", _steps, "xy"
    ),
    "controls": Chart(
        "controls",
        "prescribed, over its value at gross slip  [1]",
        r"$F\,/\,\mu F_N L$ reached  [1]",
        f"control, far end {FAR_END}",
        _controls,
        extra=_no_equilibrium,
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
    "grids": Chart(
        "grids",
        "nodes  [1]",
        f"{OFF}\n(dashed: of the secant stiffness)",
        "",
        _grids,
        "xy",
        ticks=lambda section: section["nodes"],
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
    "contacts": Chart(
        "contacts",
        r"$k_n\,H/E'$  [1]",
        "difference from the active set  [1]",
        _iterations,
        _contacts,
        "xy",
    ),
}
draw = functools.partial(table.draw, CHARTS)
sheet = functools.partial(table.sheet, CHARTS)

"""Segalman's four parameters from geometry alone, over height, friction, nu and pressure patch.

Every scene is plane elasticity in steady cycles of .1 to .95 of gross slip.  A row holds the
exponents of D ~ F^n, the parameters of the four-parameter Iwan model that is nearest to the scene's
displacement and dissipation, its errors, and those of `jbeamshell.reference.slip_energy`.  Takes
a quarter of an hour.
"""

import functools
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import jbeamshell as jb
from calibration.charts import PLAIN, Chart, Curve, sheet
from jbeamshell.dynamics import four_parameters
from jbeamshell.reference import energy_exponent

HEIGHTS = (0.01, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4)
FRICTIONS = (0.05, 0.1, 0.3)
CURVES = ("force", "displacement", "dissipation", "exponents", "energy_errors")
EDGES = {"even": ("loaded-end", 1.0), "middle": ("inside", 0.5)}  # and the pressed part of L
P = 10.0
PATCHES: dict[str, Any] = {
    "even": P,
    "middle": [[0, 0.0], [0.5, 0.0], [0.5, 2 * P], [1.5, 2 * P], [1.5, 0.0], [2, 0.0]],
    "tapered": [[0, 0.1 * P], [1, 1.9 * P], [2, 0.1 * P]],
}


def scenes() -> Iterator[tuple[dict[str, Any], jb.Scene]]:
    """Varied numbers of a row, and its scene."""
    for patch, pressure in PATCHES.items():
        scene = jb.library.standard().replace(
            {"model.section": "plane", "contact.pressure": pressure}
        )
        for eta in HEIGHTS:
            cases = [(mu, 0.3) for mu in FRICTIONS]
            cases += [(0.1, nu) for nu in (0.0, 0.45) if eta in (0.05, 0.2, 0.4)]
            for mu, nu in cases:
                given = {"strip.height_ratio": eta, "contact.friction": mu}
                about = {"patch": patch, "eta": eta, "mu": mu, "nu": nu}
                yield about, scene.replace(given | {"strip.poisson_ratio": nu})
    lap = jb.library.single_lap().replace({"model.section": "plane"})
    for eta in (0.05, 0.1, 0.2, 0.3):
        for mu in (0.1, 0.3):
            given = {"strip.height_ratio": eta, "contact.friction": mu}
            yield {"patch": "single lap", "eta": eta, "mu": mu, "nu": 0.3}, lap.replace(given)


def row(scene: jb.Scene) -> dict[str, Any]:
    """Curves, parameters and errors of a scene; forces over F_S, displacements over F_S L/EA."""
    found = four_parameters(scene)
    law, slip = found.law, float(found.law.slip_force)
    unit = slip * float(scene.strip.length / scene.strip.axial_stiffness)
    off = np.abs(found.dissipation_error)
    return {
        "force": (found.force / slip).tolist(),
        "displacement": (found.displacement / unit).tolist(),
        "dissipation": (found.dissipation / (slip * unit)).tolist(),
        "exponents": found.exponents.tolist(),
        "fitted": [float(law.stiffness) * unit / slip, float(law.chi), float(law.beta)],
        "fitted_errors": [float(np.median(off)), float(np.max(off))],
        "fitted_displacement_error": float(np.max(np.abs(found.displacement_error))),
    }


def energy_errors(about: dict[str, Any], each: dict[str, Any]) -> dict[str, Any]:
    """Errors of D by the bar's energy and the factor of height; nothing for other patches."""
    if about["patch"] not in EDGES:
        return {}
    edge, part = EDGES[about["patch"]]
    force, half = np.array(each["force"]), 0.5 * about["eta"]  # L = E' 2H = F_S = 1
    energy = np.asarray(jb.reference.slip_energy(force, 1.0 / part, 1.0, half, edge))
    return {"energy_errors": (energy / each["dissipation"] - 1.0).tolist()}


def measure() -> dict[str, Any]:
    """Rows of all scenes."""
    rows: list[dict[str, Any]] = []
    failed: list[dict[str, Any]] = []
    for about, scene in scenes():
        try:
            each = row(scene)
        except jb.UnconvergedError as error:
            failed.append(about | {"why": str(error)})
            continue
        rows.append(about | each | energy_errors(about, each))
        print({key: rows[-1][key] for key in rows[-1] if key not in CURVES}, flush=True)
    return {"rows": rows, "failed": failed}


# --- charts ---------------------------------------------------------------------------------------

LABELS = {
    "even": "even, up to the load",
    "middle": "middle half (bolt)",
    "tapered": "tapered (cone)",
    "single lap": "single lap, one bolt",
}
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
    for patch, (edge, part) in EDGES.items():
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
    """Parameter over the height."""
    for patch, words in LABELS.items():
        own = typical(rows, patch)
        fitted = [row["fitted"][place] for row in own]
        yield Curve(words if named else "_", [row["eta"] for row in own], fitted)


def _errors(rows: Rows, place: int) -> Iterator[Curve]:
    """Errors of D over the height, worst over friction."""
    for patch in LABELS:
        own = [row for row in rows if row["patch"] == patch and row["nu"] == TYPICAL["nu"]]
        heights = sorted({row["eta"] for row in own})
        errors = [[r["fitted_errors"][place] for r in own if r["eta"] == h] for h in heights]
        yield Curve("_", heights, [max(each) for each in errors])


def _plain(axes: Axes, rows: Any) -> None:
    axes.xaxis.set_major_formatter(PLAIN)


def _from_a_hundredth(axes: Axes, rows: Any) -> None:
    _plain(axes, rows)
    axes.set_ylim(bottom=0.003)


def _over_height(
    label: str, curves: Any, log: str = "x", title: str = "", extra: Any = _plain
) -> Chart:
    return Chart("rows", HEIGHT, label, title, curves, log, extra=extra)


NEAREST = "nearest four parameters"
CHARTS = {
    "exponents": Chart(
        "rows", "slipped length  s/H", r"exponent $n$ of $D \sim F^n$", "", _exponents, "x",
        extra=_plain,
    ),
    "stiffness": _over_height(
        r"$K_T\, L / E'2H$", functools.partial(_parameter, place=0, named=True), "xy", NEAREST
    ),
    "chi": _over_height(r"$\chi$", functools.partial(_parameter, place=1)),
    "beta": _over_height(
        r"$\beta$", functools.partial(_parameter, place=2), "xy", extra=_from_a_hundredth
    ),
    "median": _over_height("median error of D  [1]", functools.partial(_errors, place=0), "xy"),
    "worst": _over_height("worst error of D  [1]", functools.partial(_errors, place=1), "xy"),
}  # fmt: skip


def draw(record: dict[str, Any]) -> Figure:
    """Sheet of all charts."""
    return sheet(CHARTS, record)

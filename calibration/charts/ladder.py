"""Pictures of the ladder's record: what a rung costs and how wrong it is, and what is advised.

The record is that of tests/benchmarks/ladder.py, a dictionary as its JSON holds it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter, NullFormatter

from jbeamshell.common.errors import InputError
from jbeamshell.plotting.style import DATA, FAINT, single, style

Record = Mapping[str, Any]

# Colour and marker of a rung, the same in all pictures; Masing's rules are shades of one hue.
RUNG_LOOKS: dict[str, tuple[str, str]] = {
    "bar": ("0.6", "s"),
    "masing-pull": ("#F7DC8B", "d"),
    "masing": ("#E69F00", "D"),
    "masing-p2": ("#A36F00", "d"),
    "masing-p3": ("#5C3F00", "d"),
    "shell": ("#D55E00", "v"),
    "squeeze": ("#CC79A7", "o"),
    "p1": ("#882255", "<"),
    "p2": ("#56B4E9", "^"),
    "p3": ("#0072B2", "P"),
    "p4": ("#009E73", "X"),
    "p6": ("#332288", "*"),
}
OTHER = (FAINT, "o")
FINITE_ELEMENTS = {"CalculiX": "H", "condensed": ">"}
CONTOURS = (1.0, 5.0, 20.0)  # per cent
SMALLEST = 1e-3  # per cent, of errors drawn
SHADES = (0.1, 100.0)  # per cent, of the lightest and the darkest colour
CELL = "$\\eta = H/(L/2)$  [1]", "$A\\,/\\,(\\mu F_N L/2)$  [1]"


class Error(NamedTuple):
    """An error of the record's runs.

    Attributes
    ----------
    column : of the rows
    right : its value without error
    label : of the axis
    """

    column: str
    right: float
    label: str


ERRORS = {
    "dissipation": Error("ratio", 1.0, "error of the dissipation, to finite elements  [%]"),
    "own limit": Error(
        "over_own_limit", 1.0, "error of the dissipation, to the rung's own limit  [%]"
    ),
    "stiffness": Error("stiffness", 1.0, "error of the secant stiffness  [%]"),
    "profile": Error("profile_error", 0.0, "rms error of the contact's displacement  [%]"),
}


def work_precision(
    record: Record,
    axes: Axes | None = None,
    *,
    strip: tuple[float, float] = (0.1126, 0.7855),
    error: str = "dissipation",
) -> Axes:
    """Draw the error of every rung over the time that a cycle takes, on one strip.

    Parameters
    ----------
    record : of tests/benchmarks/ladder.py
    axes : where to draw; new ones when not given
    strip : eta and amplitude, one of the record
    error : "dissipation", against finite elements; "own limit", the same against the rung on a fine
        grid; "stiffness"; "profile", of the contact's displacement under a pull

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into: a dot for every grid and load path, hollow where the answer is too
        small, and dashed what is left on the finest grid; bars from condensed finite elements lead
        to the time without building them

    Raises
    ------
    InputError
        if the record has no such strip, or no such error
    """
    if error not in ERRORS:
        raise InputError(f"error = {error!r}: choose one of {', '.join(ERRORS)}")
    column, right, label = ERRORS[error]
    floor = SMALLEST
    if error == "dissipation":  # less than the truth's own error means nothing
        (reference,) = _of_strip(record["work"]["reference"], strip)
        floor = max(floor, 100.0 * reference["error"])
    runs = _of_strip(record["work"]["runs"], strip)
    limits = {row["rung"]: row for row in _of_strip(record["work"]["limits"], strip)}
    with style():
        axes = single(axes)
        for rung in dict.fromkeys(row["rung"] for row in runs):
            own = [row for row in runs if row["rung"] == rung]
            colour, marker = RUNG_LOOKS.get(rung, OTHER)
            ms = np.array([row["ms_per_cycle"] for row in own])
            off = 100.0 * np.array([row[column] - right for row in own])
            size = np.maximum(abs(off), floor)
            if error == "own limit" and size.max() == floor:  # in closed form
                continue
            axes.plot(ms, size, color=colour, linewidth=1.1, alpha=0.75)
            for place, value, sign in zip(ms, size, off, strict=True):
                face = colour if sign > 0.0 else "white"
                dot: dict[str, Any] = {"markersize": 5.5, "markerfacecolor": face}
                axes.plot(place, value, color=colour, marker=marker, **dot)
            if error != "own limit":
                left = max(100.0 * abs(limits[rung][column] - right), floor)
                axes.plot(
                    [ms.min(), ms.max()], [left, left], color=colour, linestyle="--", linewidth=0.8
                )
        keys = [
            Line2D([], [], color=c, marker=m, markersize=5.5, linewidth=1.1, label=rung)
            for rung, (c, m) in RUNG_LOOKS.items()
            if rung in limits
        ]
        if error == "dissipation":
            keys += _finite_elements(record, strip, axes, floor)
        if error != "own limit":
            keys.append(
                Line2D([], [], color=DATA, linestyle="--", linewidth=0.8, label="rung's own limit")
            )
        axes.set(xscale="log", yscale="log", xlabel="warm run, time per cycle  [ms]", ylabel=label)
        axes.set_title(f"$\\eta = {strip[0]:g}$, $A = {strip[1]:g}$")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axis.set_minor_formatter(NullFormatter())
        axes.legend(handles=keys, loc="lower left", bbox_to_anchor=(1.0, 0.0), fontsize=8)
    return axes


def error_map(
    record: Record, rung: str, axes: Axes | None = None, *, colour_bar: bool = True
) -> Axes:
    """Draw how wrong the dissipation of a rung is over heights and amplitudes.

    Parameters
    ----------
    record : of tests/benchmarks/ladder.py
    rung : one of the record's map
    axes : where to draw; new ones when not given
    colour_bar : whether a bar beside the axes explains the colours

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into, the map first among their collections

    Raises
    ------
    InputError
        if the map does not have the rung
    """
    chart = record["map"]
    if rung not in chart["rungs"]:
        raise InputError(f"rung = {rung!r}: the map has {', '.join(chart['rungs'])}")
    eta, amplitude, ratio = _grid(chart["cells"], rung)
    off = np.maximum(100.0 * abs(ratio - 1.0), 1e-3)
    with style():
        axes = single(axes)
        mesh = axes.pcolormesh(
            *_edges(eta, amplitude), off, norm=LogNorm(*SHADES), cmap="magma_r", rasterized=True
        )
        lines = axes.contour(
            eta, amplitude, np.log10(off), np.log10(CONTOURS), colors="0.1", linewidths=1.0
        )
        lines.set_path_effects([withStroke(linewidth=2.5, foreground="white")])
        names = {np.log10(level): f"{level:g} %" for level in CONTOURS}
        for text in axes.clabel(lines, fmt=names, fontsize=8):
            text.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.8})
        _cell_axes(axes, eta)
        axes.set_title(rung)
        if colour_bar:
            axes.figure.colorbar(mesh, ax=axes, extend="both", label="error of the dissipation [%]")
    return axes


def advice_map(record: Record, tolerance: float, axes: Axes | None = None) -> Axes:
    """Draw which rung is advised over heights and amplitudes.

    Parameters
    ----------
    record : of tests/benchmarks/ladder.py
    tolerance : one of the record's
    axes : where to draw; new ones when not given

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into; a cross where the rung is wrong by more than the tolerance

    Raises
    ------
    InputError
        if the record does not have the tolerance
    """
    picks = [row for row in record["advice"]["picks"] if row["tolerance"] == tolerance]
    if not picks:
        known = ", ".join(map(str, record["advice"]["tolerances"]))
        raise InputError(f"tolerance = {tolerance}: the record has {known}")
    eta, amplitude, names = _grid(picks, "rung")
    there = set(names.ravel())
    shown = [rung for rung in RUNG_LOOKS if rung in there] + sorted(
        there - set(RUNG_LOOKS) - {"none"}
    )
    shades = [RUNG_LOOKS.get(rung, OTHER)[0] for rung in shown]
    with style():
        axes = single(axes)
        edges = _edges(eta, amplitude)
        places = np.vectorize(lambda name: shown.index(name) if name in shown else -1)(names)
        axes.pcolormesh(
            *edges,
            np.ma.masked_less(places, 0),
            cmap=ListedColormap(shades or [FAINT]),
            vmin=-0.5,
            vmax=max(len(shown), 1) - 0.5,
            edgecolors="white",
            linewidth=0.6,
            rasterized=True,
        )
        hatched: Any = {"facecolor": "none", "edgecolor": "0.45", "hatch": "////"}
        for row, column in np.argwhere(names == "none"):
            x, y = (edge[i : i + 2] for edge, i in zip(edges, (column, row), strict=True))
            axes.fill_between(x, *y, linewidth=0.0, **hatched)
        keys: list[Any] = [Patch(color=c, label=n) for c, n in zip(shades, shown, strict=True)]
        if "none" in there:
            keys.append(Patch(label="finite elements", **hatched))
        _, _, ratio = _grid(picks, "ratio")
        wrong = abs(ratio.astype(float) - 1.0) > tolerance  # false where there is no ratio
        if wrong.any():
            cross: Any = {"color": DATA, "marker": "x", "linestyle": "", "markersize": 5.0}
            row, column = np.nonzero(wrong)
            axes.plot(eta[column], amplitude[row], **cross)
            keys.append(Line2D([], [], label=f"off by more than {tolerance:.0%}", **cross))
        _cell_axes(axes, eta)
        axes.set_title(f"advised for an error of {tolerance:.0%}".replace("%", " %"))
        axes.legend(handles=keys, loc="lower left", bbox_to_anchor=(1.0, 0.0), fontsize=8)
    return axes


def _of_strip(rows: list[dict[str, Any]], strip: tuple[float, float]) -> list[dict[str, Any]]:
    own = [row for row in rows if (row["eta"], row["A"]) == strip]
    if not own:
        known = ", ".join(map(str, dict.fromkeys((row["eta"], row["A"]) for row in rows)))
        raise InputError(f"strip = {strip}: the record has {known}")
    return own


def _finite_elements(
    record: Record, strip: tuple[float, float], axes: Axes, floor: float
) -> list[Line2D]:
    """Draw the finite elements' own work and precision; returns what the legend says of it."""
    rows = [row for row in record["finite_elements"] if (row["eta"], row["A"]) == strip]
    for row in rows:
        off, marker = 100.0 * (row["ratio"] - 1.0), FINITE_ELEMENTS[row["what"]]
        face = DATA if off > 0.0 else "white"
        dot: dict[str, Any] = {"markersize": 8.0, "markerfacecolor": face}
        axes.plot(row["ms_per_cycle"], abs(off), color=DATA, marker=marker, **dot)
        if "ms_per_cycle_once_built" in row:
            ms = [row["ms_per_cycle_once_built"], row["ms_per_cycle"]]
            axes.plot(ms, [abs(off)] * 2, color=DATA, linewidth=0.8, marker="|", markersize=4.0)
    keys = [
        Line2D([], [], color=DATA, marker=marker, linestyle="", markersize=8.0, label=f"{what} FE")
        for what, marker in FINITE_ELEMENTS.items()
        if any(row["what"] == what for row in rows)
    ]
    dotted: Any = {"color": FAINT, "linestyle": ":", "linewidth": 1.2}
    axes.axhline(floor, **dotted)
    return [*keys, Line2D([], [], label="reference's own error", **dotted)]


def _grid(rows: list[dict[str, Any]], column: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Eta, amplitude and a column of the rows, (amplitudes, etas); None where there is no row."""
    eta, amplitude = (np.array(sorted({row[key] for row in rows})) for key in ("eta", "A"))
    by_cell = {(row["A"], row["eta"]): row[column] for row in rows}
    return eta, amplitude, np.array([[by_cell.get((a, e)) for e in eta] for a in amplitude])


def _edges(eta: np.ndarray, amplitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges of cells half way between the values: of eta on a logarithmic scale."""

    def between(values: np.ndarray) -> np.ndarray:
        middles = 0.5 * (values[1:] + values[:-1])
        ends = 2.0 * values[[0, -1]] - middles[[0, -1]]
        return np.concatenate([ends[:1], middles, ends[1:]])

    return np.exp(between(np.log(eta))), between(amplitude)


def _cell_axes(axes: Axes, eta: np.ndarray) -> None:
    axes.grid(False)
    axes.set(xscale="log", xlabel=CELL[0], ylabel=CELL[1])
    axes.set_xticks(eta, [f"{value:.2g}".lstrip("0") for value in eta])
    axes.minorticks_off()

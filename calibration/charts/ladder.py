"""Charts of the record of tests/benchmarks/ladder.py: cost and error of the rungs."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from calibration.charts.table import Record, column, plain_numbers
from jbeamshell.common.errors import InputError
from jbeamshell.plotting.style import DATA, FAINT, single, style

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
    "plane": ("#117733", "h"),
}
OTHER = (FAINT, "o")
FINITE_ELEMENTS = {"CalculiX": "H", "condensed": ">"}
CONTOURS = (1.0, 5.0, 20.0)  # per cent
SMALLEST = 1e-3  # per cent, of errors drawn
SHADES = (0.1, 100.0)  # per cent, of the lightest and the darkest colour
CELL = {"xlabel": "$\\eta = H/(L/2)$  [1]", "ylabel": "$A\\,/\\,(\\mu F_N L/2)$  [1]"}
KEY_BESIDE = {"loc": "lower left", "bbox_to_anchor": (1.0, 0.0), "fontsize": 8}
OWN_LIMIT = {"linestyle": "--", "linewidth": 0.8}
OWN_ERROR = {"color": FAINT, "linestyle": ":", "linewidth": 1.2}


class Error(NamedTuple):
    """An error of the record's runs.

    Attributes
    ----------
    column : column of the rows
    right : value of the column without error
    label : label of the axis
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

    Each dot is one grid and load path, hollow where the answer is too small; dashed is the error
    that is left on the finest grid. Bars of condensed finite elements lead to the time without
    building them.

    Parameters
    ----------
    record : record of tests/benchmarks/ladder.py
    axes : where to draw; new ones when not given
    strip : eta and amplitude of one of the record's strips
    error : "dissipation", against finite elements; "own limit", the same against the rung on a fine
        grid; "stiffness"; "profile", of the contact's displacement under a pull

    Raises
    ------
    InputError
        if the record has no such strip, or no such error
    """
    if error not in ERRORS:
        raise InputError(f"error = {error!r}: choose one of {', '.join(ERRORS)}")
    name, right, label = ERRORS[error]
    floor = SMALLEST
    if error == "dissipation":  # less than the error of the reference means nothing
        (reference,) = _of_strip(record["work"]["reference"], strip)
        floor = max(floor, 100.0 * reference["error"])
    runs = _of_strip(record["work"]["runs"], strip)
    limits = {row["rung"]: row for row in _of_strip(record["work"]["limits"], strip)}
    with style():
        axes = single(axes)
        for rung in dict.fromkeys(row["rung"] for row in runs):
            own = [row for row in runs if row["rung"] == rung]
            ms, off = column(own, "ms_per_cycle"), 100.0 * (column(own, name) - right)
            if error == "own limit" and abs(off).max() <= floor:  # a solution in closed form
                continue
            colour, marker = RUNG_LOOKS.get(rung, OTHER)
            axes.plot(ms, np.maximum(abs(off), floor), color=colour, linewidth=1.1, alpha=0.75)
            _dots(axes, ms, off, floor, color=colour, marker=marker, markersize=5.5)
            if error != "own limit":
                left = max(100.0 * abs(limits[rung][name] - right), floor)
                axes.plot([ms.min(), ms.max()], [left, left], color=colour, **OWN_LIMIT)
        keys = [
            Line2D([], [], color=c, marker=m, markersize=5.5, linewidth=1.1, label=rung)
            for rung, (c, m) in RUNG_LOOKS.items()
            if rung in limits
        ]
        if error == "dissipation":
            keys += _finite_elements(record, strip, axes, floor)
        if error != "own limit":
            keys.append(Line2D([], [], color=DATA, label="rung's own limit", **OWN_LIMIT))
        axes.set(xscale="log", yscale="log", xlabel="warm run, time per cycle  [ms]", ylabel=label)
        axes.set_title(f"$\\eta = {strip[0]:g}$, $A = {strip[1]:g}$")
        plain_numbers(axes.xaxis, axes.yaxis)
        axes.legend(handles=keys, **KEY_BESIDE)
    return axes


def error_map(
    record: Record, rung: str, axes: Axes | None = None, *, colour_bar: bool = True
) -> Axes:
    """Draw the error of a rung's dissipation over heights and amplitudes.

    Parameters
    ----------
    record : record of tests/benchmarks/ladder.py
    rung : one of the record's map
    axes : where to draw; new ones when not given
    colour_bar : True to explain the colours by a bar beside the axes

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
    off = np.maximum(100.0 * abs(ratio - 1.0), SMALLEST)
    with style():
        axes = single(axes)
        shades: Any = {"norm": LogNorm(*SHADES), "cmap": "magma_r", "rasterized": True}
        mesh = axes.pcolormesh(*_edges(eta, amplitude), off, **shades)
        levels = np.log10(CONTOURS)
        lines = axes.contour(eta, amplitude, np.log10(off), levels, colors="0.1", linewidths=1.0)
        lines.set_path_effects([withStroke(linewidth=2.5, foreground="white")])
        names = {np.log10(level): f"{level:g} %" for level in CONTOURS}
        for text in axes.clabel(lines, fmt=names, fontsize=8):
            text.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.8})
        _cell_axes(axes, eta, rung)
        if colour_bar:
            axes.figure.colorbar(mesh, ax=axes, extend="both", label="error of the dissipation [%]")
    return axes


def _dots(axes: Axes, ms: Any, off: Any, floor: float, **look: Any) -> None:
    """Dots at the sizes of errors in per cent, hollow where the answer is too small."""
    for place, error in zip(np.atleast_1d(ms), np.atleast_1d(off), strict=True):
        face = look["color"] if error > 0.0 else "white"
        axes.plot(place, max(abs(error), floor), markerfacecolor=face, **look)


def _of_strip(rows: list[dict[str, Any]], strip: tuple[float, float]) -> list[dict[str, Any]]:
    """Rows of one strip."""
    own = [row for row in rows if (row["eta"], row["A"]) == strip]
    if not own:
        known = ", ".join(map(str, dict.fromkeys((row["eta"], row["A"]) for row in rows)))
        raise InputError(f"strip = {strip}: the record has {known}")
    return own


def _finite_elements(
    record: Record, strip: tuple[float, float], axes: Axes, floor: float
) -> list[Line2D]:
    """Draw work and precision of the finite elements; returns their keys for the legend."""
    rows = [row for row in record["finite_elements"] if (row["eta"], row["A"]) == strip]
    keys = []
    for what, marker in FINITE_ELEMENTS.items():
        own = [row for row in rows if row["what"] == what]
        look: dict[str, Any] = {"color": DATA, "marker": marker, "markersize": 8.0}
        for row in own:
            ms, off = row["ms_per_cycle"], 100.0 * (row["ratio"] - 1.0)
            _dots(axes, ms, off, 0.0, **look)
            if "ms_per_cycle_once_built" in row:
                bar = [row["ms_per_cycle_once_built"], ms], [abs(off)] * 2
                axes.plot(*bar, color=DATA, linewidth=0.8, marker="|", markersize=4.0)
        if own:
            keys.append(Line2D([], [], linestyle="", label=f"{what} FE", **look))
    axes.axhline(floor, **OWN_ERROR)
    return [*keys, Line2D([], [], label="reference's own error", **OWN_ERROR)]


def _grid(rows: list[dict[str, Any]], name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Eta, amplitude and a column of the rows, (amplitudes, etas); None where there is no row."""
    eta, amplitude = (np.array(sorted({row[key] for row in rows})) for key in ("eta", "A"))
    by_cell = {(row["A"], row["eta"]): row[name] for row in rows}
    return eta, amplitude, np.array([[by_cell.get((a, e)) for e in eta] for a in amplitude])


def _edges(eta: np.ndarray, amplitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges of cells half way between the values, those of eta on a logarithmic scale."""

    def between(values: np.ndarray) -> np.ndarray:
        middles = 0.5 * (values[1:] + values[:-1])
        ends = 2.0 * values[[0, -1]] - middles[[0, -1]]
        return np.concatenate([ends[:1], middles, ends[1:]])

    return np.exp(between(np.log(eta))), between(amplitude)


def _cell_axes(axes: Axes, eta: np.ndarray, title: str) -> None:
    """Scale, marks and words of axes over heights and amplitudes."""
    axes.grid(False)
    axes.set(xscale="log", title=title, **CELL)
    axes.set_xticks(eta, [f"{value:.2g}".lstrip("0") for value in eta])
    axes.minorticks_off()

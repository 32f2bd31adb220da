"""Pictures of a sweep: a figure over one key for values of another, and the master curve.

A lane is one strip of a sweep: one value of each key.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

from jbeamshell.common.errors import InputError
from jbeamshell.measured.form import DISSIPATION, SECANT_STIFFNESS
from jbeamshell.mechanics.bar import cubic_law
from jbeamshell.plotting.protocols import SweptFigures
from jbeamshell.plotting.style import (
    DATA,
    PALETTE,
    beside,
    looks,
    mark_decades,
    panels,
    single,
    style,
)
from jbeamshell.scene.keys import TABLE, unit_of

FIGURES = {
    "dissipation": DISSIPATION.label,
    "dissipation_ratio": "$D\\,/\\,D_{bar}$",
    "secant_stiffness": SECANT_STIFFNESS.label,
    "loss_factor": "loss factor  [dimensionless]",
}
WIDE = 20.0  # ratio of largest to smallest value above which an axis is logarithmic
NAMED = 10  # most curves that the legend names
FLOOR = 1e-6  # part of the largest value at which a logarithmic axis ends


def sweep(
    result: SweptFigures,
    axes: Axes | None = None,
    *,
    figure: str = "dissipation",
    along: str | None = None,
    per: str | None = None,
) -> Axes:
    """Draw a figure over one key, with a curve for each value of another.

    Further keys stay at their middle value. The lanes of a paired sweep are drawn as dots. Dashed
    is the bar's cubic law, if one holds for all curves.

    Parameters
    ----------
    result : result of `jbeamshell.sweep`
    axes : where to draw; new ones when not given
    figure : name of one of the result's figures
    along : key along the axis; the amplitude, or else the first key, when not given
    per : key with a curve for each of its values; the first of the others when not given

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into

    Raises
    ------
    InputError
        if the result has no such figure or key

    Examples
    --------
    >>> axes = {"load.amplitude": np.linspace(0.2, 1.6, 8), "strip.height_ratio": [0.05, 0.1, 0.2]}
    >>> plotting.sweep(jb.sweep(jb.Scene(), axes), figure="dissipation_ratio")
    """
    along, per = _keys(result, along, per)
    values = result[figure]
    with style():
        axes = single(axes)
        x = result.axes[along]
        if result.paired:
            hue = np.full(x.size, 0.0) if per is None else result.axes[per]
            _dots(axes, x, values, hue, per and _label(per, result))
        else:
            table, rest = _plane(result, values, along, per)
            order = np.argsort(x)
            names: list[Any] = [None] if per is None else result.axes[per].tolist()
            every = -(-len(names) // NAMED)
            curves = zip(table, names, looks(len(names)), strict=True)
            for number, (row, value, look) in enumerate(curves):
                named = value is not None and number % every == 0
                label = f"{_symbol(per)} = {value:.3g}" if named else None
                axes.plot(x[order], row[order], **look, label=label, marker=".", markersize=4)
            axes.set_title(rest)
        _cubic_law(result, axes, figure, along)
        axes.set(xlabel=_label(along, result), ylabel=FIGURES.get(figure, figure.replace("_", " ")))
        _scales(axes, x, values)
        if axes.get_legend_handles_labels()[1]:
            beside(axes)
    return axes


def sweep_contour(
    result: SweptFigures,
    axes: Axes | None = None,
    *,
    figure: str = "dissipation",
    along: str | None = None,
    per: str | None = None,
) -> Axes:
    """Draw a figure as a map over two keys; crosses are lanes not to rely on.

    Parameters and choices are those of `sweep`, but that ``per`` is the key up.

    Raises
    ------
    InputError
        as in `sweep`, and if the result is over one key alone

    Examples
    --------
    >>> axes = {"load.amplitude": np.linspace(0.2, 1.6, 8), "strip.height_ratio": [0.05, 0.1, 0.2]}
    >>> plotting.sweep_contour(jb.sweep(jb.Scene(), axes), figure="loss_factor")
    """
    along, per = _keys(result, along, per)
    if per is None or result.paired:
        raise InputError("sweep: a map needs two keys that vary as a product: sweep over two")
    table, rest = _plane(result, result[figure], along, per)
    doubtful, _ = _plane(result, result.doubtful, along, per)
    x, y = result.axes[along], result.axes[per]
    right, up = np.argsort(x), np.argsort(y)
    wide = _is_wide(table)
    with style():
        axes = single(axes)
        shown = np.ma.masked_invalid(table)
        shown = np.ma.masked_less(shown, FLOOR * shown.max()) if wide else shown
        norm = LogNorm(shown.min(), shown.max()) if wide else Normalize(shown.min(), shown.max())
        mesh = (x[right], y[up], shown[np.ix_(up, right)])
        drawn = axes.pcolormesh(*mesh, norm=norm, cmap="viridis", shading="nearest")
        label = FIGURES.get(figure, figure.replace("_", " "))
        axes.figure.colorbar(drawn, ax=axes, label=label)
        rows, columns = np.nonzero(doubtful)
        axes.plot(x[columns], y[rows], "x", color=DATA, markersize=3.0, markeredgewidth=0.7)
        axes.set(xlabel=_label(along, result), ylabel=_label(per, result), title=rest)
        for size, scaled in ((x, axes.set_xscale), (y, axes.set_yscale)):
            if _is_wide(size) and size.min() > 0.0:
                scaled("log")
        axes.grid(visible=False)
    return axes


def master_curve(
    result: SweptFigures, axes: Axes | None = None, *, figure: str = "dissipation_ratio"
) -> Axes:
    """Draw the dissipation over the bar's against A/eta, which puts all heights on one curve.

    Parameters
    ----------
    result : result of `jbeamshell.sweep`, under force control
    axes : where to draw; new ones when not given
    figure : name of one of the result's figures that is a pure number

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into: a dot for each lane that converged, coloured by its eta

    Raises
    ------
    InputError
        if the result has no such figure, or no lane with friction and a known force
    """
    y, x = result[figure], result.lanes.amplitude_over_height
    eta = np.broadcast_to(result.lanes.height_ratio, result.shape)
    good = np.isfinite(x) & np.isfinite(y)
    if not np.any(good):
        fix = "sweep a scene with friction under force control"
        raise InputError(f"sweep: has no lane with a force, friction and a finite figure: {fix}")
    with style():
        axes = single(axes)
        key = "strip.height_ratio" if np.ptp(eta) > 0.0 else None
        _dots(axes, x[good], y[good], eta[good], key and _label(key, result))
        axes.axhline(1.0, color=DATA, linestyle="--", linewidth=0.8)
        axes.set(
            xlabel=r"$A\,/\,(\mu F_N L/2)\,/\,\eta$",
            ylabel=FIGURES.get(figure, figure.replace("_", " ")),
            xscale="log",
        )
        mark_decades(axes.xaxis)
    return axes


def sweep_sheet(result: SweptFigures) -> Figure:
    """Draw a sheet of a sweep: its first figure and, if there is one, the master curve.

    Parameters
    ----------
    result : result of `jbeamshell.sweep`

    Returns
    -------
    matplotlib.figure.Figure
        the sheet, to be saved with `save` and closed with `close`
    """
    ratio, scaled = "dissipation_ratio", result.lanes.amplitude_over_height
    both = ratio in result.values and bool(np.any(np.isfinite(scaled + result.values[ratio])))
    with style():
        row = panels(1, 1 + both)[0]
        sweep(result, row[0], figure=next(iter(result.values)))
        if both:
            master_curve(result, row[1])
    return row[0].figure


def _keys(result: SweptFigures, along: str | None, per: str | None) -> tuple[str, str | None]:
    """Key along the axis and key of the curves, as given or chosen."""
    keys = list(result.axes)
    for name, key in (("along", along), ("per", per)):
        if key is not None and key not in keys:
            raise InputError(f"{name} = {key!r}: the sweep is over {', '.join(keys)}")
    if along is None:
        first = [key for key in ("load.amplitude", *keys) if key in keys and key != per]
        along = first[0] if first else keys[0]
    if along == per:
        raise InputError(f"per = {per!r}: is along the axis already: choose another key")
    others = [key for key in keys if key != along]
    return along, others[0] if per is None and others else per


def _plane(
    result: SweptFigures, values: np.ndarray, along: str, per: str | None
) -> tuple[np.ndarray, str]:
    """Values (per, along) at the middle values of the other keys, and a text that names these."""
    kept, rest = [], []
    for key, numbers in result.axes.items():
        if key in (along, per):
            kept.append(key)
            continue
        middle = numbers.size // 2
        values = np.take(values, middle, axis=len(kept))
        rest.append(f"{_symbol(key)} = {numbers[middle]:.4g}")
    table = values if kept[-1] == along else values.T
    return np.atleast_2d(table), ", ".join(rest)


def _dots(axes: Axes, x: np.ndarray, y: np.ndarray, hue: np.ndarray, name: str | None) -> None:
    """Draw dots coloured by a third number, with a colour bar."""
    if name is None:
        axes.plot(x, y, linestyle="", marker="o", markersize=3, color=PALETTE[0])
        return
    low, high = float(np.min(hue)), float(np.max(hue))
    norm = LogNorm(low, high) if low > 0.0 and high > 5.0 * low else Normalize(low, high)
    size = 12.0 if x.size < 500 else 4.0
    dots: dict[str, Any] = {"c": hue, "norm": norm, "cmap": "viridis", "linewidths": 0.0}
    axes.scatter(x, y, size, rasterized=x.size > 5000, **dots)
    plain = FuncFormatter(lambda value, _: f"{value:g}")
    few = LogLocator(subs=(1.0, 2.0, 5.0)) if isinstance(norm, LogNorm) else None
    bar = axes.figure.colorbar(ScalarMappable(norm, "viridis"), ax=axes, label=name)
    if few is not None:
        bar.set_ticks(few, minor=False)
    bar.ax.yaxis.set_major_formatter(plain)
    bar.ax.minorticks_off()


def _cubic_law(result: SweptFigures, axes: Axes, figure: str, along: str) -> None:
    """Draw the bar's cubic law if it is the same for all curves."""
    lanes = result.lanes
    friction = lanes.gross_slip / lanes.value("strip.length")
    stiffness = lanes.value("strip.axial_stiffness")
    alike = all(np.ndim(number) == 0 for number in (stiffness, friction))
    pulled = result.scene.load.control == "force" and along == "load.amplitude"
    if figure != "dissipation" or not alike or not pulled or float(friction) <= 0.0:
        return
    inside = np.sort(result.axes[along])
    inside = inside[(inside > 0.0) & (inside < float(lanes.gross_slip))]
    law = np.asarray(cubic_law(inside, float(stiffness), float(friction)))
    axes.plot(inside, law, color=DATA, linestyle="--", linewidth=0.9, label="bar", zorder=1.5)


def _scales(axes: Axes, x: np.ndarray, values: np.ndarray) -> None:
    """Make axes with a wide range of values logarithmic."""
    if x.min() > 0.0 and _is_wide(x):
        axes.set_xscale("log")
    if _is_wide(values):
        known = values[np.isfinite(values)]
        axes.set_yscale("log")
        smallest = np.min(known[known > 0.0], initial=known.max())
        axes.set_ylim(bottom=max(0.7 * smallest, FLOOR * known.max()))


def _is_wide(values: np.ndarray) -> bool:
    """True for numbers, none negative, that a logarithmic scale shows better."""
    known = values[np.isfinite(values)]
    return bool(known.size and known.min() >= 0.0 and known.max() > WIDE * known.min())


def _symbol(key: str | None) -> str:
    """Symbol of a key, or its words."""
    return TABLE[key].label if key else ""


def _label(key: str, result: SweptFigures) -> str:
    """Label of an axis: symbol and unit of a key."""
    unit = unit_of(key, result.scene.load)
    return f"{_symbol(key)}  [{'dimensionless' if unit == '1' else unit}]"

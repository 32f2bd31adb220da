"""Pictures of a sweep: a figure over one key for values of another, and the master curve.

A lane is one strip of a sweep: one value of each key.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

from jbeamshell.common.checks import require_choice
from jbeamshell.common.errors import InputError
from jbeamshell.measured.form import DISSIPATION, SECANT_STIFFNESS
from jbeamshell.plotting.style import (
    DATA,
    PALETTE,
    beside,
    looks,
    mark_decades,
    panels,
    remark,
    single,
    style,
)
from jbeamshell.scene.keys import TABLE

if TYPE_CHECKING:
    from xarray import DataArray, Dataset

FIGURES = {
    "dissipation": DISSIPATION.label,
    "dissipation_ratio": "$D\\,/\\,D_{bar}$",
    "secant_stiffness": SECANT_STIFFNESS.label,
    "loss_factor": "loss factor  [dimensionless]",
}
WIDE = 20.0  # ratio of largest to smallest value above which an axis is logarithmic
HEIGHTS = "strip.height_ratio", "strip.half_height"
NAMED = 10  # most curves that the legend names
FLOOR = 1e-6  # part of the largest value at which a logarithmic axis ends


def sweep(
    result: Dataset,
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
    values, x = _figure(result, figure), result[along].values
    with style():
        axes = single(axes)
        if "lane" in result.dims:
            hue = np.zeros(x.size) if per is None else result[per].values
            _dots(axes, x, values.values, hue, per and _label(result[per]))
        else:
            table, rest = _plane(values, along, per)
            order = np.argsort(x)
            names: list[Any] = [None] if per is None else result[per].values.tolist()
            every = -(-len(names) // NAMED)
            curves = zip(table, names, looks(len(names)), strict=True)
            for number, (row, value, look) in enumerate(curves):
                named = value is not None and number % every == 0
                label = f"{_symbol(per)} = {value:.3g}" if named else None
                axes.plot(x[order], row[order], **look, label=label, marker=".", markersize=4)
            axes.set_title(rest)
        if figure == "dissipation" and along == "load.amplitude":
            _bar(result, axes)
        axes.set(xlabel=_label(result[along]), ylabel=FIGURES.get(figure, figure.replace("_", " ")))
        _scales(axes, x, values.values)
        if axes.get_legend_handles_labels()[1]:
            beside(axes)
    return axes


def sweep_contour(
    result: Dataset,
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
    if per is None or "lane" in result.dims:
        raise InputError("sweep: a map needs two keys that vary as a product: sweep over two")
    table, rest = _plane(_figure(result, figure), along, per)
    doubtful, _ = _plane(result["doubtful"], along, per)
    x, y = result[along].values, result[per].values
    right, up = np.argsort(x), np.argsort(y)
    wide = _is_wide(table)
    with style():
        axes = single(axes)
        shown = np.ma.masked_invalid(table)
        shown = np.ma.masked_less(shown, FLOOR * shown.max()) if wide else shown
        norm = LogNorm(shown.min(), shown.max()) if wide else Normalize(shown.min(), shown.max())
        log = [_is_wide(size) and bool(size.min() > 0.0) for size in (x, y)]
        edges = _edges(x[right], log[0]), _edges(y[up], log[1])
        drawn = axes.pcolormesh(*edges, shown[np.ix_(up, right)], norm=norm, cmap="viridis")
        label = FIGURES.get(figure, figure.replace("_", " "))
        bar = axes.figure.colorbar(drawn, ax=axes, label=label)
        rows, columns = np.nonzero(doubtful)
        axes.plot(x[columns], y[rows], "x", color=DATA, markersize=3.0, markeredgewidth=0.7)
        axes.set(xlabel=_label(result[along]), ylabel=_label(result[per]), title=rest)
        axes.set(xscale="log" if log[0] else "linear", yscale="log" if log[1] else "linear")
        all_axes = zip((axes.xaxis, axes.yaxis, bar.ax.yaxis), (*log, wide), strict=True)
        mark_decades(*(axis for axis, is_log in all_axes if is_log))
        axes.grid(visible=False)
    return axes


def master_curve(
    result: Dataset, axes: Axes | None = None, *, figure: str = "dissipation_ratio"
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
        the axes drawn into: a dot for each lane that converged, coloured by its
        height if that varies

    Raises
    ------
    InputError
        if the result has no such figure, or no lane with friction and a known force
    """
    y, x = _figure(result, figure).values, _scaled(result)
    good = np.isfinite(x + y)
    if not np.any(good):
        fix = "sweep a scene with friction under force control"
        raise InputError(f"sweep: has no lane with a force, friction and a finite figure: {fix}")
    with style():
        axes = single(axes)
        height = next((result[key] for key in HEIGHTS if key in result.coords), None)
        hue = x if height is None else height.broadcast_like(result[figure]).values
        _dots(axes, x[good], y[good], hue[good], None if height is None else _label(height))
        axes.axhline(1.0, color=DATA, linestyle="--", linewidth=0.8)
        axes.set(
            xlabel=r"$A\,/\,(\mu F_N L/2)\,/\,\eta$",
            ylabel=FIGURES.get(figure, figure.replace("_", " ")),
            xscale="log",
        )
        mark_decades(axes.xaxis)
    return axes


def sweep_sheet(result: Dataset) -> Figure:
    """Draw a sheet of a sweep: its first figure and, if there is one, the master curve.

    Parameters
    ----------
    result : result of `jbeamshell.sweep`

    Returns
    -------
    matplotlib.figure.Figure
        the sheet, to be saved with `save` and closed with `close`
    """
    ratio = result.get("dissipation_ratio")
    both = ratio is not None and bool(np.any(np.isfinite(_scaled(result) + ratio.values)))
    with style():
        row = panels(1, 1 + both)[0]
        sweep(result, row[0], figure=str(next(iter(result.data_vars))))
        if both:
            master_curve(result, row[1])
        remark(row[0].figure, result.attrs.get("mounting", ""))
    return row[0].figure


def _keys(result: Dataset, along: str | None, per: str | None) -> tuple[str, str | None]:
    """Key along the axis and key of the curves, as given or chosen."""
    keys = [str(key) for key in result.coords if key in TABLE]
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


def _figure(result: Dataset, name: str) -> DataArray:
    """Values of a figure."""
    marks = "status", "doubtful"
    require_choice("figure", name, tuple(str(one) for one in result if one not in marks))
    return result[name]


def _scaled(result: Dataset) -> np.ndarray:
    """Load A/eta of every lane; NaN where it is not known."""
    scaled = result.coords.get("amplitude_over_height")
    return np.full(result["status"].shape, np.nan) if scaled is None else scaled.values


def _plane(values: DataArray, along: str, per: str | None) -> tuple[np.ndarray, str]:
    """Values (per, along) at the middle values of the other keys, and a text that names these."""
    others = [str(key) for key in values.dims if key not in (along, per)]
    middle = values.isel({key: values.sizes[key] // 2 for key in others})
    rest = (f"{_symbol(key)} = {float(middle[key]):.4g}" for key in others)
    shown = middle if per is None else middle.transpose(per, along)
    return np.atleast_2d(shown.values), ", ".join(rest)


def _edges(values: np.ndarray, log: bool) -> np.ndarray:
    """Edges (k + 1,) of cells around rising values (k,), half way between them on their scale."""
    on_scale = np.log(values) if log else values
    widths = np.diff(on_scale) if values.size > 1 else np.ones(1)
    ends = on_scale[0] - 0.5 * widths[0], on_scale[-1] + 0.5 * widths[-1]
    edges = np.concatenate([ends[:1], on_scale[:-1] + 0.5 * np.diff(on_scale), ends[1:]])
    return np.exp(edges) if log else edges


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


def _bar(result: Dataset, axes: Axes) -> None:
    """Draw the bar's dissipation if it is known and the same for all curves."""
    if "dissipation_ratio" not in result or "lane" in result.dims:
        return
    with np.errstate(divide="ignore", invalid="ignore"):  # nothing slips
        bar = (result["dissipation"] / result["dissipation_ratio"]).transpose("load.amplitude", ...)
    rows = bar.values.reshape(bar.shape[0], -1)
    known = np.flatnonzero(np.any(np.isfinite(rows), axis=1))
    law, order = np.nanmedian(rows[known], axis=1), np.argsort(bar["load.amplitude"].values[known])
    if law.size and np.all(np.isnan(rows[known]) | np.isclose(rows[known], law[:, None])):
        x = bar["load.amplitude"].values[known][order]
        axes.plot(x, law[order], color=DATA, linestyle="--", linewidth=0.9, label="bar", zorder=1.5)


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


def _label(axis: DataArray) -> str:
    """Label of an axis: symbol and unit of a key."""
    unit = axis.attrs["units"]
    return f"{_symbol(str(axis.name))}  [{'dimensionless' if unit == '1' else unit}]"

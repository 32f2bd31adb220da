"""Style of all pictures, and how they are saved.

A panel is as wide as a column of a journal, where its letters have their printed size.  Curves of a
family differ in colour and in line, so that they are told apart in grey too.
"""

from __future__ import annotations

import base64
import contextlib
import io
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import (
    LogFormatterSciNotation,
    LogLocator,
    MaxNLocator,
    NullFormatter,
    ScalarFormatter,
)

from jbeamshell.common.errors import InputError
from jbeamshell.common.files import written_whole
from jbeamshell.measured import form

# Palette of Okabe and Ito, told apart by colour-blind readers too.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
STYLE: dict[Any, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": "0.4",
    "axes.formatter.limits": (-3, 4),
    "axes.formatter.use_mathtext": True,
    "axes.grid": True,
    "axes.labelsize": 9,
    "axes.prop_cycle": plt.cycler(color=PALETTE),
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 9,
    "figure.constrained_layout.use": True,
    "figure.dpi": 130,
    "grid.color": "0.9",
    "grid.linewidth": 0.7,
    "legend.fontsize": 8,
    "legend.edgecolor": "none",
    "legend.framealpha": 0.75,
    "legend.frameon": True,
    "legend.handlelength": 2.4,
    "lines.linewidth": 1.4,
    "xtick.color": "0.3",
    "xtick.labelsize": 8,
    "ytick.color": "0.3",
    "ytick.labelsize": 8,
}
PANEL = (3.4, 2.7)  # inches: a column of a journal
LINES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (6, 1, 1, 1, 1, 1)), (0, (3, 2)))
MARKS = "os^vDx"
STICKS, SLIPS, LIFTED = "#7FC4EE", "#A63D00", "0.93"  # states of a contact: light, dark, pale
DATA = "0.15"
FAINT = "0.65"
DOTS: dict[str, Any] = {
    "color": DATA,
    "linestyle": "",
    "marker": "o",
    "markersize": 2.4,
    "markeredgewidth": 0.0,
    "zorder": 3.0,
}
FEW = 4  # marks of an axis, at most, whose labels are long
FORCE = form.FORCE.label
DISPLACEMENT = form.DISPLACEMENT.label
MOMENT = "$M$  [force length/width]"
ROTATION = "rotation of the end  [rad]"
POSITION = form.POSITION.label
SQUEEZE = form.SQUEEZE_STRESS.label


@contextlib.contextmanager
def style() -> Iterator[None]:
    """Use the settings `STYLE` for the figures made in a ``with`` block.

    >>> with plotting.style():
    ...     figure, axes = plt.subplots()
    """
    # Not plt.rc_context: it would also restore what a notebook sets when it makes its first figure.
    before = {key: plt.rcParams[key] for key in STYLE}
    plt.rcParams.update(STYLE)
    try:
        yield
    finally:
        plt.rcParams.update(before)


def colours(count: int) -> list[Any]:
    """Colours of a family of curves, in the order of its parameter.

    Parameters
    ----------
    count : int
        Number of curves, at least 0.

    Returns
    -------
    list
        Matplotlib colours: the palette for a few curves, viridis without its palest part for many.
    """
    if count <= len(PALETTE):
        return list(PALETTE[:count])
    return list(plt.get_cmap("viridis")(np.linspace(0.0, 0.92, count)))


def looks(count: int) -> list[dict[str, Any]]:
    """Colours and lines of a family of curves, in the order of its parameter.

    A few curves differ in both; of many, the later is the lighter, in grey too.

    Parameters
    ----------
    count : int
        Number of curves, at least 0.

    Returns
    -------
    list of dict
        Options of `matplotlib.axes.Axes.plot`: ``color`` and ``linestyle``.
    """
    lines = LINES if count <= len(PALETTE) else ("-",) * count
    pairs = zip(colours(count), lines, strict=False)
    return [{"color": colour, "linestyle": line} for colour, line in pairs]


def in_units(axes: Any, units: Mapping[str, str]) -> None:
    """Name the units of a scene in the labels of axes, which only say length, stress and so on.

    Parameters
    ----------
    axes : axes, or an array or list of axes
    units : names of units by the words in brackets; their numbers are not converted

    Examples
    --------
    >>> plotting.in_units(history.plot(), {"length": "mm", "force/width": "N/mm"})
    """
    for panel in np.ravel(axes):
        for axis in (panel.xaxis, panel.yaxis):
            text = axis.get_label_text()
            for word, unit in units.items():
                text = text.replace(f"[{word}]", f"[{unit}]")
            axis.set_label_text(text)


def unit_words(history: Any, label: str) -> str:
    """Label of a force, without the words for one unit of width where a scene has its own."""
    scene = getattr(history, "scene", None)
    whole = scene is not None and scene.strip.width is not None
    return label.replace("/width", "") if whole else label


def save(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure to a file, whole or not at all.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Figure to write; that of axes is ``axes.figure``.
    path : str or path
        File to write; its suffix (.png, .pdf, .svg, ...) chooses the format.

    Raises
    ------
    InputError
        If the suffix is no format that matplotlib writes, or the file cannot be written.
    """
    suffix = Path(path).suffix.removeprefix(".").lower()
    formats = sorted(figure.canvas.get_supported_filetypes())
    if suffix not in formats:
        raise InputError(f"{path}: end the name in .{' or .'.join(formats)}")
    with written_whole(path) as draft:
        figure.savefig(draft, format=suffix, dpi=300)


def single(axes: Axes | None) -> Axes:
    """Axes as given, or new ones."""
    return panels(1, 1)[0, 0] if axes is None else axes


def panels(rows: int, columns: int, **options: Any) -> np.ndarray:
    """Axes (rows, columns) of a new figure, each of the size of a panel."""
    size = (columns * PANEL[0], rows * PANEL[1])
    return np.asarray(plt.subplots(rows, columns, figsize=size, squeeze=False, **options)[1])


def remark(figure: Figure, words: str) -> None:
    """Write a line above all axes of a figure, if there are words."""
    if words:
        figure.suptitle(words, fontsize=8, wrap=True)


def given_axes(axes: Any, count: int, what: str) -> np.ndarray:
    """Axes as given, in their shape; raises `InputError` unless there is one for each of what."""
    drawn = np.asarray(axes, dtype=object)
    if drawn.size != count:
        raise InputError(f"axes: {what} need {count}, not {drawn.size}: give one for each")
    return drawn


def below(axes: Axes, keys: Sequence[Any]) -> None:
    """Put a legend below the axes, where it covers nothing."""
    columns = len(keys) if len(keys) <= 3 else 2
    axes.legend(handles=keys, loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=columns)


def beside(axes: Axes) -> None:
    """Put the legend of an axes to its right, where it covers nothing."""
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0)


def mark_decades(*axes_of_one: Axis) -> None:
    """Mark 1, 2 and 5 of every decade on logarithmic axes of less than two decades.

    Axes of more than 20 to 1 have 1 and 3, whose labels would touch otherwise; those of less than
    5 to 1 have a few even marks, whose power of ten stands at the axis's end.
    """
    for axis in axes_of_one:
        low, high = axis.get_view_interval()
        if high >= 100.0 * low:
            continue
        if high < 5.0 * low:
            axis.set_major_locator(MaxNLocator(FEW))
            axis.set_major_formatter(ScalarFormatter())
        else:
            marks = (1.0, 3.0) if high > 20.0 * low else (1.0, 2.0, 5.0)
            axis.set_major_locator(LogLocator(subs=marks))
            axis.set_major_formatter(LogFormatterSciNotation(minor_thresholds=(99, 99)))
        axis.set_minor_formatter(NullFormatter())


def thumbnail(drawn: Any) -> str:
    """Small picture of axes as HTML, for a notebook; their figure is closed.

    Parameters
    ----------
    drawn : axes, or an array or list of axes of one figure
    """
    figure, image = np.ravel(drawn)[0].figure, io.BytesIO()
    figure.savefig(image, format="png", dpi=90)
    close(figure)
    return f'<img src="data:image/png;base64,{base64.b64encode(image.getvalue()).decode()}">'


def close(figure: Figure) -> None:
    """Close a figure that is saved, which matplotlib would keep in memory otherwise."""
    plt.close(figure)

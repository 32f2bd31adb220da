"""Pictures of a history: the loop, the profiles along X, and a fit over its data.

The only file that imports matplotlib.  Every function draws into the axes it is given or into new
ones, returns them, and neither shows them nor changes matplotlib's settings.  `style` dresses
figures of your own alike.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from jbeamshell.errors import InputError
from jbeamshell.files import written_whole
from jbeamshell.history import History, turning_points

Curve = tuple[ArrayLike, ArrayLike, str]
"""Force, displacement and label of a curve; the arrays have shape (points,)."""

STYLE: dict[Any, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": "0.4",
    "axes.formatter.limits": (-3, 4),
    "axes.formatter.use_mathtext": True,
    "axes.grid": True,
    "axes.labelsize": 10,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 10,
    "figure.constrained_layout.use": True,
    "figure.dpi": 90,
    "grid.color": "0.9",
    "grid.linewidth": 0.7,
    "legend.fontsize": 9,
    "legend.frameon": False,
    "lines.linewidth": 1.6,
    "xtick.color": "0.3",
    "xtick.labelsize": 9,
    "ytick.color": "0.3",
    "ytick.labelsize": 9,
}

# Okabe and Ito's palette, told apart by colour-blind readers too.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
DATA = "0.15"
FAINT = "0.65"

FORCE = "$F$  [force per width]"
DISPLACEMENT = "$u(L)$  [length]"
POSITION = "$X$  [length]"


@contextlib.contextmanager
def style() -> Iterator[None]:
    """Settings `STYLE` for the figures made in a ``with`` block."""
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
        Number of curves.

    Returns
    -------
    list
        Matplotlib colours: the palette for a few curves, viridis without its palest part for many.
    """
    if count <= len(PALETTE):
        return list(PALETTE[:count])
    return list(plt.get_cmap("viridis")(np.linspace(0.0, 0.92, count)))


def loop(history: History, axes: Axes | None = None) -> Axes:
    """Draw end force over end displacement: the whole path, its last closed cycle emphasised.

    Parameters
    ----------
    history : History
        A solved load path.
    axes : matplotlib.axes.Axes, optional
        Where to draw; new axes when not given.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn into.
    """
    with style():
        axes = _single(axes)
        closed = bool(history.cycles)
        axes.plot(
            np.asarray(history.displacement),
            np.asarray(history.force),
            color=FAINT if closed else PALETTE[0],
            linewidth=1.1 if closed else 1.6,
            label="path",
        )
        if closed:
            force, displacement = map(np.asarray, history.loop)
            axes.plot(displacement, force, color=PALETTE[0], linewidth=2.0, label="last cycle")
        axes.set(xlabel=DISPLACEMENT, ylabel=FORCE)
        axes.legend(loc="upper left")
    return axes


def profiles(
    history: History, steps: Sequence[int] | None = None, axes: ArrayLike | None = None
) -> np.ndarray:
    """Draw slip, rotation, friction traction and normal reaction along X at chosen steps.

    Parameters
    ----------
    history : History
        A solved load path.
    steps : sequence of int, optional
        Indices into the path, 0 being the strip before the load and -1 its end. When not given: the
        zero crossings and turning points of the last cycle, or four steps of a path without one.
    axes : array_like of matplotlib.axes.Axes, optional
        Four axes, for slip, rotation, traction and reaction; a new figure when not given.

    Returns
    -------
    ndarray of matplotlib.axes.Axes
        The axes drawn into, in the shape they came in, or (2, 2).

    Raises
    ------
    InputError
        If a step lies outside the path, or there are not four axes.

    Notes
    -----
    Traction and reaction are shown over mu F_N and F_N; a pressure that varies along X counts with
    its largest value. Dots mark the contact points that slipped in the step.
    """
    chosen = _checked_steps(history, _default_steps(history) if steps is None else steps)
    contact = history.scene.contact
    pressure = float(np.max(np.asarray(contact.pressure_at(history.x))))
    cap = float(contact.friction) * pressure
    squeezes = "psi" in history.scene.model.fields
    with style():
        grid = _four(axes)
        slip, rotation, traction, reaction = grid.ravel()
        x = np.asarray(history.x)
        for step, colour in zip(chosen, colours(len(chosen)), strict=True):
            slip.plot(x, np.asarray(history.slip[step]), color=colour)
            rotation.plot(x, np.asarray(history.beta[step]), color=colour)
            if squeezes:
                change = np.asarray(history.psi[step] - history.psi[0])
                rotation.plot(x, change, color=colour, linestyle="--", linewidth=1.1)
            moving, share = np.asarray(history.slipping[step]), np.asarray(history.traction[step])
            share = share / cap
            traction.plot(x, share, color=colour, label=_load_label(history, step))
            traction.plot(x[moving], share[moving], "o", color=colour, markersize=3.2)
            reaction.plot(x, np.asarray(history.reaction[step]) / pressure, color=colour)
        varies = contact.pressure.ndim > 0
        over = r"\max F_N" if varies else "F_N"
        slip.set(title="slip", ylabel="$v - v_p$  [length]")
        rotation.set(title="rotation", ylabel=r"$\beta$  [rad]")
        traction.set(title="friction traction", ylabel=rf"$t\,/\,\mu {over}$  [1]")
        reaction.set(title="normal reaction", ylabel=rf"$R\,/\,{over}$  [1]")
        if squeezes:
            rotation.set(title="rotation and squeeze strain")
            rotation.set_ylabel(r"$\beta$  [rad],  $\psi - \psi_p$  [1]")
            kinds = [Line2D([], [], color=DATA), Line2D([], [], color=DATA, linestyle="--")]
            rotation.legend(kinds, [r"$\beta$", r"$\psi - \psi_p$"], loc="best")
        for panel in grid.ravel():
            panel.set(xlabel=POSITION)
        dot = Line2D([], [], color=DATA, marker="o", linestyle="", markersize=3.2)
        handles, labels = traction.get_legend_handles_labels()
        traction.legend([*handles, dot], [*labels, "slips"], loc="best")
    return grid


def overlay(
    measured: Sequence[Curve],
    fitted: Sequence[Curve],
    axes: Axes | None = None,
    title: str | None = None,
) -> Axes:
    """Draw a model's loops over the data they were fitted to.

    Parameters
    ----------
    measured : sequence of (force, displacement, label)
        Data, drawn as dark dots; curves with the same label share one entry of the legend.
    fitted : sequence of (force, displacement, label)
        Model, drawn as coloured lines.
    axes : matplotlib.axes.Axes, optional
        Where to draw; new axes when not given.
    title : str, optional
        Title of the axes.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn into.
    """
    with style():
        axes = _single(axes)
        for (force, displacement, label), colour in zip(fitted, colours(len(fitted)), strict=True):
            axes.plot(np.asarray(displacement), np.asarray(force), color=colour, label=label)
        named: set[str] = set()
        for force, displacement, label in measured:
            axes.plot(
                np.asarray(displacement),
                np.asarray(force),
                linestyle="",
                marker="o",
                markersize=2.4,
                markeredgewidth=0.0,
                color=DATA,
                label="_nolegend_" if label in named else label,
                zorder=3.0,
            )
            named.add(label)
        axes.set(xlabel=DISPLACEMENT, ylabel=FORCE)
        if title is not None:
            axes.set_title(title)
        if measured or fitted:
            axes.legend(loc="best")
    return axes


def save(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure to a file, whole or not at all.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        The figure; of axes it is ``axes.figure``.
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
        figure.savefig(draft, format=suffix, dpi=200)


def _single(axes: Axes | None) -> Axes:
    return plt.subplots(figsize=(5.6, 4.0))[1] if axes is None else axes


def _four(axes: ArrayLike | None) -> np.ndarray:
    if axes is None:
        return plt.subplots(2, 2, figsize=(9.0, 6.0), sharex=True)[1]
    grid = np.asarray(axes, dtype=object)
    if grid.size != 4:
        raise InputError(f"axes: profiles need four, not {grid.size}")
    return grid


def _checked_steps(history: History, steps: Sequence[int]) -> list[int]:
    count = history.force.shape[0]
    for step in steps:
        if not -count <= step < count:
            raise InputError(f"steps: {step} is not on the path, whose steps are 0 to {count - 1}")
    return [int(step) % count for step in steps]


def _default_steps(history: History) -> list[int]:
    force = np.asarray(history.force)
    if not history.cycles:
        turns = turning_points(force)[1:]
        return turns if len(turns) > 1 else [*np.linspace(0, turns[0], 5).round().astype(int)[1:]]
    start, turn, stop = history.cycles[-1]
    chosen = []
    for first, last in ((start, turn), (turn, stop)):
        if force[first] * force[last] < 0.0:
            chosen.append(first + int(np.argmin(np.abs(force[first : last + 1]))))
        chosen.append(last)
    return chosen


def _load_label(history: History, step: int) -> str:
    """The load of a step, and at a zero crossing which way it was going."""
    force = float(history.force[step])
    if step == 0 or abs(force) > 1e-9 * float(np.nanmax(np.abs(np.asarray(history.force)))):
        return f"$F = {force:.4g}$"
    return "$F = 0$, " + ("rising" if force > float(history.force[step - 1]) else "falling")

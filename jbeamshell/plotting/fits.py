"""Models over the data that they were fitted to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from jbeamshell.plotting.style import (
    DISPLACEMENT,
    DOTS,
    FORCE,
    POSITION,
    SQUEEZE,
    colours,
    single,
    style,
)

Curve = tuple[ArrayLike, ArrayLike, str]
"""Force, displacement and label of a curve; the arrays have shape (points,)."""


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
        axes = single(axes)
        for (force, displacement, label), colour in zip(fitted, colours(len(fitted)), strict=True):
            axes.plot(np.asarray(displacement), np.asarray(force), color=colour, label=label)
        named: set[str] = set()
        for force, displacement, label in measured:
            axes.plot(
                np.asarray(displacement),
                np.asarray(force),
                label="_nolegend_" if label in named else label,
                **DOTS,
            )
            named.add(label)
        axes.set(xlabel=DISPLACEMENT, ylabel=FORCE)
        if title is not None:
            axes.set_title(title)
        if measured or fitted:
            axes.legend(loc="best")
    return axes


def squeeze_fit(data: Sequence[Any], model: Sequence[Any], axes: Axes | None = None) -> Axes:
    """Draw a model's squeeze stress along X over the data it was fitted to.

    Parameters
    ----------
    data : sequence of SqueezeCurve
        Anything with ``x``, ``stress`` and ``label``; drawn as dark dots.
    model : sequence of SqueezeCurve
        The model's curves, one for each of the data; drawn as coloured lines.
    axes : matplotlib.axes.Axes, optional
        Where to draw; new axes when not given.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn into.
    """
    with style():
        axes = single(axes)
        for curve, answer, colour in zip(data, model, colours(len(data)), strict=True):
            label = f"model, {answer.label}"
            axes.plot(np.asarray(answer.x), np.asarray(answer.stress), color=colour, label=label)
            axes.plot(np.asarray(curve.x), np.asarray(curve.stress), label=curve.label, **DOTS)
        axes.set(xlabel=POSITION, ylabel=SQUEEZE)
        if data:
            axes.legend(loc="best")
    return axes

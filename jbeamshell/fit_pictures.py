"""Pictures of a fit: the model over its data, and what it leaves unexplained."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from jbeamshell import plotting
from jbeamshell.errors import InputError
from jbeamshell.loops import Loop
from jbeamshell.measurements import Backbone, DissipationCurve, SqueezeCurve, StiffnessCurve
from jbeamshell.results import Fit

PER_CENT = "(model - data) / range  [%]"
BAND = 0.95


class Kind(NamedTuple):
    """How measurements of some types are drawn.

    Attributes
    ----------
    types : of the measurements
    x, y : names of their columns
    labels : of the axes
    scale : of both axes
    """

    types: tuple[type, ...]
    x: str
    y: str
    labels: tuple[str, str]
    scale: str = "linear"


AMPLITUDE = "amplitude"
KINDS = (
    Kind((Loop, Backbone), "displacement", "force", (plotting.DISPLACEMENT, plotting.FORCE)),
    Kind((SqueezeCurve,), "x", "stress", (plotting.POSITION, plotting.SQUEEZE)),
    Kind((DissipationCurve,), "amplitude", "dissipation", (AMPLITUDE, "work per cycle"), "log"),
    Kind((StiffnessCurve,), "amplitude", "stiffness", (AMPLITUDE, "secant stiffness"), "log"),
)


def overlay(fit: Fit, axes: Any = None) -> list[Any]:
    """Draw the model over the data, with its 95 % bands, a panel for each kind of measurement.

    Parameters
    ----------
    fit : result of a fit
    axes : as many as there are kinds; new ones when not given

    Returns
    -------
    list of matplotlib.axes.Axes
        loops and backbones first, then squeeze, dissipation, stiffness
    """
    bands = fit.bands(BAND) if fit.problem is not None else None
    with plotting.style():
        panels = _panels(fit, axes)
        for kind, places, panel in panels:
            for place, colour in zip(places, plotting.colours(len(places)), strict=True):
                data, model = fit.data[place], fit.model[place]
                x, y = getattr(model, kind.x), getattr(model, kind.y)
                panel.plot(x, y, color=colour, label=f"model, {data.label}")
                first = "data" if place == places[0] else "_nolegend_"
                panel.plot(
                    getattr(data, kind.x), getattr(data, kind.y), label=first, **plotting.DOTS
                )
                if bands is not None:
                    x, y = (
                        np.append(
                            getattr(bands[place][0], name), getattr(bands[place][1], name)[::-1]
                        )
                        for name in (kind.x, kind.y)
                    )
                    panel.fill(x, y, color=colour, alpha=0.2, linewidth=0.0)
            panel.set(xlabel=kind.labels[0], ylabel=kind.labels[1])
            panel.set(xscale=kind.scale, yscale=kind.scale)
            panel.legend(loc="best")
    return [panel for _, _, panel in panels]


def residuals(fit: Fit, axes: Any = None) -> list[Any]:
    """Draw what the model leaves unexplained, in per cent, over what drives or where it was taken.

    Parameters
    ----------
    fit : result of a fit
    axes : as many as there are kinds of measurements; new ones when not given

    Returns
    -------
    list of matplotlib.axes.Axes
        in the order of `overlay`
    """
    left, columns = fit.residuals, fit.columns
    with plotting.style():
        panels = _panels(fit, axes)
        for kind, places, panel in panels:
            x, label = kind.x, kind.labels[0]
            if columns[places[0]] == "displacement":
                x, label = "force", plotting.FORCE
            for place, colour in zip(places, plotting.colours(len(places)), strict=True):
                data = fit.data[place]
                panel.plot(
                    getattr(data, x), 100.0 * left[place], ".", color=colour, label=data.label
                )
            panel.axhline(0.0, color=plotting.FAINT, linewidth=1.0, zorder=1.0)
            panel.set(xlabel=label, xscale=kind.scale)
            panel.set(ylabel="log(model / data)  [%]" if kind.scale == "log" else PER_CENT)
            panel.legend(loc="best")
    return [panel for _, _, panel in panels]


def _panels(fit: Fit, axes: Any) -> list[tuple[Kind, list[int], Any]]:
    """Kind, places of its measurements, and where to draw them."""
    kinds: list[tuple[Kind, list[int]]] = []
    for kind in KINDS:
        places = [i for i, data in enumerate(fit.data) if isinstance(data, kind.types)]
        if places:
            kinds.append((kind, places))
    drawn: Any = _new_axes(len(kinds)) if axes is None else np.ravel(axes)
    if len(drawn) != len(kinds):
        raise InputError(f"axes: these data need {len(kinds)}, not {len(drawn)}")
    return [(kind, places, panel) for (kind, places), panel in zip(kinds, drawn, strict=True)]


def _new_axes(count: int) -> Any:
    return plotting.plt.subplots(1, count, figsize=(5.2 * count, 4.2), squeeze=False)[1][0]

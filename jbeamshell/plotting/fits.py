"""Pictures of a fit: the model over its data, and what it leaves unexplained."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from jbeamshell.common.errors import InputError
from jbeamshell.measured.curves import Backbone, DissipationCurve, SqueezeCurve, StiffnessCurve
from jbeamshell.measured.loops import Loop
from jbeamshell.plotting.protocols import LikelihoodProfile, ModelOverData
from jbeamshell.plotting.style import (
    DISPLACEMENT,
    DOTS,
    FAINT,
    FORCE,
    PALETTE,
    POSITION,
    SQUEEZE,
    colours,
    style,
)

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
    Kind((Loop, Backbone), "displacement", "force", (DISPLACEMENT, FORCE)),
    Kind((SqueezeCurve,), "x", "stress", (POSITION, SQUEEZE)),
    Kind((DissipationCurve,), "amplitude", "dissipation", (AMPLITUDE, "work per cycle"), "log"),
    Kind((StiffnessCurve,), "amplitude", "stiffness", (AMPLITUDE, "secant stiffness"), "log"),
)


def overlay(fit: ModelOverData, axes: Any = None) -> list[Any]:
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
    with style():
        panels = _panels(fit, axes)
        for kind, places, panel in panels:
            for place, colour in zip(places, colours(len(places)), strict=True):
                data, model = fit.data[place], fit.model[place]
                x, y = getattr(model, kind.x), getattr(model, kind.y)
                panel.plot(x, y, color=colour, label=f"model, {data.label}")
                first = "data" if place == places[0] else "_nolegend_"
                panel.plot(getattr(data, kind.x), getattr(data, kind.y), label=first, **DOTS)
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


def residuals(fit: ModelOverData, axes: Any = None) -> list[Any]:
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
    with style():
        panels = _panels(fit, axes)
        for kind, places, panel in panels:
            x, label = kind.x, kind.labels[0]
            if columns[places[0]] == "displacement":
                x, label = "force", FORCE
            for place, colour in zip(places, colours(len(places)), strict=True):
                data = fit.data[place]
                panel.plot(
                    getattr(data, x), 100.0 * left[place], ".", color=colour, label=data.label
                )
            panel.axhline(0.0, color=FAINT, linewidth=1.0, zorder=1.0)
            panel.set(xlabel=label, xscale=kind.scale)
            panel.set(ylabel="log(model / data)  [%]" if kind.scale == "log" else PER_CENT)
            panel.legend(loc="best")
    return [panel for _, _, panel in panels]


def _panels(fit: ModelOverData, axes: Any) -> list[tuple[Kind, list[int], Any]]:
    """Kind, places of its measurements, and where to draw them."""
    kinds: list[tuple[Kind, list[int]]] = []
    for kind in KINDS:
        places = [i for i, data in enumerate(fit.data) if isinstance(data, kind.types)]
        if places:
            kinds.append((kind, places))
    drawn = _checked_axes(len(kinds), axes)
    return [(kind, places, panel) for (kind, places), panel in zip(kinds, drawn, strict=True)]


def likelihoods(profiles: Sequence[LikelihoodProfile], axes: Any = None) -> list[Axes]:
    """Draw profile likelihoods: what it costs the data to hold a parameter elsewhere.

    Parameters
    ----------
    profiles : of fitted parameters
    axes : one for each; new ones when not given
    """
    with style():
        panels = _checked_axes(len(profiles), axes)
        for profile, panel in zip(profiles, panels, strict=True):
            # The root of the rise is about straight to either side of the minimum.
            side = np.sign(profile.values - profile.values[np.argmin(profile.rises)])
            fine = np.linspace(profile.values[0], profile.values[-1], 200)
            root = np.interp(fine, profile.values, side * np.sqrt(profile.rises))
            panel.plot(fine, root**2, color=PALETTE[0])
            panel.plot(profile.values, profile.rises, "o", color=PALETTE[0], markersize=4.0)
            for end in profile.interval:
                if np.isfinite(end):
                    panel.axvline(end, color=PALETTE[1], linestyle=":", linewidth=1.2)
            low, high = profile.interval
            panel.set(xlabel=profile.name, ylabel="rise of the misfit, in units of the noise  [1]")
            panel.set_title(f"{100.0 * profile.level:g} %: {low:.4g} to {high:.4g}")
    return panels


def _checked_axes(count: int, axes: Any) -> list[Axes]:
    if axes is None:
        size = (5.2 * count, 4.2)
        return list(plt.subplots(1, count, figsize=size, squeeze=False)[1][0])
    drawn = list(np.ravel(axes))
    if len(drawn) != count:
        raise InputError(f"axes: there are {count} to draw, not {len(drawn)}")
    return drawn

"""Pictures of a fit: model over data, what the model leaves unexplained, likelihoods."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from jbeamshell.measured.form import Form, by_form
from jbeamshell.plotting.style import (
    DOTS,
    FAINT,
    MARKS,
    PALETTE,
    below,
    colours,
    given_axes,
    looks,
    mark_decades,
    panels,
    style,
)
from jbeamshell.scene.scene import Scene

PER_CENT = "(model - data) / range  [%]"
LOG_PER_CENT = r"$\ln$(model / data)  [%]"
BAND = 0.95
ABOVE_DOTS = DOTS["zorder"] + 0.5  # where dots do not hide a line
FEW = 30  # points that are drawn as larger dots
MOST_NAMED = 6  # measurements whose names fit into a panel
SHORT = 14  # letters of a name of which two fit beside each other below a panel


def overlay(fit: Any, axes: Any = None) -> list[Axes]:
    """Draw the model over the data, with its 95 % bands.

    Parameters
    ----------
    fit : `jbeamshell.identify.Fit`
    axes : axes, one for each form of measurement; new ones when not given

    Returns
    -------
    list of matplotlib.axes.Axes
        one for each form of measurement, in the order in which the data have them: loops and
        backbones share one
    """
    bands = fit.bands(BAND) if fit.problem is not None else None
    with style():
        drawn = _panels(fit, axes)
        for form, places, panel in drawn:
            for place, look in zip(places, looks(len(places)), strict=True):
                data, model = fit.data[place], fit.model[place]
                name = _name(places, place, data.label)
                panel.plot(*_xy(form, model), **look, label=name, zorder=ABOVE_DOTS)
                first = "data" if place == places[0] else "_nolegend_"
                x, y = _xy(form, data)
                size = {"markersize": 5.0} if x.size < FEW else {}
                panel.plot(x, y, label=first, **DOTS | size)
                if bands is not None:
                    low, high = (_xy(form, end) for end in bands[place])
                    x, y = (np.append(a, b[::-1]) for a, b in zip(low, high, strict=True))
                    panel.fill(x, y, color=look["color"], alpha=0.2, linewidth=0.0)
            along, up = (_label(fit, form.columns[name].label) for name in (form.x, form.y))
            panel.set(xlabel=along, ylabel=up)
            panel.set(xscale=form.scale, yscale=form.scale)
            if form.scale == "log":
                mark_decades(panel.xaxis, panel.yaxis)
            below(panel, panel.get_legend_handles_labels()[0])
    return [panel for _, _, panel in drawn]


def residuals(fit: Any, axes: Any = None) -> list[Axes]:
    """Draw the difference between model and data, in per cent.

    It is drawn over the column that drives the model, or over the position.

    Parameters
    ----------
    fit : `jbeamshell.identify.Fit`
    axes : axes, one for each form of measurement; new ones when not given

    Returns
    -------
    list of matplotlib.axes.Axes
        one for each form of measurement, in the order of `overlay`
    """
    left, columns = fit.residuals, fit.columns
    with style():
        drawn = _panels(fit, axes)
        for form, places, panel in drawn:
            along = next(name for name in form.columns if name != columns[places[0]])
            for place, colour, mark in zip(
                places, colours(len(places)), cycle(MARKS), strict=False
            ):
                data = fit.data[place]
                named = _shortened(data.label) if len(places) <= MOST_NAMED else "_nolegend_"
                look = {"color": colour, "label": named, "markersize": 3.0}
                panel.plot(getattr(data, along), 100.0 * left[place], mark, **look)
            panel.axhline(0.0, color=FAINT, linewidth=1.0, zorder=1.0)
            panel.set(xlabel=_label(fit, form.columns[along].label), xscale=form.scale)
            if form.scale == "log":
                mark_decades(panel.xaxis)
            panel.set(ylabel=LOG_PER_CENT if form.scale == "log" else PER_CENT)
            if len(places) <= MOST_NAMED:
                panel.legend(loc="best").set_in_layout(False)
    return [panel for _, _, panel in drawn]


def _label(fit: Any, label: str) -> str:
    """Label of a column, without the words for one unit of width where forces are totals."""
    scenes = [own for own in fit.scenes.values() if isinstance(own, Scene)]
    totals = any(scene.strip.width is not None for scene in scenes)
    measured = any((getattr(data, "units", None) or {}).get("force") == "N" for data in fit.data)
    return label.replace("/width", "") if totals or (measured and not scenes) else label


def _name(places: Sequence[int], place: int, label: str) -> str:
    """Label of a model's line; of many lines only the first has one."""
    if len(places) <= MOST_NAMED:
        return f"model, {_shortened(label)}"
    return f"model of {len(places)} measurements" if place == places[0] else "_nolegend_"


def _shortened(name: str) -> str:
    """Name without the middle of a long one."""
    half = SHORT // 2
    return name if len(name) <= SHORT else f"{name[:half]}…{name[1 - half :]}"


def _xy(form: Form, measurement: Any) -> tuple[np.ndarray, np.ndarray]:
    """Columns of a measurement that are drawn along and up."""
    return getattr(measurement, form.x), getattr(measurement, form.y)


def _panels(fit: Any, axes: Any) -> list[tuple[Form, list[int], Axes]]:
    """Forms, the places of their measurements, and the axes of each."""
    forms = by_form(fit.data)
    drawn = _checked_axes(len(forms), axes, "forms of measurement")
    return [(form, places, panel) for (form, places), panel in zip(forms, drawn, strict=True)]


def likelihoods(profiles: Sequence[Any], axes: Any = None) -> list[Axes]:
    """Draw profile likelihoods: the rise of the misfit while a parameter is held at other values.

    Parameters
    ----------
    profiles : profiles of fitted parameters, as `Fit.profile` of `jbeamshell.identify` gives them
    axes : axes, one for each profile; new ones when not given

    Returns
    -------
    list of matplotlib.axes.Axes
        one for each profile; dotted lines mark the ends of its interval
    """
    with style():
        drawn = _checked_axes(len(profiles), axes, "profiles")
        for profile, panel in zip(profiles, drawn, strict=True):
            # The root of the rise is nearly straight on either side of the minimum.
            side = np.sign(profile.values - profile.values[np.argmin(profile.rises)])
            fine = np.linspace(profile.values[0], profile.values[-1], 200)
            root = np.interp(fine, profile.values, side * np.sqrt(profile.rises))
            panel.plot(fine, root**2, color=PALETTE[0])
            panel.plot(profile.values, profile.rises, "o", color=PALETTE[0], markersize=4.0)
            for end in profile.interval:
                if np.isfinite(end):
                    panel.axvline(end, color=PALETTE[1], linestyle=":", linewidth=1.2)
            low, high = profile.interval
            panel.set(xlabel=profile.name, ylabel="rise of the misfit / noise$^2$")
            panel.set_title(f"{100.0 * profile.level:g} %: {low:.4g} to {high:.4g}")
    return drawn


def _checked_axes(count: int, axes: Any, what: str) -> list[Axes]:
    """Axes as given if there are as many, or new ones."""
    return list(panels(1, count)[0] if axes is None else given_axes(axes, count, what).ravel())

"""Pictures of the contact: where a strip is squeezed, touches, sticks, slips and lifts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from jbeamshell.common.errors import InputError
from jbeamshell.numerics.cycles import turning_points
from jbeamshell.plotting.steps import checked_steps, default_contact_steps, load_label
from jbeamshell.plotting.style import (
    DATA,
    DOTS,
    FAINT,
    FORCE,
    LIFTED,
    POSITION,
    SLIPS,
    SQUEEZE,
    STICKS,
    below,
    given_axes,
    looks,
    panels,
    single,
    style,
    unit_words,
)

# Titles and labels of the profiles that `contact` can draw, by their names in a history.
PROFILES = {
    "reaction": ("normal reaction", "$R$  [stress]"),
    "gap": ("gap under the strip", "gap  [length]"),
    "beta": ("rotation", r"$\beta$  [rad]"),
    "squeeze_stress": ("mean squeeze stress", SQUEEZE),
    "psi": ("squeeze strain", r"$\psi$  [dimensionless]"),
    "squeeze_couple": ("squeeze couple", r"$\xi$  [couple/width]"),
}
STATES = (LIFTED, STICKS, SLIPS)
AROUND = 5.0  # half heights H that `contact` shows beside corners and ends of contact


def contact(
    history: Any,
    steps: Sequence[int] | None = None,
    axes: ArrayLike | None = None,
    reference: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    *,
    panels: Sequence[str] | None = None,
    xlim: tuple[float, float] | None = None,
    reference_label: str = "finite elements",
) -> np.ndarray:
    """Draw profiles of squeeze, lift and rotation along X at chosen steps.

    Parameters
    ----------
    history : jbeamshell.History
        Solved load path.
    steps : sequence of int, optional
        Indices into the path. When not given: the pressed strip and the turning points of the last
        cycle; the end of a path without a cycle; four steps if only the pressure grows.
    axes : array_like of matplotlib.axes.Axes, optional
        One for each panel; a new figure when not given.
    reference : mapping of str to (x, values), optional
        Points to compare with, by the name of their panel; drawn as dots.
    panels : sequence of str, optional
        Profiles to draw, among "reaction", "gap", "beta", "squeeze_stress", "psi" and
        "squeeze_couple"; all that the scene has when not given.
    xlim : (float, float), optional
        Part of X to show. When not given: the corners of a pressure table and the ends of contact
        with their surroundings, or the whole strip if these cover half of it.
    reference_label : str
        Name of the reference in the legend.

    Returns
    -------
    ndarray of matplotlib.axes.Axes
        The axes drawn into, in the shape they came in, or (panels,).

    Raises
    ------
    InputError
        If a step lies outside the path, a panel is none of the scene, or there are not as many axes
        as panels.

    Notes
    -----
    The grey line is the pressure on the top face, and dotted lines mark where the contact ends.
    """
    reference = reference or {}
    chosen = checked_steps(history, default_contact_steps(history) if steps is None else steps)
    names = _checked_panels(history, panels, reference)
    ends = _contact_ends(history)[chosen]
    low, high = _surroundings(history, ends) if xlim is None else xlim
    founded = history.scene.contact.normal != "none"
    squeezed, sign = ("reaction", 1.0) if founded else ("squeeze_stress", -1.0)
    with style():
        new = axes is None
        grid = _many(len(names)) if new else given_axes(axes, len(names), ", ".join(names))
        for name, panel in zip(names, grid.ravel(), strict=True):
            title, label = PROFILES[name]
            label = unit_words(history, label)
            if name == "gap" and not founded:
                title, label = "rise of the bottom face", "$w$  [length]"
            panel.set(title=title, xlabel=POSITION, ylabel=label)
            drawn = []
            if name == squeezed:
                x, pressure = _pressure_corners(history, max(history.pressure[i] for i in chosen))
                drawn += panel.plot(x, sign * pressure, color=FAINT, linewidth=1.1)
            for step, end, look in zip(chosen, ends, looks(len(chosen)), strict=True):
                values = np.asarray(getattr(history, name)[step])
                at_nodes = values.size == history.x.size
                x = np.asarray(history.x if at_nodes else history.middles)
                drawn += panel.plot(x, values, **look)
                if np.isfinite(end):
                    panel.axvline(
                        end, color=look["color"], linestyle=":", linewidth=1.0, zorder=1.0
                    )
            if name in reference:
                x, values = map(np.asarray, reference[name])
                drawn += panel.plot(x, values, **DOTS)
            _show(panel, drawn, low, high, _size(history, name))
        keys: list[tuple[str, dict[str, Any]]] = [
            (load_label(history, step) if len(chosen) > 1 else "shell", look)
            for step, look in zip(chosen, looks(len(chosen)), strict=True)
        ]
        if squeezed in names:
            keys.append(("pressure on top", {"color": FAINT, "linewidth": 1.1}))
        if np.any(np.isfinite(ends)):
            keys.append(("contact ends", {"color": DATA, "linestyle": ":", "linewidth": 1.0}))
        if reference:
            keys.append((reference_label, DOTS))
        handles = [Line2D([], [], label=label, **look) for label, look in keys]
        if new:  # below the panels, where it covers nothing
            place = {"loc": "outside lower center", "ncols": len(handles)}
            grid.ravel()[0].figure.legend(handles=handles, **place)
        else:
            grid.ravel()[0].legend(handles=handles, loc="best")
    return grid


def contact_map(
    history: Any, axes: Axes | None = None, *, xlim: tuple[float, float] | None = None
) -> Axes:
    """Draw the parts of the contact that stick, slip or are lifted along the load path.

    Parameters
    ----------
    history : jbeamshell.History
        Solved load path.
    axes : matplotlib.axes.Axes, optional
        Where to draw; new axes when not given.
    xlim : (float, float), optional
        Part of X to show; the whole strip when not given.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn into: the load path from left to right, X upwards.

    Raises
    ------
    InputError
        If there is no foundation.

    Notes
    -----
    The horizontal axis counts load steps after the pressing, with the end force at its turning
    points; of a growing pressure alone, it is the part that acts. Steps without equilibrium stay
    blank.
    """
    scene = history.scene
    if scene.contact.normal == "none":
        raise InputError("contact.normal = 'none': there is no contact to draw; take another one")
    pressing = history.pressed + 1 == history.force.size
    path = slice(None) if pressing else slice(history.pressed, None)
    driver = np.asarray(history.pressure if pressing else history.force)[path]
    # The cell of a step lies before it.
    edges = np.append(0.0, driver) if pressing else np.arange(driver.size + 1) - 0.5
    smooth = pressing or float(scene.contact.friction) == 0.0
    names = ["lifted", "touches"] if smooth else ["lifted", "sticks", "slips"]
    shades = STATES[: len(names)]
    touches, slips = (np.asarray(a)[path] for a in (history.touching, history.slipping))
    states = np.where(touches, 1 + (slips & (not smooth)), 0)
    failed = np.isnan(np.asarray(history.force))[path]
    ends = _contact_ends(history)[path]
    with style():
        axes = single(axes)
        axes.grid(False)
        axes.pcolormesh(
            edges,
            np.append(0.0, np.cumsum(np.asarray(history.tributary))),
            np.ma.masked_array(states, np.broadcast_to(failed[:, None], states.shape)).T,
            cmap=ListedColormap(shades),
            vmin=0,
            vmax=len(names) - 1,
            rasterized=True,
        )
        keys: list[Any] = [Patch(color=c, label=n) for c, n in zip(shades, names, strict=True)]
        if np.any(np.isfinite(ends)):
            axes.stairs(ends, edges, baseline=None, color=DATA, linewidth=1.2)
            keys.append(Line2D([], [], color=DATA, linewidth=1.2, label="contact ends"))
        axes.set(ylabel=POSITION, ylim=(0.0, float(history.x[-1])) if xlim is None else xlim)
        if pressing:
            axes.set_xlabel("part of the pressure that acts")
        else:
            turns = sorted(set(turning_points(driver[~failed])))
            axes.set_xticks(turns, [f"${driver[turn]:.3g}$" for turn in turns])
            axes.set_xlabel(f"{unit_words(history, FORCE)}, along the path")
        below(axes, keys)
    return axes


def _many(count: int) -> np.ndarray:
    """Axes of a new figure, (count,), in rows of up to three."""
    columns = 2 if count == 4 else min(count, 3)
    rows = -(-count // columns)
    grid = panels(rows, columns)
    for spare in grid.ravel()[count:]:
        spare.remove()
    return grid.ravel()[:count]


def _checked_panels(
    history: Any, panels: Sequence[str] | None, reference: Mapping[str, Any]
) -> list[str]:
    """Names of the panels; raises `InputError` for one that the scene does not have."""
    fields = history.scene.plan.fields
    needs = {"gap": "w", "beta": "beta"} | dict.fromkeys(
        ("squeeze_stress", "psi", "squeeze_couple"), "psi"
    )
    known = [name for name in PROFILES if name not in needs or needs[name] in fields]
    if history.scene.contact.normal == "none":
        known.remove("reaction")
    if history.scene.plan.section == "assumed":
        known.remove("squeeze_couple")
    for key, names in (("panels", panels or ()), ("reference", reference)):
        for name in names:
            if name not in known:
                raise InputError(f"{key}: there is no {name!r} in {', '.join(known)}")
    return known if panels is None else list(panels)


def _contact_ends(history: Any) -> np.ndarray:
    """Ends of contact X, (steps+1,); NaN without equilibrium, or where it does not end before L."""
    if not history.scene.plan.lifts or history.scene.contact.normal == "none":
        return np.full(history.force.shape, np.nan)
    ends, failed = np.asarray(history.contact_end), np.isnan(np.asarray(history.force))
    return np.where(failed | (ends >= float(history.x[-1])), np.nan, ends)


def _surroundings(history: Any, ends: np.ndarray) -> tuple[float, float]:
    """Part of X around corners of the pressure and ends of contact; all of X if more than half."""
    contact, length = history.scene.contact, float(history.x[-1])
    tables = [np.asarray(p)[:, 0] for p in (contact.pressure, contact.bottom_pressure) if p.ndim]
    places = np.concatenate([*tables, ends])
    inner = places[(places > 0.0) & (places < length)]
    if inner.size == 0:
        return 0.0, length
    reach = AROUND * float(history.scene.strip.half_height)
    low, high = max(inner.min() - reach, 0.0), min(inner.max() + reach, length)
    return (low, high) if high - low < 0.5 * length else (0.0, length)


def _pressure_corners(history: Any, part: Any) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the pressure on the top face, times the part that acts."""
    table, length = np.asarray(history.scene.contact.pressure), float(history.x[-1])
    if table.ndim == 0:
        return np.array([0.0, length]), np.full(2, float(part) * table)
    x = np.concatenate([[0.0], table[:, 0], [length]])
    return x, float(part) * np.pad(table[:, 1], 1, mode="edge")


def _size(history: Any, name: str) -> float:
    """Size that a profile typically has, so that rounding errors are not magnified."""
    strip = history.scene.strip
    stress = float(history.scene.contact.largest_pressure)
    strain, half = stress / float(strip.plane_modulus), float(strip.half_height)
    strains = {"gap": strain * half, "beta": strain, "psi": strain}
    return strains.get(name, stress * half**2 if name == "squeeze_couple" else stress)


def _show(panel: Axes, lines: Sequence[Line2D], low: float, high: float, size: float) -> None:
    """Limit the panel to a part of X and to the lines' range there, but not to rounding errors."""
    inside, seen = np.linspace(low, high, 400), [np.zeros(0)]
    for line in lines:
        x, y = (np.asarray(a) for a in (line.get_xdata(), line.get_ydata()))
        seen += [y[(low <= x) & (x <= high)], np.interp(inside, x, y)]
    values = np.concatenate(seen)
    values = values[np.isfinite(values)]
    if values.size == 0 or np.ptp(values) < 1e-6 * size:
        values = np.append(values, [-0.1 * size, 0.1 * size])
    margin = 0.06 * np.ptp(values)
    panel.set(xlim=(low, high), ylim=(values.min() - margin, values.max() + margin))

"""Pictures of a history: the loop, the profiles along X, the contact, and a fit over its data.

The only file that imports matplotlib.  Every function draws into the axes it is given or into new
ones, returns them, and neither shows them nor changes matplotlib's settings.  `style` dresses
figures of your own alike.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from jbeamshell.cycles import turning_points
from jbeamshell.errors import InputError
from jbeamshell.files import written_whole
from jbeamshell.history import History

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
DOTS: dict[str, Any] = {
    "color": DATA,
    "linestyle": "",
    "marker": "o",
    "markersize": 2.4,
    "markeredgewidth": 0.0,
    "zorder": 3.0,
}

FORCE = "$F$  [force per width]"
DISPLACEMENT = "$u(L)$  [length]"
POSITION = "$X$  [length]"
SQUEEZE = r"$\chi\,/\,2H$  [stress]"

# Title and label of the profiles that `contact` can draw, by their names in a history.
PROFILES = {
    "reaction": ("normal reaction", "$R$  [stress]"),
    "gap": ("gap under the strip", "gap  [length]"),
    "beta": ("rotation", r"$\beta$  [rad]"),
    "squeeze_stress": ("mean squeeze stress", SQUEEZE),
    "psi": ("squeeze strain", r"$\psi$  [1]"),
    "squeeze_couple": ("squeeze couple", r"$\xi$  [couple per width]"),
}
STATES = ("0.93", "#56B4E9", "#E69F00")  # lifted, touching, slipping
AROUND = 5.0  # heights H that `contact` shows on either side of where something happens


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
    its largest value. Without friction the traction has no such measure and is shown as it is. Dots
    mark the contact points that slipped in the step.
    """
    chosen = _checked_steps(history, _default_steps(history) if steps is None else steps)
    contact = history.scene.contact
    pressure = float(contact.largest_pressure)
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
                change = np.asarray(history.psi[step] - history.psi[history.pressed])
                rotation.plot(x, change, color=colour, linestyle="--", linewidth=1.1)
            moving, share = np.asarray(history.slipping[step]), np.asarray(history.traction[step])
            share = share / cap if cap > 0.0 else share
            traction.plot(x, share, color=colour, label=_load_label(history, step))
            traction.plot(x[moving], share[moving], "o", color=colour, markersize=3.2)
            reaction.plot(x, np.asarray(history.reaction[step]) / pressure, color=colour)
        varies = contact.pressure.ndim > 0
        over = r"\max F_N" if varies else "F_N"
        slip.set(title="slip", ylabel="$v - v_p$  [length]")
        rotation.set(title="rotation", ylabel=r"$\beta$  [rad]")
        share_of = rf"$t\,/\,\mu {over}$  [1]" if cap > 0.0 else "$t$  [stress]"
        traction.set(title="friction traction", ylabel=share_of)
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


def contact(
    history: History,
    steps: Sequence[int] | None = None,
    axes: ArrayLike | None = None,
    reference: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    *,
    panels: Sequence[str] | None = None,
    xlim: tuple[float, float] | None = None,
    reference_label: str = "finite elements",
) -> np.ndarray:
    """Draw how a strip is squeezed and where it lifts off, along X at chosen steps.

    Parameters
    ----------
    history : History
        A solved load path.
    steps : sequence of int, optional
        Indices into the path. When not given: the pressed strip and the turning points of the last
        cycle; the end of a path without one; four steps where only the pressure grows.
    axes : array_like of matplotlib.axes.Axes, optional
        As many axes as there are panels; a new figure when not given.
    reference : mapping of str to (x, values), optional
        Curves to put beside the history's, by the name of their panel; drawn as dots.
    panels : sequence of str, optional
        What to draw, among "reaction", "gap", "beta", "squeeze_stress", "psi" and "squeeze_couple";
        when not given, all that the scene has.
    xlim : (float, float), optional
        Part of X to show. When not given: the surroundings of the corners of a pressure table and
        of the ends of contact, or the whole strip if those are all over it.
    reference_label : str
        What the legend calls the reference.

    Returns
    -------
    ndarray of matplotlib.axes.Axes
        The axes drawn into, in the shape they came in, or (panels,).

    Raises
    ------
    InputError
        If a step lies outside the path, the scene does not have a panel, or the axes are not as
        many as the panels.

    Notes
    -----
    The grey line is the pressure on the top face, and dotted lines mark where the contact ends.
    """
    reference = reference or {}
    chosen = _checked_steps(history, _default_contact_steps(history) if steps is None else steps)
    names = _checked_panels(history, panels, reference)
    ends = _contact_ends(history)[chosen]
    low, high = _surroundings(history, ends) if xlim is None else xlim
    founded = history.scene.contact.normal != "none"
    squeezed, sign = ("reaction", 1.0) if founded else ("squeeze_stress", -1.0)
    with style():
        grid = _many(len(names)) if axes is None else np.asarray(axes, dtype=object)
        if grid.size != len(names):
            raise InputError(f"axes: {', '.join(names)} need {len(names)}, not {grid.size}")
        for name, panel in zip(names, grid.ravel(), strict=True):
            title, label = PROFILES[name]
            if name == "gap" and not founded:
                title, label = "rise of the bottom face", "$w$  [length]"
            panel.set(title=title, xlabel=POSITION, ylabel=label)
            drawn = []
            if name == squeezed:
                x, pressure = _pressure_corners(history, max(history.pressure[i] for i in chosen))
                drawn += panel.plot(x, sign * pressure, color=FAINT, linewidth=1.1)
            for step, end, colour in zip(chosen, ends, colours(len(chosen)), strict=True):
                values = np.asarray(getattr(history, name)[step])
                at_nodes = values.size == history.x.size
                x = np.asarray(history.x if at_nodes else history.middles)
                drawn += panel.plot(x, values, color=colour)
                if np.isfinite(end):
                    panel.axvline(end, color=colour, linestyle=":", linewidth=1.0, zorder=1.0)
            if name in reference:
                x, values = map(np.asarray, reference[name])
                drawn += panel.plot(x, values, **DOTS)
            _show(panel, drawn, low, high, _size(history, name))
        looks: list[tuple[str, dict[str, Any]]] = [
            (_load_label(history, step) if len(chosen) > 1 else "shell", {"color": colour})
            for step, colour in zip(chosen, colours(len(chosen)), strict=True)
        ]
        if squeezed in names:
            looks.append(("pressure on top", {"color": FAINT, "linewidth": 1.1}))
        if np.any(np.isfinite(ends)):
            looks.append(("contact ends", {"color": DATA, "linestyle": ":", "linewidth": 1.0}))
        if reference:
            looks.append((reference_label, DOTS))
        keys = [Line2D([], [], label=label, **look) for label, look in looks]
        grid.ravel()[0].legend(handles=keys, loc="best")
    return grid


def contact_map(
    history: History, axes: Axes | None = None, *, xlim: tuple[float, float] | None = None
) -> Axes:
    """Draw which part of the contact sticks, slips or is lifted along the load path.

    Parameters
    ----------
    history : History
        A solved load path.
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
    After the pressure, the path goes by load steps, with ticks of the end force where it turns; the
    pressure alone goes by its part that acts. Steps without equilibrium stay blank.
    """
    scene = history.scene
    if scene.contact.normal == "none":
        raise InputError("contact.normal = 'none': there is no contact to draw")
    pressing = history.pressed + 1 == history.force.size
    path = slice(None) if pressing else slice(history.pressed, None)
    driver = np.asarray(history.pressure if pressing else history.force)[path]
    # A step's cell is what led to it.
    edges = np.append(0.0, driver) if pressing else np.arange(driver.size + 1) - 0.5
    smooth = pressing or float(scene.contact.friction) == 0.0
    names = ["lifted", "touches"] if smooth else ["lifted", "sticks", "slips"]
    shades = STATES[: len(names)]
    touches, slips = (np.asarray(a)[path] for a in (history.touching, history.slipping))
    states = np.where(touches, 1 + (slips & (not smooth)), 0)
    failed = np.isnan(np.asarray(history.force))[path]
    ends = _contact_ends(history)[path]
    with style():
        axes = _single(axes)
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
            axes.set_xlabel("part of the pressure that acts  [1]")
        else:
            turns = sorted(set(turning_points(driver[~failed])))
            axes.set_xticks(turns, [f"${driver[turn]:.4g}$" for turn in turns])
            axes.set_xlabel(f"{FORCE}, along the path")
        axes.legend(handles=keys, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return axes


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
        axes = _single(axes)
        for curve, answer, colour in zip(data, model, colours(len(data)), strict=True):
            label = f"model, {answer.label}"
            axes.plot(np.asarray(answer.x), np.asarray(answer.stress), color=colour, label=label)
            axes.plot(np.asarray(curve.x), np.asarray(curve.stress), label=curve.label, **DOTS)
        axes.set(xlabel=POSITION, ylabel=SQUEEZE)
        if data:
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


def _many(count: int) -> np.ndarray:
    """A new figure's axes (count,), in rows of up to three."""
    columns = 2 if count == 4 else min(count, 3)
    rows = -(-count // columns)
    figure, grid = plt.subplots(rows, columns, figsize=(3.8 * columns, 3.0 * rows), squeeze=False)
    for spare in grid.ravel()[count:]:
        figure.delaxes(spare)
    return grid.ravel()[:count]


def _checked_panels(
    history: History, panels: Sequence[str] | None, reference: Mapping[str, Any]
) -> list[str]:
    fields = history.scene.model.fields
    needs = {"gap": "w", "beta": "beta"} | dict.fromkeys(
        ("squeeze_stress", "psi", "squeeze_couple"), "psi"
    )
    known = [name for name in PROFILES if name not in needs or needs[name] in fields]
    if history.scene.contact.normal == "none":
        known.remove("reaction")
    if history.scene.model.squeeze == "assumed":
        known.remove("squeeze_couple")
    for key, names in (("panels", panels or ()), ("reference", reference)):
        for name in names:
            if name not in known:
                raise InputError(f"{key}: there is no {name!r} in {', '.join(known)}")
    return known if panels is None else list(panels)


def _contact_ends(history: History) -> np.ndarray:
    """X at which the contact ends, (steps+1,); NaN where it does not end before L, or failed."""
    if "w" not in history.scene.model.fields or history.scene.contact.normal == "none":
        return np.full(history.force.shape, np.nan)
    ends, failed = np.asarray(history.contact_end), np.isnan(np.asarray(history.force))
    return np.where(failed | (ends >= float(history.x[-1])), np.nan, ends)


def _surroundings(history: History, ends: np.ndarray) -> tuple[float, float]:
    """Part of X where something happens, or all of it if that is more than half."""
    contact, length = history.scene.contact, float(history.x[-1])
    tables = [np.asarray(p)[:, 0] for p in (contact.pressure, contact.bottom_pressure) if p.ndim]
    places = np.concatenate([*tables, ends])
    inner = places[(places > 0.0) & (places < length)]
    if inner.size == 0:
        return 0.0, length
    reach = AROUND * float(history.scene.strip.half_height)
    low, high = max(inner.min() - reach, 0.0), min(inner.max() + reach, length)
    return (low, high) if high - low < 0.5 * length else (0.0, length)


def _pressure_corners(history: History, part: Any) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a part of the pressure on the top face, from end to end."""
    table, length = np.asarray(history.scene.contact.pressure), float(history.x[-1])
    if table.ndim == 0:
        return np.array([0.0, length]), np.full(2, float(part) * table)
    x = np.concatenate([[0.0], table[:, 0], [length]])
    return x, float(part) * np.pad(table[:, 1], 1, mode="edge")


def _size(history: History, name: str) -> float:
    """What a profile is large or small against."""
    strip = history.scene.strip
    stress = float(history.scene.contact.largest_pressure)
    strain, half = stress / float(strip.plane_modulus), float(strip.half_height)
    strains = {"gap": strain * half, "beta": strain, "psi": strain}
    return strains.get(name, stress * half**2 if name == "squeeze_couple" else stress)


def _show(panel: Axes, lines: Sequence[Line2D], low: float, high: float, size: float) -> None:
    """Show a part of X, as high as the lines are there, but no rounding errors."""
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


def _checked_steps(history: History, steps: Sequence[int]) -> list[int]:
    count = history.force.shape[0]
    for step in steps:
        if not -count <= step < count:
            raise InputError(f"steps: {step} is not on the path, whose steps are 0 to {count - 1}")
    return [int(step) % count for step in steps]


def _default_steps(history: History) -> list[int]:
    force, pressed = np.asarray(history.force), history.pressed
    if not history.cycles:
        if pressed + 1 == force.size:
            return _four_steps(-1, pressed)
        turns = turning_points(force)[1:]
        return turns if len(turns) > 1 else _four_steps(pressed, turns[0])
    start, turn, stop = history.cycles[-1]
    chosen = []
    for first, last in ((start, turn), (turn, stop)):
        if force[first] * force[last] < 0.0:
            chosen.append(first + int(np.argmin(np.abs(force[first : last + 1]))))
        chosen.append(last)
    return chosen


def _default_contact_steps(history: History) -> list[int]:
    if history.cycles:
        return [history.pressed, *history.cycles[-1][1:]]
    last = history.force.size - 1
    return _four_steps(-1, last) if history.pressed == last else [last]


def _four_steps(start: int, stop: int) -> list[int]:
    """Up to four steps after the start, the last one being the stop."""
    steps = np.linspace(start, stop, 5)[1:].round().astype(int)
    return sorted(set(np.maximum(steps, start + 1).tolist()))


def _load_label(history: History, step: int) -> str:
    """The load of a step, and at a zero crossing which way it was going."""
    force, part = float(history.force[step]), float(history.pressure[step])
    if history.pressed + 1 == history.force.size:
        return f"{100.0 * part:.3g} % of $F_N$"
    if step <= history.pressed or abs(force) > 1e-9 * float(
        np.nanmax(np.abs(np.asarray(history.force)))
    ):
        load = f"$F = {force:.4g}$"
        return load if part == 1.0 else f"{load}, {100.0 * part:.3g} % of $F_N$"
    return "$F = 0$, " + ("rising" if force > float(history.force[step - 1]) else "falling")

"""Pictures of a strip or a lap joint as it deforms, with its pressures and its contact."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from jbeamshell.plotting.shapes import KINDS, Shape, pressure_arrows, reach_of, shape_of
from jbeamshell.plotting.steps import checked_steps, default_contact_steps, load_label
from jbeamshell.plotting.style import (
    DATA,
    FAINT,
    FORCE,
    MOMENT,
    PALETTE,
    POSITION,
    SLIPS,
    STICKS,
    below,
    given_axes,
    looks,
    panels,
    single,
    style,
    unit_words,
)

HEAD, SHANK = 0.45, 0.5  # height of a bolt's head over a plate, width of its shank over its patch
LOOKS: tuple[tuple[str, Any], ...] = ((STICKS, "-"), (SLIPS, "-"), ("0.55", ":"))  # of KINDS
FILL = ("#E8EEF4", "#F4EFE6")  # upper and lower member


def deformed(
    history: Any,
    step: int | None = None,
    axes: Axes | None = None,
    *,
    scale: float | None = None,
    sections: int = 0,
) -> Axes:
    """Draw the deformed members with their pressures, and where the contact sticks, slips or lifts.

    Bolts of a lap joint are drawn as bolts, heads as wide as their patches.

    Displacements along X are counted from the pressed members, as u(L) is.
    Overhangs of a lap joint are beams without shear from the contact's ends to theirs.

    Parameters
    ----------
    history : jbeamshell.History
        Solved load path of a strip or of a lap joint.
    step : int, optional
        Index into the path; the end of the last cycle when not given.
    axes : matplotlib.axes.Axes, optional
        Where to draw; new axes when not given.
    scale : float, optional
        Factor of the displacements; when not given, one that makes them visible.
    sections : int
        Number of cross-sections to draw, dark where the contact slips.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn into, with X and heights in the units of the scene.

    Raises
    ------
    InputError
        If there is no such step.
    """
    last = history.cycles[-1][2] if history.cycles else history.force.size - 1
    (step,) = checked_steps(history, [last if step is None else step])
    drawn = shape_of(history, step, scale)
    with style():
        axes = single(axes)
        axes.grid(False)
        for outline, fill in zip(drawn.outlines, FILL, strict=False):
            axes.fill(*outline.T, facecolor=fill, edgecolor=DATA, linewidth=0.8)
        _draw_supports(axes, history, drawn.heights[-1])
        if history.scene.member.support != "none" and history.scene.contact.bolts is not None:
            _draw_bolts(axes, history, drawn)
        else:
            _draw_pressures(axes, history, drawn)
        _draw_sections(axes, history, step, drawn, sections)
        _draw_contact(axes, history, drawn)
        force = float(history.force[step])
        if abs(force) > 0.0:
            size = drawn.tip[0] - min(outline[:, 0].min() for outline in drawn.outlines)
            start = (drawn.tip[0] + 0.02 * size, drawn.tip[1] - 0.5 * drawn.heights[0])
            stop = (start[0] + 0.09 * size, start[1])
            ends = (stop, start) if force > 0.0 else (start, stop)
            axes.annotate("", *ends, arrowprops={"arrowstyle": "-|>", "color": DATA})
        axes.set(xlabel=POSITION, ylabel="height  [length]", xlim=reach_of(history, 0.04, 0.12))
        times = f"{drawn.factor:.0f}" if drawn.factor >= 10.0 else f"{drawn.factor:.3g}"
        axes.set_title(f"{load_label(history, step)}, displacements x {times}")
        keys = [
            Line2D([], [], color=colour, linestyle=line, linewidth=3.0, label=name)
            for name, (colour, line) in zip(KINDS, LOOKS, strict=True)
        ]
        below(axes, keys)
    return axes


def lap_joint(history: Any, step: int | None = None, axes: Any = None) -> np.ndarray:
    """Draw a lap joint with its bolts, its loop, and slip and pressure over its length.

    The loop is that of the last cycle, less the displacement F/K of its secant stiffness, so that
    its width is seen.
    Slip and pressure are those of the pressed joint and of both turns of the last cycle.  Slip is
    drawn where the members touch; thin lines are the relative displacement where they are open.

    Parameters
    ----------
    history : jbeamshell.History
        Solved load path of a lap joint.
    step : int, optional
        Step at which the members are drawn; the end of the last cycle when not given.
    axes : array_like of matplotlib.axes.Axes, optional
        Four axes; a new figure when not given.

    Returns
    -------
    ndarray of matplotlib.axes.Axes
        The axes drawn into, in the shape they came in, or (2, 2).

    Raises
    ------
    InputError
        If there is no such step, or there are not four axes.
    """
    chosen, x = default_contact_steps(history), np.asarray(history.x)
    with style():
        grid = panels(2, 2) if axes is None else given_axes(axes, 4, "a lap joint")
        members, hysteresis, slip, pressure = grid.ravel()
        deformed(history, step, members)
        _draw_thin_loop(hysteresis, history)
        for step, look in zip(chosen, looks(len(chosen)), strict=True):
            touching = np.asarray(history.touching[step])
            values = np.asarray(history.slip[step])
            pressed = step <= history.pressed
            label = "pressed" if pressed else load_label(history, step)
            pressure.plot(x, np.asarray(history.reaction[step]), **look, label=label)
            if not pressed:
                slip.plot(x, values, color=look["color"], linewidth=0.6)
                slip.plot(x, np.where(touching, values, np.nan), **look, label=label)
        slip.set(title="slip", xlabel=POSITION, ylabel="$v - v_p$  [length]")
        pressure.set(title="contact pressure", xlabel=POSITION, ylabel="$R$  [stress]")
        usual = max(float(np.max(history.reaction[chosen[0]])), 1e-300)
        pressure.set_ylim(-0.05 * usual, 1.6 * usual)  # peaks where corners touch go beyond
        for panel in (slip, pressure):
            panel.legend(loc="best")
    return grid


def _draw_thin_loop(axes: Axes, history: Any) -> None:
    """Last loop without the displacement of its secant stiffness."""
    force, displacement = map(np.asarray, history.loop)
    moment = history.scene.load.kind == "moment"
    left = displacement - force / float(history.secant_stiffness)
    axes.plot(left - 0.5 * (left[0] + left[-1]), force, color=PALETTE[0], linewidth=1.8)
    x, y = ("rotation - $M/K$  [rad]", MOMENT) if moment else ("$u(L) - F/K$  [length]", FORCE)
    axes.set(title="loop, less its stiffness", xlabel=x, ylabel=unit_words(history, y))
    axes.xaxis.set_major_locator(MaxNLocator(5))


def _draw_supports(axes: Axes, history: Any, bottom: float) -> None:
    """Rigid base, symmetry plane, and the faces that are held or guided."""
    scene = history.scene
    support, top = scene.member.support, 2.0 * float(scene.strip.half_height)
    if support == "rolling":
        axes.axhline(bottom, color=DATA, linewidth=0.9, linestyle="-.")
    elif support == "none" and scene.contact.normal != "none":
        axes.axhline(0.0, color=DATA, linewidth=1.0)
    held = support != "none" or scene.strip.far_end != "free"
    if held:
        face = (bottom, 0.0) if support != "none" else (0.0, top)
        first = 0.0 if scene.member.overhang is None else -float(scene.member.overhang)
        axes.plot([first, first], face, color=DATA, linewidth=3.5, solid_capstyle="butt")
    if scene.member.loaded_end == "level":
        end = float(history.x[-1])
        end += 0.0 if scene.strip.overhang is None else float(scene.strip.overhang)
        axes.plot([end, end], [0.0, top], color=DATA, linewidth=2.5, linestyle=(0, (1, 1)))


def _draw_bolts(axes: Axes, history: Any, drawn: Shape) -> None:
    """Bolts through the members: heads on the outer faces, and shanks."""
    x, (top, bottom) = np.asarray(history.x), drawn.heights
    upper, lower = drawn.outer
    size = HEAD * top
    alone = history.scene.member.support == "rolling"  # whose lower face is a symmetry plane
    for place, _, width in np.asarray(history.scene.contact.bolts).tolist():
        ends = [float(np.interp(place, x, face[:, 1])) for face in (upper, lower)]
        half = 0.5 * SHANK * width
        for side in (-half, half):
            look: dict[str, Any] = {"linewidth": 0.8, "linestyle": (0, (4, 2)), "zorder": 2}
            axes.plot([place + side] * 2, ends, color=FAINT, **look)
        for end, way in zip(ends, (1.0, -1.0), strict=True):
            if way > 0.0 or not alone:
                corners = [(-0.5, 0.0), (0.5, 0.0), (0.5, way), (-0.5, way)]
                points = np.array([(place + a * width, end + b * size) for a, b in corners])
                axes.fill(*points.T, facecolor="0.75", edgecolor=DATA, linewidth=0.8)
    axes.update_datalim([(0.0, top + 1.6 * size), (0.0, bottom - (not alone) * 1.6 * size)])
    axes.autoscale_view()


def _draw_pressures(axes: Axes, history: Any, drawn: Shape) -> None:
    """Arrows of the pressures on the outer faces."""
    for place, head, tail in pressure_arrows(history, drawn):
        look = {"arrowstyle": "->", "color": FAINT, "linewidth": 0.8}
        axes.annotate("", (place, head), (place, tail), arrowprops=look)
    axes.update_datalim([(0.0, 1.7 * height) for height in drawn.heights])
    axes.autoscale_view()


def _draw_sections(axes: Axes, history: Any, step: int, drawn: Shape, count: int) -> None:
    """Cross-sections of each member at evenly spaced nodes, dark where the contact slips."""
    x = np.asarray(history.x)
    nodes = np.unique(np.abs(x[:, None] - np.linspace(x[0], x[-1], count)).argmin(axis=0))
    slips = np.asarray(history.slipping[step])[nodes]
    widths, shades = np.where(slips, 1.2, 0.6), np.where(slips, DATA, FAINT)
    for faces in zip(drawn.inner, drawn.outer, strict=True):
        lines = np.stack([face[nodes] for face in faces], axis=1)
        axes.add_collection(LineCollection(list(lines), colors=list(shades), linewidths=widths))


def _draw_contact(axes: Axes, history: Any, drawn: Shape) -> None:
    """Contact face in the colours of what its nodes do."""
    if history.scene.contact.normal == "none":
        return
    points = drawn.inner[0]
    middle = 0.5 * (points[1:] + points[:-1])
    begin = np.concatenate([points[:1], middle])
    end = np.concatenate([middle, points[-1:]])
    for kind, (colour, line) in enumerate(LOOKS):
        parts = np.stack([begin, points, end], axis=1)[drawn.kinds == kind]
        axes.add_collection(
            LineCollection(parts, colors=colour, linestyles=line, linewidths=3.0, zorder=3)
        )

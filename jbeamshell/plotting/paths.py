"""Pictures of a load path: its loop, and its profiles along X."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from jbeamshell.plotting.steps import checked_steps, default_steps, load_label
from jbeamshell.plotting.style import (
    DATA,
    DISPLACEMENT,
    FAINT,
    FORCE,
    MOMENT,
    PALETTE,
    POSITION,
    ROTATION,
    given_axes,
    looks,
    panels,
    single,
    style,
    unit_words,
)

SLIPPED: dict[str, Any] = {"marker": "o", "linestyle": "", "markersize": 3.2}


def loop(history: Any, axes: Axes | None = None, *, moment: bool = False) -> Axes:
    """Draw end force over end displacement, with the last closed cycle emphasised.

    Parameters
    ----------
    history : jbeamshell.History or jbeamshell.ContactHistory
        Solved load path.
    axes : matplotlib.axes.Axes, optional
        Where to draw; new axes when not given.
    moment : bool
        True if the load is a moment, and its displacement a rotation.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn into.
    """
    with style():
        axes = single(axes)
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
        labels = (ROTATION, MOMENT) if moment else (DISPLACEMENT, FORCE)
        axes.set(xlabel=labels[0], ylabel=unit_words(history, labels[1]))
        axes.xaxis.set_major_locator(MaxNLocator(5))  # their numbers may be long
        axes.legend(loc="upper left")
    return axes


def profiles(
    history: Any, steps: Sequence[int] | None = None, axes: ArrayLike | None = None
) -> np.ndarray:
    """Draw slip, rotation, friction traction and normal reaction along X at chosen steps.

    Parameters
    ----------
    history : jbeamshell.History
        Solved load path.
    steps : sequence of int, optional
        Indices into the path: 0 is its first step, -1 its end. When not given: the zero crossings
        and turning points of the last cycle, or four steps of a path without a cycle.
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
    Traction is divided by mu F_N and the reaction by F_N, the largest pressure along X. Without
    friction the traction itself is shown. Dots mark the nodes that slipped in the step.
    """
    chosen = checked_steps(history, default_steps(history) if steps is None else steps)
    contact = history.scene.contact
    pressure = float(contact.largest_pressure)
    cap = float(contact.friction) * pressure
    squeezes = "psi" in history.scene.plan.fields
    with style():
        grid = panels(2, 2, sharex=True) if axes is None else given_axes(axes, 4, "profiles")
        slip, rotation, traction, reaction = grid.ravel()
        x = np.asarray(history.x)
        for step, look in zip(chosen, looks(len(chosen)), strict=True):
            slip.plot(x, np.asarray(history.slip[step]), **look)
            rotation.plot(x, np.asarray(history.beta[step]), **look)
            if squeezes:
                change = np.asarray(history.psi[step] - history.psi[history.pressed])
                rotation.plot(x, change, **look, linewidth=0.7)
            moving, share = np.asarray(history.slipping[step]), np.asarray(history.traction[step])
            share = share / cap if cap > 0.0 else share
            traction.plot(x, share, **look, label=load_label(history, step))
            traction.plot(x[moving], share[moving], **SLIPPED, color=look["color"])
            reaction.plot(x, np.asarray(history.reaction[step]) / pressure, **look)
        varies = contact.pressure.ndim > 0
        over = r"\max F_N" if varies else "F_N"
        slip.set(title="slip", ylabel="$v - v_p$  [length]")
        rotation.set(title="rotation", ylabel=r"$\beta$  [rad]")
        share_of = rf"$t\,/\,\mu {over}$" if cap > 0.0 else "$t$  [stress]"
        traction.set(title="friction traction", ylabel=share_of)
        reaction.set(title="normal reaction", ylabel=rf"$R\,/\,{over}$")
        if squeezes:
            rotation.set(title="rotation and squeeze strain")
            rotation.set_ylabel(r"$\beta$  [rad],  $\psi - \psi_p$")
            kinds = [Line2D([], [], color=DATA), Line2D([], [], color=DATA, linewidth=0.7)]
            rotation.legend(kinds, [r"$\beta$", r"$\psi - \psi_p$"], loc="best")
        for panel in grid.ravel():
            panel.set(xlabel=POSITION)
        _name_dots(traction)
    return grid


def contact_lines(
    history: Any, steps: Sequence[int] | None = None, axes: ArrayLike | None = None
) -> np.ndarray:
    """Draw slip, gap, friction traction and normal reaction of substructures along X.

    Parameters
    ----------
    history : jbeamshell.ContactHistory
        Contact between substructures.
    steps : sequence of int, optional
        Indices into the path. When not given: the pressing and the turns of the last cycle.
    axes : array_like of matplotlib.axes.Axes, optional
        Four axes; a new figure when not given.

    Returns
    -------
    ndarray of matplotlib.axes.Axes
        The axes drawn into, in the shape they came in, or (2, 2).

    Raises
    ------
    InputError
        If a step lies outside the path, or there are not four axes.
    """
    turns = history.cycles[-1][1:] if history.cycles else (-1,)
    chosen = checked_steps(history, (0, *turns) if steps is None else steps)
    x = np.asarray(history.places)
    names = {"slip": "slip  [length]", "gap": "gap  [length]"}
    names |= {"traction": "friction traction  [stress]", "reaction": "normal reaction  [stress]"}
    with style():
        grid = panels(2, 2, sharex=True) if axes is None else given_axes(axes, 4, "profiles")
        for panel, (name, title) in zip(grid.ravel(), names.items(), strict=True):
            values = np.asarray(getattr(history, name))
            for step, look in zip(chosen, looks(len(chosen)), strict=True):
                label = f"$F = {float(history.force[step]):.4g}$" if step else "pressed"
                panel.plot(x, values[step], **look, label=label)
                moving = np.asarray(history.slipping[step])
                if name == "traction":
                    panel.plot(x[moving], values[step][moving], **SLIPPED, color=look["color"])
            panel.set(title=title, xlabel=POSITION)
        _name_dots(grid.ravel()[2])
    return grid


def _name_dots(panel: Axes) -> None:
    """Legend of the lines of a panel, and of the dots of what slips."""
    handles, labels = panel.get_legend_handles_labels()
    dot = Line2D([], [], color=DATA, **SLIPPED)
    panel.legend([*handles, dot], [*labels, "slips"], loc="best")

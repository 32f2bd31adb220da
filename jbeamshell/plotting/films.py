"""Films of a cycle: what deforms, sticks and slips, beside the loop with a moving point."""

from __future__ import annotations

import base64
import io
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from jbeamshell.common.errors import InputError
from jbeamshell.common.files import written_whole
from jbeamshell.plotting.joints import deformed
from jbeamshell.plotting.paths import loop
from jbeamshell.plotting.shapes import visible_scale
from jbeamshell.plotting.steps import checked_steps
from jbeamshell.plotting.style import (
    DATA,
    FAINT,
    PANEL,
    POSITION,
    SLIPS,
    STICKS,
    below,
    close,
    style,
)

MOST_FRAMES = 48
SHADES = 64  # colours of a film
DPI = 100
SECTIONS = 24  # cross-sections that are drawn


class Film:
    """Pictures of one figure, one after the other.

    In a notebook it shows itself; `save` writes a GIF.

    Attributes
    ----------
    figure : figure that is drawn again for every frame
    frames : steps of the load path, one for each frame
    """

    def __init__(
        self, figure: Figure, frames: Sequence[int], draw: Callable[[int], None], seconds: float
    ) -> None:
        self.figure, self.frames = figure, list(frames)
        self._draw, self._seconds = draw, seconds

    def still(self, frame: int = 0) -> Figure:
        """Figure of one frame, such as for a paper."""
        with style():
            self._draw(self.frames[frame])
            self.figure.canvas.draw()
        return self.figure

    def gif(self, dpi: float = DPI) -> bytes:
        """Film as the bytes of a GIF that repeats itself."""
        canvas = FigureCanvasAgg(self.figure)
        self.figure.set_dpi(dpi)
        images = []
        for frame in range(len(self.frames)):
            self.still(frame)
            images.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB"))
        palette = images[-1].quantize(SHADES, Image.Quantize.FASTOCTREE)
        pages = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in images]
        out, pause = io.BytesIO(), int(1000.0 * self._seconds / len(pages))
        pages[0].save(
            out, format="GIF", save_all=True, append_images=pages[1:], duration=pause, loop=0
        )
        return out.getvalue()

    def save(self, path: str | os.PathLike[str], dpi: float = DPI) -> None:
        """Write a GIF, whole or not at all.

        Raises
        ------
        InputError
            if the name does not end in .gif, or the file cannot be written
        """
        if Path(path).suffix.lower() != ".gif":
            raise InputError(f"{path}: a film is a GIF: end the name in .gif")
        pages = self.gif(dpi)
        with written_whole(path) as draft:
            Path(draft).write_bytes(pages)

    def _repr_html_(self) -> str:
        text = base64.b64encode(self.gif()).decode()
        close(self.figure)
        return f'<img alt="a cycle" src="data:image/gif;base64,{text}">'


def animate(
    history: Any,
    steps: Sequence[int] | None = None,
    *,
    scale: float | None = None,
    seconds: float = 4.0,
) -> Film:
    """Film of a cycle: the deformed strip or joint, and the loop with a moving point.

    Of substructures, which have no shape of their own, the friction traction along X takes the
    place of the deformed members.

    Parameters
    ----------
    history : jbeamshell.History or jbeamshell.ContactHistory
        Solved load path.
    steps : sequence of int, optional
        Steps of the path, one for each frame; up to 48 of the last cycle when not given, or of the
        whole path if it has none.
    scale : float, optional
        Factor of the displacements; when not given, one that makes them visible.
    seconds : float
        Duration.

    Returns
    -------
    Film
        To be shown in a notebook or written with its method `save`.

    Raises
    ------
    InputError
        If a step lies outside the path.

    Examples
    --------
    >>> jb.solve(jb.Scene()).animate().save("cycle.gif")
    """
    if steps is None:
        first, _, last = history.cycles[-1] if history.cycles else (0, 0, history.force.size - 1)
        steps = range(first, last + 1, -(-(last - first + 1) // MOST_FRAMES))
    chosen = checked_steps(history, steps)
    with style():
        figure = plt.figure(figsize=(2.2 * PANEL[0], PANEL[1]))
        left, right = figure.subplots(1, 2, width_ratios=(1.8, 1.0))
        if hasattr(history, "fields"):  # a strip or a lap joint
            turns, draw_left = history.scene.load.kind == "moment", _members(history, scale)
        else:
            turns, draw_left = False, _traction(history)
        loop(history, right, moment=turns).legend().remove()
        look = {"color": SLIPS, "markeredgecolor": DATA, "markersize": 7}
        point = right.plot([], [], "o", zorder=4, **look)[0]

    def draw(step: int) -> None:
        point.set_data([history.displacement[step]], [history.force[step]])
        left.clear()
        draw_left(step, left)

    film = Film(figure, chosen, draw, seconds)
    close(figure)  # a notebook shows the film, not its last frame beside it
    return film


def _members(history: Any, scale: float | None) -> Callable[[int, Axes], object]:
    """Function that draws the deformed members at a step, all steps to one scale."""
    factor = visible_scale(history) if scale is None else scale
    return lambda step, axes: deformed(history, step, axes, scale=factor, sections=SECTIONS)


def _traction(history: Any) -> Callable[[int, Axes], object]:
    """Function that draws the friction traction at a step in the colours of the contact."""
    x, traction = np.asarray(history.places), np.asarray(history.traction)
    most = 1.1 * float(np.nanmax(np.abs(traction)))

    def draw(step: int, axes: Axes) -> None:
        slips, touches = (np.asarray(a[step]) for a in (history.slipping, history.touching))
        sticks = touches & ~slips
        axes.vlines(x, 0.0, traction[step], color=FAINT, linewidth=0.8)
        axes.plot(x[sticks], traction[step][sticks], "o", color=STICKS, label="sticks")
        axes.plot(x[slips], traction[step][slips], "s", color=SLIPS, label="slips")
        axes.plot(x[~touches], 0.0 * x[~touches], "x", color=FAINT, label="is lifted")
        axes.set(xlabel=POSITION, ylabel="friction traction  [stress]", ylim=(-most, most))
        axes.set_title(f"$F = {float(history.force[step]):.4g}$")
        below(axes, axes.get_legend_handles_labels()[0])

    return draw

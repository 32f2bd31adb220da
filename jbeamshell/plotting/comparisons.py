"""Picture of a comparison of models: energy over amplitude, and its error."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from jbeamshell.plotting.style import DOTS, FAINT, looks, mark_decades, panels, style

ALONG = {"force": "amplitude of $F$  [force/width]", "displacement": "amplitude of $u$  [length]"}


def comparison(compared: Any, axes: Any = None) -> tuple[Axes, Axes]:
    """Draw the energy per cycle of each model over the amplitude, and its error.

    Parameters
    ----------
    compared : models fitted to one target, as `jbeamshell.identify.compare` gives them
    axes : two axes; new ones when not given

    Returns
    -------
    tuple of matplotlib.axes.Axes
        energies, and errors in per cent
    """
    with style():
        if axes is None:
            axes = panels(1, 2)[0]
        energies, errors = axes
        x = compared.amplitude
        drawn = [row for row in compared.rows if row.fit is not None]
        for row, look in zip(drawn, looks(len(drawn)), strict=True):
            told = f"{row.name}: {row.numbers} numbers, {1e6 * row.seconds:.0f} us"
            positive = np.where(row.energy > 0.0, row.energy, np.nan)  # a stuck law loses nothing
            energies.plot(x, positive, **look, label=told)
            errors.plot(x, 100.0 * compared.error(row), **look, label=row.name)
        energies.plot(x, compared.energy, label="target", **DOTS)
        errors.axhline(0.0, color=FAINT, linewidth=1.0, zorder=1.0)
        largest = max((float(np.max(np.abs(compared.error(row)))) for row in drawn), default=0.0)
        energies.set(xscale="log", yscale="log", ylabel="$D$, work per cycle  [force]")
        errors.set(xscale="log", ylabel="error of $D$  [%]")
        if largest > 0.5:
            errors.set_yscale("symlog", linthresh=1.0)
        for panel in (energies, errors):
            panel.set_xlabel(ALONG[compared.drive])
            mark_decades(panel.xaxis)
        energies.legend(loc="upper left")
    return energies, errors

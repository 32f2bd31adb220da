"""Pictures of steady responses: amplitude, and superharmonics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from jbeamshell.plotting.style import PALETTE, beside, looks, panels, style

AMPLITUDE = "amplitude  [length]"
FREQUENCY = "frequency  [1/time]"
DEPTH = 1e-6  # smallest superharmonic shown, over the largest amplitude


def forced_response(response: Any, *, label: str = "", axes: Sequence[Axes] | None = None) -> Any:
    """Draw the amplitude over frequency, and all harmonics beside it, on two axes.

    Parameters
    ----------
    response : result of `jbeamshell.dynamics.forced_response`
    label : words of the legend, such as the level of the force
    axes : two axes; a new figure when not given
    """
    x = np.asarray(response.frequency)
    amplitudes = np.asarray(response.harmonic_amplitudes)
    with style():
        pair = panels(1, 2)[0] if axes is None else axes
        first = amplitudes[:, 0]
        colour = PALETTE[len(pair[0].lines) % len(PALETTE)] if label else PALETTE[0]
        pair[0].plot(x, first, color=colour, label=label or None)
        kinds = looks(amplitudes.shape[1])
        for number, row, look in zip(response.harmonics, amplitudes.T, kinds, strict=True):
            pair[1].plot(x, row, **look, label=f"harmonic {number}")
        top = float(first.max())
        pair[0].set(xlabel=FREQUENCY, ylabel=AMPLITUDE)
        pair[1].set(xlabel=FREQUENCY, ylabel=AMPLITUDE, yscale="log", ylim=(DEPTH * top, 2.0 * top))
        if label:
            pair[0].legend()
        if len(pair[1].get_lines()) == amplitudes.shape[1]:
            beside(pair[1])
    return pair

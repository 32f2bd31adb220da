"""Steps of a load path that pictures show unless told otherwise, and their labels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from jbeamshell.common.errors import InputError
from jbeamshell.numerics.cycles import turning_points


def checked_steps(history: Any, steps: Sequence[int]) -> list[int]:
    """Indices counted from the start of the path; raises `InputError` for one that lies outside."""
    count = history.force.shape[0]
    for step in steps:
        if not -count <= step < count:
            raise InputError(f"steps: {step} is not on the path, whose steps are 0 to {count - 1}")
    return [int(step) % count for step in steps]


def default_steps(history: Any) -> list[int]:
    """Zero crossings and turning points of the last cycle; without one, turns or four steps."""
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


def default_contact_steps(history: Any) -> list[int]:
    """Pressed strip and turning points of the last cycle; without one, the end of the path."""
    if history.cycles:
        return [history.pressed, *history.cycles[-1][1:]]
    last = history.force.size - 1
    return _four_steps(-1, last) if history.pressed == last else [last]


def _four_steps(start: int, stop: int) -> list[int]:
    """Up to four steps after the start; the last one is the stop."""
    steps = np.linspace(start, stop, 5)[1:].round().astype(int)
    return sorted(set(np.maximum(steps, start + 1).tolist()))


def load_label(history: Any, step: int) -> str:
    """Label of a step: its load, and at a zero crossing whether the load rises or falls."""
    force, part = float(history.force[step]), float(history.pressure[step])
    if history.pressed + 1 == history.force.size:
        return f"{100.0 * part:.3g} % of $F_N$"
    if step <= history.pressed or abs(force) > 1e-9 * float(
        np.nanmax(np.abs(np.asarray(history.force)))
    ):
        load = f"$F = {force:.4g}$"
        return load if part == 1.0 else f"{load}, {100.0 * part:.3g} % of $F_N$"
    return "$F = 0$, " + ("rising" if force > float(history.force[step - 1]) else "falling")

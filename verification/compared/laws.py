"""Friction laws: dependence on the number of load steps, and drift under one-sided cycles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import jbeamshell as jb
from verification.compared.strips import number, scene_of

LAWS: dict[str, dict[str, Any]] = {
    "sharp": {"contact.smoothing": "sharp"},
    "elastic slip, m = 16": {"contact.smoothing": 16.0},
    "smooth cap, m = 16": {"contact.law": "smooth-cap", "contact.smoothing": 16.0},
    "tanh of the increment": {"contact.law": "tanh-increment"},
}
SHARE, CLIMB = 0.3, 10  # of the amplitude to which one-sided cycles return; steps to the first


def dissipations(
    name: str, law: str, steps: Sequence[int], nodes: int = 81
) -> list[tuple[float | None, float | None]]:
    """Work of friction and loop area of the last cycle, for numbers of steps per half cycle.

    None is where a step found no equilibrium.
    """
    found = []
    for count in steps:
        scene = scene_of(name, nodes, steps_per_half_cycle=count).replace(LAWS[law])
        history = jb.solve(scene, throw=False)
        found.append((number(history.dissipation), number(history.dissipation_loop)))
    return found


def drift(name: str, law: str, cycles: int = 50, nodes: int = 81) -> float | None:
    """Change of the largest displacement per one-sided cycle, as a part of it.

    The load goes to and fro between the amplitude and a part of it, in one step each way.
    """
    scene = scene_of(name, nodes).replace(LAWS[law])
    amplitude = float(scene.load.amplitude)
    climb = np.arange(1, CLIMB + 1) / CLIMB
    path = amplitude * np.concatenate([climb, np.tile([SHARE, 1.0], cycles)])
    history = jb.solve(scene, path, throw=False)
    peaks = np.asarray(history.displacement)[-1 - 2 * (cycles - 1) :: 2]
    return number(abs(peaks[-1] - peaks[0]) / abs(peaks[0]) / (cycles - 1))

"""Climb of the ladder: errors of the rungs from solving a scene off the map on each of them.

The error of a rung is its difference from the highest rung that was solved, plus the last change
for the rungs beyond.  The error of a grid and a load path is the change when both are halved.  The
errors of rungs that a scene does not have stay unknown: a laminate has no section of order p.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np

from jbeamshell.common.checks import require
from jbeamshell.common.errors import DoubtfulWarning, InputError, UnconvergedError
from jbeamshell.mechanics.elements import ORDER
from jbeamshell.quasistatic.load_path import check
from jbeamshell.quasistatic.solver import compile_for, solve
from jbeamshell.scene.scene import Scene

UPWARDS = ("squeeze", "p2", "p3", "p4", "p6")
CHEAP = ("bar", "masing", "shell")
LEAST_NODES = 11
FINER = 4.0  # ratio of the times of the fine and the coarse grid: twice the nodes and the steps


class Option(NamedTuple):
    """Rung on a grid, with its cost and its error.

    Attributes
    ----------
    rung : name of the rung
    settings : dotted values of the model for `Scene.replace`
    error : estimated relative error
    ms : time of a warm run [ms]
    """

    rung: str
    settings: dict[str, Any]
    error: float
    ms: float


def climb(
    scene: Scene, tolerance: float, quantity: str, tell: Callable[[str], None]
) -> tuple[list[Option], str]:
    """Options for a scene, from solving it on one rung after the other.

    Parameters
    ----------
    scene : scene whose kinematics, grid family and finest resolution are kept
    tolerance : relative error at which the climb may stop
    quantity : name of a figure of `History.figures`
    tell : called with the name and the nodes of each rung that is solved

    Returns
    -------
    options : rungs with their errors and times, the lowest rungs first
    note : rungs that were solved, and errors that are not included
    """
    fine, coarse = _resolution(scene, 1), _resolution(scene, 2)
    runs: dict[tuple[str, bool], tuple[dict[str, Any], float]] = {}

    def run(rung: str, finely: bool) -> float:
        if (rung, finely) not in runs:
            tell(f"{rung} on {(fine if finely else coarse)['model.nodes']} nodes")
            settings = {"model.rung": rung} | (fine if finely else coarse)
            runs[rung, finely] = _solved(scene.replace(settings))
        value = runs[rung, finely][0].get(quantity)
        return np.nan if value is None else value

    climbed: list[str] = []
    change = np.inf
    for rung in UPWARDS:
        if not _has(scene, rung, coarse):
            continue
        climbed.append(rung)
        value = run(rung, False)
        if len(climbed) == 1:
            _check_quantity(quantity, runs[rung, False][0])
        else:
            change = _off(run(climbed[-2], False), value)
        if 2.0 * change <= 0.3 * tolerance:
            break
    best = run(climbed[-1], False)
    alone = len(climbed) == 1
    beyond = 0.0 if alone else change
    note = f"solved on {', '.join(climbed)}"
    if alone:
        note += "; the scene has no rung above, so the section's own error is not in the estimate"
    # The error of grid and path is about the same on every rung: take that of the cheapest.
    grid = _off(best if alone else run(climbed[0], False), run(climbed[0], True))
    options = []
    for rung in (*CHEAP, *climbed):
        if rung not in climbed and not _has(scene, rung, coarse):
            continue
        own = _off(run(rung, False), best) + beyond
        options.append(
            Option(rung, {"model.rung": rung} | coarse, own + 2.0 * grid, runs[rung, False][1])
        )
        ms = runs[rung, True][1] if (rung, True) in runs else FINER * runs[rung, False][1]
        options.append(Option(rung, {"model.rung": rung} | fine, own + grid, ms))
    return options, note


def _resolution(scene: Scene, part: int) -> dict[str, Any]:
    """Dotted values of the scene's own grid and load path, or of one coarser by a whole factor."""
    order = ORDER[scene.model.grid]
    elements = max((scene.model.nodes - 1) // part // order, LEAST_NODES // order)
    half = max(scene.load.steps_per_half_cycle // part // 2, 1)
    return {"model.nodes": elements * order + 1, "load.steps_per_half_cycle": 2 * half}


def _has(scene: Scene, rung: str, resolution: dict[str, Any]) -> bool:
    """True if a scene can be solved on a rung."""
    try:
        check(scene.replace({"model.rung": rung} | resolution))
    except InputError:
        return False
    return True


def _solved(scene: Scene) -> tuple[dict[str, Any], float]:
    """Figures of a scene, none if it has no equilibrium, and the time of its warm run [ms]."""
    compile_for(scene)
    begin = time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DoubtfulWarning)  # the climb estimates the errors
            history = jax.block_until_ready(solve(scene))
    except UnconvergedError:
        return {}, np.inf  # such a rung is never chosen; the others may be
    return history.figures(), 1e3 * (time.perf_counter() - begin)


def _check_quantity(quantity: str, figures: dict[str, Any]) -> None:
    names = ", ".join(name for name, value in figures.items() if isinstance(value, float))
    fix = f"figures of this scene are {names}"
    require("quantity", quantity, not figures or quantity in names.split(", "), fix)


def _off(value: float, reference: float) -> float:
    """Relative difference; infinite if one of the values is missing."""
    if not np.isfinite(value) or not np.isfinite(reference):
        return np.inf
    return abs(value - reference) / abs(reference) if reference else float(value != reference)

"""The ladder climbed on the scene itself, where no map knows it.

A rung's error is what the rungs above it change, twice the last change standing for those beyond;
the error of a grid and a load path is what halving both changes.  Nothing is known of rungs that
the scene does not have: a laminate has no section of order p.
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
FINER = 4.0  # times the work: twice the nodes and twice the steps


class Option(NamedTuple):
    """A rung on its grid, with what it costs and how far off it is.

    Attributes
    ----------
    rung : its name
    settings : dotted values that make the scene's model this one
    error : estimated relative error
    ms : time of a warm run
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
    scene : whose kinematics, grid family and finest resolution are kept
    tolerance : relative error at which the climb may stop
    quantity : name of a figure of `History.figures`
    tell : called with what is being solved

    Returns
    -------
    options : cheapest rungs first
    note : what the estimate rests on, and what it does not know
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
    # What the grid and the path do is much the same on every rung: the cheapest of them tells.
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
    """The scene's own grid and load path, or a part of it."""
    order = ORDER[scene.model.grid]
    elements = max((scene.model.nodes - 1) // part // order, LEAST_NODES // order)
    half = max(scene.load.steps_per_half_cycle // part // 2, 1)
    return {"model.nodes": elements * order + 1, "load.steps_per_half_cycle": 2 * half}


def _has(scene: Scene, rung: str, resolution: dict[str, Any]) -> bool:
    """Whether a scene can be solved on a rung."""
    try:
        check(scene.replace({"model.rung": rung} | resolution))
    except InputError:
        return False
    return True


def _solved(scene: Scene) -> tuple[dict[str, Any], float]:
    """Figures of a scene, none where it has no equilibrium, and the time of its warm run in ms."""
    compile_for(scene)
    begin = time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DoubtfulWarning)  # the climb finds out by itself
            history = jax.block_until_ready(solve(scene))
    except UnconvergedError:
        return {}, np.inf  # no rung to choose, and no reason to give up the others
    return history.figures(), 1e3 * (time.perf_counter() - begin)


def _check_quantity(quantity: str, figures: dict[str, Any]) -> None:
    names = ", ".join(name for name, value in figures.items() if isinstance(value, float))
    fix = f"figures of this scene are {names}"
    require("quantity", quantity, not figures or quantity in names.split(", "), fix)


def _off(value: float, reference: float) -> float:
    """Relative difference; infinite where there is none."""
    if not np.isfinite(value) or not np.isfinite(reference):
        return np.inf
    return abs(value - reference) / abs(reference) if reference else float(value != reference)

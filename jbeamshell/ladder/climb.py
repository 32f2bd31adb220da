"""Climb of the ladder: errors of the rungs from solving a scene off the map on each of them.

Where a scene can be solved as plane elasticity, the error of a rung is its difference from that.
Elsewhere it is the difference from the highest rung that was solved, plus the last change for the
rungs beyond; the error of a grid and a load path is then the change when both are halved.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError
from jbeamshell.mechanics.elements import ORDER
from jbeamshell.quasistatic.solver import compile_for, solve
from jbeamshell.scene.linearisation import linear_error
from jbeamshell.scene.load_path import check
from jbeamshell.scene.rungs import PLANE_NODES
from jbeamshell.scene.scene import Scene

PLANE = "plane"
UPWARDS = ("squeeze", "p2", "p3", "p4", "p6")
CHEAP = ("bar", "masing", "shell")
LEAST_NODES = 11
REPEATS, QUICK = 3, 0.05  # runs of less than so many seconds; on a busy machine one may wait
FINER = 4.0  # ratio of the times of the fine and the coarse grid: twice the nodes and the steps


class Option(NamedTuple):
    """Rung on a grid, with its cost and its error.

    Attributes
    ----------
    rung : name of the rung
    settings : dotted values of the model for `Scene.replace`
    error : estimated relative error
    ms : time of a warm run [ms]
    doubted : True if its run doubts itself, see `jbeamshell.History.doubts`
    """

    rung: str
    settings: dict[str, Any]
    error: float
    ms: float
    doubted: bool = False


def climb(
    scene: Scene, tolerance: float, allowed: float, quantity: str, tell: Callable[[str], None]
) -> tuple[list[Option], str]:
    """Options for a scene, from solving it on one rung after the other.

    Parameters
    ----------
    scene : scene whose kinematics, grid family and finest resolution are kept
    tolerance : relative error at which the climb may stop
    allowed : ``model.tolerance`` of the runs, for their doubts
    quantity : name of a figure of `History.figures`
    tell : called with the name and the nodes of each rung that is solved

    Returns
    -------
    options : rungs with their errors and times, the lowest rungs first
    note : rungs that were solved, and errors that are not included
    """
    runs = _Runs(scene, allowed, quantity, tell)
    if runs.has(PLANE):
        return _against_elasticity(runs, tolerance), "solved as plane elasticity"
    climbed, change = _climbed(runs, tolerance)
    lowest, highest = climbed[0], climbed[-1]
    note = f"solved on {', '.join(climbed)}"
    if len(climbed) == 1:
        change = 0.0
        note += "; the scene has no rung above, so the section's own error is not in the estimate"
    best = runs.value(highest)
    # The error of grid and path is about the same on every rung: take that of the cheapest.
    grid = _off(runs.value(lowest), runs.value(lowest, 1))
    options = []
    for rung in (*CHEAP, *climbed):
        if rung in climbed or runs.has(rung):
            own = _off(runs.value(rung), best) + change
            for fine, grids in ((0, 2.0), (1, 1.0)):
                options.append(runs.option(rung, fine, own + grids * grid))
    return options, note


def _against_elasticity(runs: _Runs, tolerance: float) -> list[Option]:
    """Options of a scene that can be solved as plane elasticity."""
    linear = linear_error(runs.scene_on(PLANE))
    for coarse, fine in ((0, 1), (1, 2)):
        best = runs.value(PLANE, fine)
        grid = _off(runs.value(PLANE, coarse), best)  # the error falls at least as the nodes double
        if grid + linear <= tolerance:
            break
    options = [
        runs.option(PLANE, coarse, 2.0 * grid + linear),
        runs.option(PLANE, fine, grid + linear),
    ]
    for rung in filter(runs.has, ("bar", "squeeze", "shell")):
        error = _off(runs.value(rung), best) + grid
        options.append(runs.option(rung, 0, error))
        if error > tolerance and rung != "bar":
            break  # a section without squeeze is further off
    return options


class _Runs:
    """Runs of a scene on rungs with a coarse grid (0) or a finer one, solved when first used."""

    def __init__(
        self, scene: Scene, allowed: float, quantity: str, tell: Callable[[str], None]
    ) -> None:
        self._scene, self._allowed, self._quantity, self._tell = scene, allowed, quantity, tell
        self._resolutions = _resolution(scene, 2), _resolution(scene, 1)
        self._runs: dict[tuple[str, int], tuple[dict[str, Any], float]] = {}

    def settings(self, rung: str, grid: int = 0) -> dict[str, Any]:
        """Dotted values of the model."""
        if rung == PLANE:
            nodes = {"model.nodes": (PLANE_NODES - 1) // 2 * 2**grid + 1}
        else:
            nodes = self._resolutions[grid]
        own = {"model.rung": rung} | nodes
        kinematics = self._scene.replace(own).model.kinematics  # for the scene's own tolerance
        return own | {"model.kinematics": kinematics, "model.tolerance": self._allowed}

    def scene_on(self, rung: str) -> Scene:
        """Scene on a rung."""
        return self._scene.replace(self.settings(rung))

    def has(self, rung: str) -> bool:
        """True if the scene can be solved on a rung."""
        try:
            check(self.scene_on(rung))
        except InputError:
            return False
        return True

    def value(self, rung: str, grid: int = 0) -> float:
        """Figure of the scene; NaN if it has no equilibrium.

        Raises
        ------
        InputError
            if the first run has no such figure
        """
        if (rung, grid) not in self._runs:
            settings = self.settings(rung, grid)
            self._tell(f"{rung} on {settings['model.nodes']} nodes")
            run = self._runs[rung, grid] = _solved(self._scene.replace(settings))
            if len(self._runs) == 1:
                _check_quantity(self._quantity, run[0])
        value = self._runs[rung, grid][0].get(self._quantity)
        return np.nan if value is None else value

    def option(self, rung: str, grid: int, error: float) -> Option:
        """Option with an error; on a grid that was not solved it has no doubts."""
        run = self._runs.get((rung, grid))
        doubted = run is not None and bool(run[0].get("doubts"))
        return Option(rung, self.settings(rung, grid), error, self.ms(rung, grid), doubted)

    def ms(self, rung: str, grid: int) -> float:
        """Time of a warm run [ms]; on a fine grid that was not solved, from that on the coarse."""
        if (rung, grid) not in self._runs:
            return FINER * self._runs[rung, grid - 1][1]
        return self._runs[rung, grid][1]


def _climbed(runs: _Runs, tolerance: float) -> tuple[list[str], float]:
    """Rungs up to the first that changes little, and its relative change."""
    climbed: list[str] = []
    change = np.inf
    for rung in filter(runs.has, UPWARDS):
        value = runs.value(rung)
        if climbed:
            change = _off(runs.value(climbed[-1]), value)
        climbed.append(rung)
        if 2.0 * change <= 0.3 * tolerance:
            break
    return climbed, change


def _resolution(scene: Scene, part: int) -> dict[str, Any]:
    """Dotted values of the scene's own grid and load path, or of one coarser by a whole factor."""
    order = ORDER[scene.model.grid]
    elements = max((scene.model.nodes - 1) // part // order, LEAST_NODES // order)
    half = max(scene.load.steps_per_half_cycle // part // 2, 1)
    return {"model.nodes": elements * order + 1, "load.steps_per_half_cycle": 2 * half}


def _solved(scene: Scene) -> tuple[dict[str, Any], float]:
    """Figures of a scene, none if it has no equilibrium, and the time of its warm run [ms]."""
    compile_for(scene)
    least = np.inf
    for _ in range(REPEATS):
        begin = time.perf_counter()
        # Without a word of doubts, because the climb estimates the errors.
        history = jax.block_until_ready(solve(scene, throw=False))
        least = min(least, time.perf_counter() - begin)
        if least > QUICK:
            break
    if not history.converged:
        return {}, np.inf  # such a rung is never chosen; the others may be
    return history.figures(), 1e3 * least


def _check_quantity(quantity: str, figures: dict[str, Any]) -> None:
    names = ", ".join(name for name, value in figures.items() if isinstance(value, float))
    fix = f"figures of this scene are {names}"
    require("quantity", quantity, not figures or quantity in names.split(", "), fix)


def _off(value: float, reference: float) -> float:
    """Relative difference; infinite if one of the values is missing."""
    if not np.isfinite(value) or not np.isfinite(reference):
        return np.inf
    return abs(value - reference) / abs(reference) if reference else float(value != reference)

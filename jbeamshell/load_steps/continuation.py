"""Continuation of a load path from the end of another."""

from __future__ import annotations

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError, warn_of_doubts
from jbeamshell.history.history import History
from jbeamshell.load_steps.outcome import check_solver, history_of, raise_if_failed
from jbeamshell.load_steps.path_state import PathState, StepResults
from jbeamshell.load_steps.recovery import recover, rows
from jbeamshell.load_steps.stepping import compiled_march
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.load_path import LoadPath, check, closed_cycles_of
from jbeamshell.scene.plan import STEPS
from jbeamshell.scene.scene import Scene


class PathEnd(eqx.Module):
    """End of a load path that was walked step by step, from which another path can go on.

    Attributes
    ----------
    state : state after the last step
    """

    state: PathState

    def continued(
        self,
        history: History,
        path: ArrayLike | None = None,
        *,
        solver: Newton | None = None,
        throw: bool = True,
    ) -> History:
        """History with further load steps, equal to that of both paths solved as one.

        It is equal to the last bit if both paths have two load steps or more, else to round-off.

        Parameters
        ----------
        history : history that ends here
        path : further loads, see `jbeamshell.solve`; None is the scene's own cycles once more, for
            which the last load must be the amplitude
        solver, throw : see `jbeamshell.solve`

        Raises
        ------
        InputError
            if the last step found no equilibrium, or the path is invalid
        UnconvergedError
            if a step has no equilibrium, even if it is walked in smaller steps
        """
        check_solver(solver)
        if not bool(self.state.converged):
            raise InputError("history: its last step found no equilibrium: go on from one that did")
        scene, solver = history.scene, solver or Newton()
        pressing = scene.load.pressure_steps
        further = further_path(scene, float(self.state.target), path)
        # A single step would be compiled without a loop and rounded differently.
        count = further.target.size
        padding = 0, max(2 - count, 0)
        padded: LoadPath = jax.tree.map(lambda a: np.pad(a, padding, mode="edge"), further)
        steps = compiled_march(scene, self.state, padded, solver)
        if not np.asarray(steps.state.converged)[count - 1]:
            steps = recover(scene, steps, padded, solver, self.state)
            if throw:
                raise_if_failed(scene, rows(steps, np.s_[:count]), further, history.force.size)
        tail = rows(_steps_of(history_of(scene, steps, padded.pressure)), np.s_[:count])
        columns = jax.tree.map(lambda a, b: jnp.concatenate([a, b]), _steps_of(history), tail)
        loads, parts = (np.asarray(columns[name])[pressing:] for name in ("target", "pressure"))
        last = pressing - 1
        closed = closed_cycles_of(loads, parts)
        cycles = tuple((a + last, b + last, c + last) for a, b, c in closed)
        end = PathEnd(rows(steps.state, count - 1))
        result = dataclasses.replace(history, **columns, end=end, cycles=cycles)
        if throw:
            warn_of_doubts(result.doubts, stacklevel=3)
        return result


def further_path(scene: Scene, last: float, path: ArrayLike | None) -> LoadPath:
    """Loads that follow the last one; None is the scene's own cycles once more."""
    whole, _ = check(scene, path)
    first = scene.load.pressure_steps
    if path is None:
        amplitude = float(scene.load.amplitude)
        require("path", None, scene.load.cycles > 0, "the scene has no cycles: give the loads")
        fix = f"the last load is {last:.6g}, not load.amplitude = {amplitude:.6g}: give the loads"
        require("path", None, last == amplitude, fix)
        first += max(scene.plan.steps // 2, 1)
    further: LoadPath = jax.tree.map(lambda column: np.asarray(column)[first:], whole)
    return further


def with_end(history: History, steps: StepResults) -> History:
    """History with the end of its path, if that was walked step by step."""
    if history.scene.plan.engine != STEPS:
        return history
    return dataclasses.replace(history, end=PathEnd(rows(steps.state, -1)))


def _steps_of(history: History) -> dict[str, Any]:
    """Fields of a history that have an entry for every step, by name."""
    others = {"scene", "cycles", "end", "middles", "x", "tributary", "load"}
    names = [field.name for field in dataclasses.fields(history) if field.name not in others]
    return {name: getattr(history, name) for name in names}

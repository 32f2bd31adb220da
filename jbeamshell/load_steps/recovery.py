"""Recovery of failed load steps: each is walked again in pieces."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jbeamshell.load_steps.path_state import PathState, StepResults
from jbeamshell.load_steps.stepping import compiled_march
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.load_path import LoadPath
from jbeamshell.scene.scene import Scene

PIECES = (8, 64)  # numbers of pieces of a failed load step, tried in this order


def recover(
    scene: Scene, steps: StepResults, path: LoadPath, solver: Newton, start: PathState
) -> StepResults:
    """Walk every failed step of a march in pieces, and go on from there.

    Parameters
    ----------
    scene, path, start : what was walked, see `march`
    steps : results, of which some are not converged
    solver : settings of Newton's method

    Returns
    -------
    StepResults
        unconverged from the first step on that fails in the smallest pieces too
    """
    count = path.target.size
    while not _converged(steps):
        first = int(np.argmin(np.asarray(steps.state.converged)))
        before = _rows(steps.state, first - 1) if first else start
        pieces = _walk_in_pieces(scene, before, _rows(path, first), solver)
        if pieces is None:
            return steps
        step = _rows(pieces, -1)._replace(
            slip_work=jnp.sum(pieces.slip_work),
            iterations=steps.iterations[first] + jnp.sum(pieces.iterations),
            slipping=jnp.any(pieces.slipping, axis=0),
        )
        # The path's end is repeated: with the shapes of the first march nothing compiles again.
        further = _rows(path, jnp.minimum(jnp.arange(count) + first + 1, count - 1))
        tail = _rows(compiled_march(scene, step.state, further, solver), np.s_[: count - first - 1])
        parts = _rows(steps, np.s_[:first]), _rows(step, None), tail
        steps = jax.tree.map(lambda *columns: jnp.concatenate(columns), *parts)
    return steps


def _rows(tree: Any, index: Any) -> Any:
    """Rows of a pytree's arrays (steps, ...), by an index of NumPy."""
    return jax.tree.map(lambda a: a[index], tree)


def _walk_in_pieces(
    scene: Scene, start: PathState, to: LoadPath, solver: Newton
) -> StepResults | None:
    """Results of a step in equal pieces; None if no number of pieces finds equilibrium."""
    for count in PIECES:
        part = jnp.arange(1, count + 1) / count
        path = LoadPath(
            start.target + part * (to.target - start.target),
            start.pressure + part * (to.pressure - start.pressure),
            jnp.full_like(part, to.rough),
        )
        pieces = compiled_march(scene, start, path, solver)
        if _converged(pieces):
            return pieces
    return None


def _converged(steps: StepResults) -> bool:
    """True if all steps found equilibrium."""
    return bool(steps.state.converged[-1])

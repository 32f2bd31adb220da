"""Steady cycles of a scene at several amplitudes of its end force."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced
from jbeamshell.common.errors import Status
from jbeamshell.common.failed import nan_unless
from jbeamshell.common.pytrees import Tree
from jbeamshell.scene.scene import Scene
from jbeamshell.solving.solve import run

CYCLE = np.array([1.0, -1.0, 1.0, -1.0, 1.0])  # the last two branches are the steady cycle


class SteadyCycles(Tree):
    """Steady cycles, per width.

    Attributes
    ----------
    force : (k,) amplitudes of the end force
    displacement : (k,) half the ranges of its displacement
    dissipation : (k,) work of friction in a cycle
    """

    force: Array
    displacement: Array
    dissipation: Array


def steady_cycles(scene: Scene, forces: ArrayLike) -> SteadyCycles:
    """Cycles of rising amplitude (k,), one after the other; NaN where traced ones do not converge.

    Raises
    ------
    UnconvergedError
        if a load step has no equilibrium
    """
    throw = not is_traced(scene, forces, jnp.zeros(()))
    levels = jnp.asarray(forces)
    history = run(scene, (levels[:, None] * CYCLE).ravel(), throw=throw)
    size = levels.size * CYCLE.size
    u, work = (
        each[-size:].reshape(levels.size, -1) for each in (history.displacement, history.slip_work)
    )
    half = 0.5 * jnp.abs(u[:, -1] - u[:, -2])
    sound = jnp.all(history.status == Status.CONVERGED)
    return SteadyCycles(levels, *nan_unless(sound, (half, jnp.sum(work[:, -2:], axis=1))))

"""Steady cycles of a scene at several amplitudes of its end force."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced
from jbeamshell.common.errors import Status, UnconvergedError
from jbeamshell.common.failed import nan_unless
from jbeamshell.common.pytrees import Tree
from jbeamshell.scene.scene import Scene
from jbeamshell.solving.response import response
from jbeamshell.solving.solve import NO_END, run

AMPLITUDE, FIGURES = "load.amplitude", ("secant_stiffness", "dissipation")
CYCLES = 2  # after the first loading, the last of which counts as steady
CYCLE = np.array([1.0, *[-1.0, 1.0] * CYCLES])  # turns of the load, over its amplitude


class SteadyCycles(Tree):
    """Steady cycles.

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
    """Cycles of rising amplitude (k,); NaN where traced ones do not converge.

    On the contact line each cycle starts from the strip as it was pressed.  Walked one after the
    other on a coarse grid, they would have errors that add up, to per cents where little is lost.
    Load steps have no such errors, and take them one after the other.

    Raises
    ------
    UnconvergedError
        if a load step has no equilibrium
    """
    throw = not is_traced(scene, forces, jnp.zeros(()))
    levels = jnp.asarray(forces)
    if scene.plan.on_contact_line:
        scene = scene.replace({AMPLITUDE: levels[-1], "load.cycles": CYCLES})
        grid = run(scene, throw=throw).scene  # refined, if the largest needs it
        own = response(grid, [AMPLITUDE], FIGURES)
        if throw:  # one compiled program serves all scenes of its kind
            found = jax.tree.map(lambda *one: jnp.stack(one), *map(own, np.asarray(levels)))
        else:
            found = lax.map(own, levels)
        sound = jnp.all(found["status"] == Status.CONVERGED)
        if throw and not sound:
            raise UnconvergedError(f"a cycle below the load {float(levels[-1]):.6g} has {NO_END}")
        return SteadyCycles(
            levels,
            *nan_unless(sound, (levels / found["secant_stiffness"], found["dissipation"])),
        )
    history = run(scene, (levels[:, None] * CYCLE).ravel(), throw=throw)
    size = levels.size * CYCLE.size
    u, work = (
        each[-size:].reshape(levels.size, -1) for each in (history.displacement, history.slip_work)
    )
    half = 0.5 * jnp.abs(u[:, -1] - u[:, -2])
    sound = jnp.all(history.status == Status.CONVERGED)
    return SteadyCycles(levels, *nan_unless(sound, (half, jnp.sum(work[:, -2:], axis=1))))

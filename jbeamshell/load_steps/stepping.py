"""March along a load path: one scan over the steps, each by Newton's method."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax

from jbeamshell.load_steps.load_step import guess_from_bar, newton_step
from jbeamshell.load_steps.path_state import PathState, StepResults
from jbeamshell.load_steps.system import System
from jbeamshell.load_steps.tangent import initial_stiffness
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.load_path import LoadPath
from jbeamshell.scene.scene import Scene


def march(scene: Scene, start: PathState, path: LoadPath, solver: Newton) -> StepResults:
    """March along a load path in one scan, each step from the slip that a bar would have.

    Parameters
    ----------
    scene : strip, contact, load and model
    start : state where the path starts
    path : what is prescribed, (steps,)
    solver : settings of Newton's method
    """
    system = System(scene)
    rough = initial_stiffness(system, 1.0)
    if system.ends_depend_on_friction:
        smooth = initial_stiffness(system, 0.0)

    def step(state: PathState, to: LoadPath) -> tuple[PathState, StepResults]:
        stiffness = rough
        if system.ends_depend_on_friction:
            stiffness = jax.tree.map(lambda a, b: jnp.where(to.rough > 0.0, a, b), rough, smooth)
        return newton_step(system, state, to, solver, guess_from_bar(system, state, to, stiffness))

    return lax.scan(step, start, path)[1]


compiled_march = eqx.filter_jit(march)

"""March along a load path: one scan over the steps, each by Newton's method."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jbeamshell.common.native import Program, one_call
from jbeamshell.load_steps.load_step import guess_from_bar, newton_step
from jbeamshell.load_steps.path_state import PathState, StepResults
from jbeamshell.load_steps.system import System
from jbeamshell.load_steps.tangent import initial_stiffness
from jbeamshell.mechanics.elements import ORDER
from jbeamshell.numerics import block_tridiagonal
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.load_path import LoadPath
from jbeamshell.scene.scene import Scene

POINTS = 2  # of an element of a small block, at which strains are computed
LARGEST_SUM = 4096  # numbers up to which the compiler (jaxlib 0.10) computes sums itself


def march(
    scene: Scene, start: PathState, path: LoadPath, solver: Newton, native: bool = False
) -> StepResults:
    """March along a load path in one scan.

    Parameters
    ----------
    scene : strip, contact, load and model
    start : state where the path starts
    path : what is prescribed, (steps,)
    solver : settings of Newton's method
    native : True compiles the loop over the steps to one native function, see `one_call`
    """
    call = one_call if native else _call
    steps: StepResults = call(_steps, System(scene), start, path, solver)
    return steps


def compiled_march(scene: Scene, start: PathState, path: LoadPath, solver: Newton) -> StepResults:
    """March along a load path by a compiled program, see `march`."""
    steps: StepResults = _compiled_march(scene, start, path, solver, native=fits_native(scene))
    return steps


_compiled_march = Program(march)


def fits_native(scene: Scene) -> bool:
    """True if the compiler makes one native function of the loop over the steps.

    It does for small blocks, as long as it gives no sum to a library.
    """
    plan = scene.plan
    size = ORDER[scene.model.grid] * len(plan.active)
    probes = 3 * size * POINTS * (plan.nodes - 1)  # values to find the stiffness
    return size <= block_tridiagonal.SMALL and probes <= LARGEST_SUM


def _call(function: Callable[..., Any], *arguments: Any) -> Any:
    return function(*arguments)


def _steps(system: System, start: PathState, path: LoadPath, solver: Newton) -> StepResults:
    """Steps by Newton's method, from the slip that a bar would have."""
    rough = initial_stiffness(system, 1.0)
    if system.ends_depend_on_friction:
        smooth = initial_stiffness(system, 0.0)

    def step(state: PathState, to: LoadPath) -> tuple[PathState, StepResults]:
        stiffness = rough
        if system.ends_depend_on_friction:
            stiffness = jax.tree.map(lambda a, b: jnp.where(to.rough > 0.0, a, b), rough, smooth)
        return newton_step(system, state, to, solver, guess_from_bar(system, state, to, stiffness))

    return lax.scan(step, start, path)[1]

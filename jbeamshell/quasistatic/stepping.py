"""Walk along a load path: one scan over the steps, each solved by one of two methods."""

from __future__ import annotations

import enum
import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array, lax

from jbeamshell.common.native import one_call
from jbeamshell.common.two_programs import TwoPrograms
from jbeamshell.mechanics.elements import ORDER
from jbeamshell.numerics import block_tridiagonal
from jbeamshell.numerics.newton import Newton
from jbeamshell.quasistatic import slip_patterns
from jbeamshell.quasistatic.load_step import guess_from_bar, newton_step
from jbeamshell.quasistatic.path_state import (
    PathState,
    StepResults,
    slipping_nodes,
    status_codes,
)
from jbeamshell.quasistatic.slip_patterns import Memory, StatusSteps
from jbeamshell.quasistatic.system import ContactResponse, LoadLevel, Prescribed, System
from jbeamshell.quasistatic.tangent import in_blocks, initial_stiffness
from jbeamshell.scene.load_path import LoadPath
from jbeamshell.scene.scene import Scene

POINTS = 2  # of an element of a small block, at which strains are computed
LARGEST_SUM = 4096  # numbers up to which the compiler (jaxlib 0.10) computes sums itself


class Method(enum.Enum):
    """Method that solves the steps of a load path.

    Attributes
    ----------
    NEWTON : Newton's method, whose result has derivatives.  Where status iteration applies it
        starts from the result of that, and its out-of-balance forces are by the assembled stiffness
    STATUS_ITERATION : stick-slip status iteration alone where it applies, else Newton's method.
        Newton's method is then not compiled and derivatives do not pass; a step that does not
        settle is marked unconverged, to be walked again by Newton's method
    UNCHECKED_STATUS_ITERATION : the same with the out-of-balance forces by the assembled stiffness;
        else they come from the strip's energy
    """

    NEWTON = "Newton"
    STATUS_ITERATION = "status iteration"
    UNCHECKED_STATUS_ITERATION = "unchecked status iteration"


def march(
    scene: Scene,
    start: PathState,
    path: LoadPath,
    solver: Newton,
    method: Method = Method.NEWTON,
    native: bool = False,
) -> StepResults:
    """Walk along a load path in one scan.

    Parameters
    ----------
    scene : strip, contact, load and model
    start : state where the path starts
    path : what is prescribed, (steps,)
    solver : settings of Newton's method
    method : method that solves the steps
    native : True compiles the loop over the steps to one native function, see `one_call`
    """
    system = System(scene)
    called = one_call if native else _call
    if not slip_patterns.applies(scene):
        marched: StepResults = called(_march_from_bar, system, start, path, solver)
        return marched
    if method is Method.NEWTON:
        found = called(slip_patterns.solve_path_by_newton, system, start, path, solver)
    else:
        found = called(slip_patterns.solve_path, system, start, path)
    checked = method is Method.STATUS_ITERATION
    return _results_of_statuses(system, start, path, solver, found, checked)


def compiled_march(
    scene: Scene, start: PathState, path: LoadPath, solver: Newton, method: Method
) -> StepResults:
    """Walk along a load path by a compiled program, see `march`."""
    native = fits_native(scene)
    steps: StepResults = _compiled_march(scene, start, path, solver, method, native=native)
    return steps


_compiled_march = TwoPrograms(march)


def fits_native(scene: Scene) -> bool:
    """True if the compiler makes one native function of the loop over the steps.

    It does for small blocks, as long as it gives no sum to a library.
    """
    model = scene.model
    size = ORDER[model.grid] * len(model.active)
    probes = 3 * size * POINTS * (model.nodes - 1)  # values to find the stiffness
    small = size <= block_tridiagonal.SMALL
    return small and (slip_patterns.applies(scene) or probes <= LARGEST_SUM)


def _call(function: Callable[..., Any], *given: Any) -> Any:
    return function(*given)


def _march_from_bar(
    system: System, start: PathState, path: LoadPath, solver: Newton
) -> StepResults:
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


def _results_of_statuses(
    system: System,
    start: PathState,
    path: LoadPath,
    solver: Newton,
    found: StatusSteps,
    checked: bool,
) -> StepResults:
    """Results of the steps; from the first that is not settled, all are unconverged."""
    memory = found.memory
    change = jnp.swapaxes(found.change, 1, 2)

    def move(
        at: tuple[Array, Array], to: tuple[LoadPath, Array]
    ) -> tuple[tuple[Array, Array], tuple]:
        rough, q = to[0].rough > 0.0, at[0] + system.embed(to[1])
        end = system.end_displacement(q)
        origin = jnp.where(rough, at[1], end)
        return (q, origin), (q, origin, end)

    q, origin, end = lax.scan(move, (start.level.q, start.origin), (path, change))[1]
    direction = jnp.tile(start.direction, (q.shape[0], 1))
    prescribed = Prescribed(path.target, path.pressure, origin, path.rough, direction)

    def reached(q: Array, memory: Memory, prescribed: Prescribed) -> LoadLevel:
        response = ContactResponse(memory.traction, jnp.zeros_like(system.x), memory.reaction)
        forces = system.elastic_forces(q, prescribed.pressure)
        force, _ = system.balance(forces, q, response, prescribed)
        return LoadLevel(q, memory.traction, memory.cap, memory.reaction, force)

    level = jax.vmap(reached)(q, memory, prescribed)
    before = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b[:-1]]), start.level, level)
    error = found.error
    if checked:
        # One after the other: the loop stays small enough for a single native function.
        each = (change, before, prescribed)
        error = lax.map(lambda at: jnp.max(jnp.abs(system.advance(*at)[1])), each)
    good = found.settled & (error <= solver.tolerance_for(system.x.dtype))
    converged = start.converged & (jnp.cumsum(~good) == 0)
    return StepResults(
        state=PathState(
            level=level,
            origin=origin,
            target=path.target,
            pressure=path.pressure,
            reversal=memory.reversal,
            change=jax.vmap(lambda c: in_blocks(c, start.change))(change),
            direction=direction,
            converged=converged,
        ),
        displacement=end - origin,
        slipping=jax.vmap(functools.partial(slipping_nodes, system))(before, level, path.rough),
        slip_work=found.slip_work,
        stored_energy=jax.vmap(system.stored_energy)(level, path.pressure),
        sinking=jax.vmap(system.sinking)(q),
        iterations=found.solves,
        error=error,
        status=status_codes(converged, jnp.append(start.converged, converged[:-1]), error),
    )

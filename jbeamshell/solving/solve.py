"""Solving a scene, from top to bottom.

1. A scene is planned when it is made, see `jbeamshell.scene.planning`; `_able` plans it anew if the
   path needs load steps.
2. `_walked` follows the path on the contact line, exactly in time (`jbeamshell.contact_line`);
   `_marched` takes load steps by Newton's method.
3. `_refined` halves the elements while the estimated error exceeds the tolerance.
4. `_overhung` solves a single lap anew whose scene leaves its overhangs open, to tell what they
   decide.
5. What may still be wrong is a doubt, see `jbeamshell.history.reliability`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jbeamshell.common.checks import as_leaf, is_staged, is_traced, require
from jbeamshell.common.errors import Status, UnconvergedError, warn_of_doubts
from jbeamshell.common.precision import in_double, is_single
from jbeamshell.common.progress import patience
from jbeamshell.common.small import Small
from jbeamshell.common.threads import on_one_core
from jbeamshell.contact_line.solve import Cycles, walks_pressures
from jbeamshell.contact_line.solve import solve as walk
from jbeamshell.contact_line.strip import Strip
from jbeamshell.history.history import History
from jbeamshell.history.reliability import change_of, misses_tolerance, ratio_of_losses
from jbeamshell.load_steps.outcome import ADVICE, check_solver, history_of, raise_if_failed
from jbeamshell.load_steps.path_state import StepResults, initial_state
from jbeamshell.load_steps.recovery import recover
from jbeamshell.load_steps.stepping import march
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.domain import stays_below
from jbeamshell.scene.load_path import LOADS, LoadPath, check, check_contact
from jbeamshell.scene.mounting import left_open
from jbeamshell.scene.planning import refinements
from jbeamshell.scene.scene import Scene
from jbeamshell.solving.advice import within

NO_END = (
    "no equilibrium: all of the contact slides, or its events come to no end; take a smaller "
    "load.amplitude, load.control = displacement, or other model.nodes"
)
SINGLE_NODES = 65  # of a section, up to which single precision leaves less than .5 % of D
SINGLE = (
    "single precision in a JAX transformation: the dissipation may be off by several per cent; "
    "write jax.config.update('jax_enable_x64', True) before anything is computed"
)


def solve(
    scene: Scene,
    path: ArrayLike | None = None,
    *,
    contact: ArrayLike | None = None,
    solver: Newton | None = None,
    throw: bool = True,
    tolerance: float | None = None,
    by: str | None = None,
) -> History:
    """Press the strip down, follow a load path, and return the history of all load steps.

    Settings that the scene leaves open are planned so that the dissipation, the loop and the secant
    stiffness are within ``model.tolerance`` of plane elasticity, where that can stand for the
    scene; `jbeamshell.advise` says what is planned and why.

    Parameters
    ----------
    scene : strip, contact, load and model; traced leaves pass, so `jax.grad` and `jax.vmap` work
    path : loads after the pressing, (steps,): F, u(L) or the arc length, by ``scene.load.control``;
        or (steps, 2) with the part of the pressures that acts in the second column, both of which
        change evenly from step to step; None is the scene's own cycles
    contact : (n,) True at the nodes in contact where the search of load steps for the contact
        starts; None starts with all of them
    solver : settings of Newton's method in load steps
    throw : True raises for a step without equilibrium and warns of doubts; False leaves both to
        ``history.status`` and ``history.doubts``
    tolerance : ``model.tolerance``, .0001 to .1; None is the scene's own
    by : "steps" solves in load steps by Newton's method, to check what the contact line says; None
        leaves it to the plan

    Returns
    -------
    History
        fields, forces and works at every step; steps without equilibrium hold NaN

    Raises
    ------
    InputError
        if the path is invalid or exceeds gross slip under force control
    UnconvergedError
        if a step has no equilibrium, even if it is taken in smaller steps

    Warns
    -----
    DoubtfulWarning
        if a converged result may still be wrong, see `jbeamshell.History.doubts`; never in a traced
        run, which has `jbeamshell.History.dissipation_error`

    Examples
    --------
    >>> history = jb.solve(jb.Scene(), tolerance=0.02)
    >>> float(history.dissipation)
    >>> print(history.scene.plan)
    """
    require("by", by, by in (None, "steps"), "choose None or 'steps'")
    with patience("solving"):
        scene = within(scene, tolerance)
        scene = scene if by is None else scene.by_load_steps()
        return run(scene, path, contact=contact, solver=solver, throw=throw)


@on_one_core
def run(
    scene: Scene,
    path: ArrayLike | None = None,
    *,
    contact: ArrayLike | None = None,
    solver: Newton | None = None,
    throw: bool = True,
    strip: Strip | None = None,
) -> History:
    """Run of a scene as it is planned; see `solve`.

    Parameters
    ----------
    scene, path, contact, solver, throw : see `solve`
    strip : strip of the scene on its contact line, if it is known
    """
    check_solver(solver)
    scene = _able(scene, path, contact)
    whole, cycles = check(scene, path)
    if scene.plan.on_contact_line:
        fix = "is found from the pressures on the contact line: leave it out"
        require("contact", "given", contact is None, fix)
        return _walked(scene, whole, cycles, throw, path is None, strip)
    touching = None if contact is None else check_contact(scene, contact)
    history = _marched(scene, whole, touching, solver or Newton(), throw).but(cycles=cycles)
    if throw and not is_traced(history):
        warn_of_doubts(history.doubts)
    return history


def _able(scene: Scene, path: ArrayLike | None, contact: ArrayLike | None) -> Scene:
    """Scene in load steps, if its section was left open or has them, and the path needs them.

    Where no pressure acts all nodes let go at once, which has no order of events.
    """
    require("scene", scene, isinstance(scene, Scene), "give a jbeamshell.Scene")
    line = contact is None
    if path is not None and (loads := as_leaf(path, "path", LOADS)).ndim > 1:
        vanish = not is_traced(loads) and not np.all(np.asarray(loads)[:, -1])
        line = line and walks_pressures(scene) and not vanish
    able = line or not scene.plan.on_contact_line or scene.model.section == "plane"
    return scene if able else scene.by_load_steps()


def _walked(
    scene: Scene,
    path: LoadPath,
    cycles: Cycles,
    throw: bool,
    own: bool,
    strip: Strip | None = None,
) -> History:
    """History on the contact line, on a grid that keeps the tolerance."""
    traced, by_force = is_traced(scene, path) or is_staged(), scene.load.control == "force"
    if traced and not _precise(scene):
        warn_of_doubts([SINGLE])

    def walked(scene: Scene, strip: Strip | None = None) -> History:
        return walk(scene, path, cycles, own=own, strip=strip).of_scene(scene)

    history = walked(scene, strip)
    if traced:
        failed = history.status[-1] != Status.CONVERGED
        return eqx.error_if(history, failed, f"a load step has {NO_END}") if throw else history
    if cycles and history.converged:
        history = _overhung(_refined(history, walked), path, own)
    if throw and not history.converged:
        step = int(np.argmax(np.asarray(history.status)))
        load = float(path.target[step]) * float(scene.wide if by_force else 1.0)
        raise UnconvergedError(f"load step {step} (load {load:.6g}) has {NO_END}")
    if throw:
        warn_of_doubts(history.doubts)
    return history


@in_double
def _marched(
    scene: Scene, path: LoadPath, touching: np.ndarray | None, solver: Newton, throw: bool
) -> History:
    """History in load steps; a failed step is taken again in pieces."""
    steps, history = _stepped((scene.in_one_form(), touching, path, np.asarray(True)), solver)
    history = history.of_scene(scene)
    if is_traced(steps):  # by its scene, or by a caller's jit around a scene of plain numbers
        converged = steps.state.converged[-1]
        message = f"a load step found no equilibrium: {ADVICE}"
        return eqx.error_if(history, ~converged, message) if throw else history
    if not np.asarray(steps.state.converged)[-1]:  # indexing a JAX array would compile
        steps = recover(scene, steps, path, solver, initial_state(scene, touching))
        if throw:
            raise_if_failed(scene, steps, path)
        history = history_of(scene, steps, path.pressure).of_scene(scene)
    return history


@Small
def _stepped(
    given: tuple[Scene, np.ndarray | None, LoadPath, np.ndarray], solver: Newton
) -> tuple[StepResults, History]:
    """Results and history of a load path, from the nodes in contact and True to follow it."""
    scene, touching, path, enabled = given
    start = initial_state(scene, touching)._replace(converged=jnp.asarray(enabled))
    steps = march(scene, start, path, solver)
    return steps, history_of(scene, steps, path.pressure)


def _refined(history: History, walked: Callable[[Scene], History]) -> History:
    """History on the first grid whose estimated error keeps the tolerance, or on the finest.

    Parameters
    ----------
    history : converged run on the planned grid
    walked : function that gives the same run of a scene on another grid
    """
    for _ in range(refinements(history.scene)):
        if not misses_tolerance(history):
            break
        finer = walked(history.scene.refined())
        if not finer.converged:
            break
        history = finer.but(change=change_of(history, finer))
    return history


def _overhung(history: History, path: LoadPath, own: bool) -> History:
    """History that knows what other overhangs make of a single lap that leaves them open.

    They are as long as the overlap, which is a body of its own, and bear the same forces.  A joint
    that slides as a whole under a displacement bears none that is known, and learns nothing.

    Parameters
    ----------
    history : converged run of a load path with cycles
    path, own : see `jbeamshell.contact_line.solve.solve`
    """
    scene = history.scene
    keys = left_open(scene)
    if not keys or not scene.contact.friction > 0.0:
        return history
    by_force = scene.load.control == "force"
    largest = float(np.max(np.abs(history.force)))
    slides = scene.member.bolt_stiffness is None and not stays_below(largest, scene.gross_slip, 1.0)
    if slides and not by_force:
        return history
    values: dict[str, Any] = dict.fromkeys(keys, scene.strip.length)
    values |= {"load.control": "force", "load.amplitude": np.asarray(largest)}
    forces = path._replace(target=history.force / scene.wide)
    longer = scene.pinned().replace(values)
    other = walk(longer, forces, history.cycles, own=own and by_force).of_scene(longer)
    return history.but(overhung=ratio_of_losses(other, history))


def _precise(scene: Scene) -> bool:
    """True if a transformation's precision is enough for a scene on its contact line."""
    few = scene.plan.nodes <= SINGLE_NODES and not scene.plan.elastic
    return few or not is_single(scene)

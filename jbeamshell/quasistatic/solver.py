"""Load paths: press a strip down, load it to and fro, a History out."""

from __future__ import annotations

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced
from jbeamshell.history.history import History
from jbeamshell.numerics.newton import Newton
from jbeamshell.quasistatic.continuation import with_end
from jbeamshell.quasistatic.load_path import LoadPath, check, check_contact, whole_path
from jbeamshell.quasistatic.masing import bar_cycles, masing
from jbeamshell.quasistatic.outcome import (
    ADVICE,
    check_solver,
    history_of,
    raise_if_failed,
    warn_of_doubts,
)
from jbeamshell.quasistatic.slip_patterns import Foresight
from jbeamshell.quasistatic.stepping import Steps, at_rest, march, recover
from jbeamshell.scene.scene import Scene

STACK = 3  # frames from a warning to whoever called `jbeamshell.solve`


def solve(
    scene: Scene,
    path: ArrayLike | None = None,
    *,
    contact: ArrayLike | None = None,
    solver: Newton | None = None,
    throw: bool = True,
) -> History:
    """Press the strip down, walk a load path, and report what happened.

    Parameters
    ----------
    scene : what is loaded; may hold traced leaves, so `jax.grad` and `jax.vmap` go through
    path : loads after the pressing, (steps,): F, u(L) or the way gone, by ``scene.load.control``;
        or (steps, 2) with the part of the pressures that acts in the second column; None is the
        scene's own cycles
    contact : (n,) nodes from which the search for the contact starts; None is all of them
    solver : settings of Newton's method
    throw : whether a step without equilibrium raises, and what is doubtful warns; if not, read
        ``history.status`` and ``history.doubts``

    Returns
    -------
    History
        steps without equilibrium hold NaN.

    Raises
    ------
    InputError
        if the path makes no sense or exceeds gross slip under force control
    UnconvergedError
        if a step has no equilibrium, even when it is walked in smaller steps

    Warns
    -----
    DoubtfulWarning
        if what converged may be wrong all the same, see `jbeamshell.History.doubts`; never in a
        traced run, whose estimate is `jbeamshell.History.dissipation_error`
    """
    check_solver(solver)
    solver = solver or Newton()
    whole, cycles = check(scene, path)
    touching = None if contact is None else check_contact(scene, contact)
    steps, history = _solve(scene, touching, whole, _first(scene, whole, solver), np.asarray(True))
    if is_traced(steps):  # by its scene, or by a caller's jit around a scene of plain numbers
        sound = steps.state.sound[-1]
        message = f"a load step found no equilibrium: {ADVICE}"
        history = eqx.error_if(history, ~sound, message) if throw else history
        return dataclasses.replace(history, cycles=cycles)
    if not np.asarray(steps.state.sound)[-1]:  # an index of JAX's would compile
        start = at_rest(scene, touching)
        if scene.model.solution == "stepwise":
            steps = recover(scene, steps, whole, solver, start)
        else:
            steps = masing(scene, start, whole, solver, recovering=True)
        if throw:
            raise_if_failed(steps, whole)
        history = with_end(history_of(scene, steps, whole.pressure), steps)
    history = dataclasses.replace(history, cycles=cycles)
    if throw:
        warn_of_doubts(history, stacklevel=STACK)
    return history


def compile_for(
    scene: Scene, path: ArrayLike | None = None, *, solver: Newton | None = None
) -> None:
    """Compile what `solve` needs, without solving anything."""
    whole, _ = whole_path(scene, path)
    first = _first(scene, whole, solver or Newton())
    jax.block_until_ready(_solve(scene, None, whole, first, np.asarray(False)))


def _first(scene: Scene, path: LoadPath, solver: Newton) -> Newton:
    """The solver of a first attempt: foresight, unless derivatives may be taken of it."""
    staged = is_traced(scene, path, jnp.zeros(()))  # the last by a caller's jit
    return solver if staged else Foresight.of(solver, checked=True)


@eqx.filter_jit
def _solve(
    scene: Scene,
    touching: np.ndarray | None,
    path: LoadPath,
    solver: Newton,
    enabled: ArrayLike,
) -> tuple[Steps, History]:
    start = at_rest(scene, touching)._replace(sound=jnp.asarray(enabled))
    if scene.model.solution == "closed-form":
        steps = bar_cycles(scene, path)
    elif scene.model.solution == "stepwise":
        steps = march(scene, start, path, solver)
    else:
        steps = masing(scene, start, path, solver)
    return steps, with_end(history_of(scene, steps, path.pressure), steps)

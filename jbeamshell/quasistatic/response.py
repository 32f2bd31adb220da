"""Figures of a scene's last cycle as a compiled function of some of its numbers."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.checks import check_words, is_traced, require, require_choice
from jbeamshell.common.errors import Status
from jbeamshell.common.native import Native
from jbeamshell.history.history import History
from jbeamshell.numerics.newton import Newton
from jbeamshell.quasistatic import slip_patterns
from jbeamshell.quasistatic.solver import solve
from jbeamshell.scene.keys import NUMBERS, check_key
from jbeamshell.scene.scene import Scene

Response = Callable[..., dict[str, Array]]

FEW = 200  # nodes: beyond, the arithmetic takes longer than calling it
RESPONSES = (
    "force",
    "displacement",
    *(n for n, value in inspect.getmembers(History) if isinstance(value, property) and n[0] != "_"),
)


def response(
    scene: Scene,
    over: Sequence[str],
    figures: Sequence[str] = ("dissipation",),
    *,
    solver: Newton | None = None,
) -> Response:
    """A pure function of some of a scene's numbers, for `jax.jit`, `jax.vmap` and `jax.grad`.

    Only what the figures need is computed, so that it costs less than `jbeamshell.solve`.  Called
    with numbers, and not in a transformation, it is one native function on a CPU where the compiler
    allows that: a strip of some dozen nodes takes less time than handing its parts to threads.

    Parameters
    ----------
    scene : what is not varied
    over : dotted keys of the numbers that are, in the order of the function's arguments
    figures : names of `jbeamshell.History`, such as "dissipation" or "secant_stiffness"
    solver : settings of Newton's method

    Returns
    -------
    Callable
        from the numbers to a dictionary of the figures and ``status``, the worst code of
        `jbeamshell.Status` on the way: a figure with another one than zero is NaN or not to be
        trusted.  Numbers are not checked: the domain is the caller's.

    Raises
    ------
    InputError
        if a key or a figure is unknown
    """
    require("scene", scene, isinstance(scene, Scene), "give a jbeamshell.Scene")
    check_words("over", over)
    check_words("figures", figures)
    for key in over:
        check_key(key)
        require("over", key, key in NUMBERS, "is no number of the scene: give it to the scene")
    for name in figures:
        require_choice("figures", name, RESPONSES)

    def asked(solver: Newton | None) -> Response:
        def answer(*values: Array) -> dict[str, Array]:
            history = solve(
                scene.replace(dict(zip(over, values, strict=True))), throw=False, solver=solver
            )
            found = {name: getattr(history, name) for name in figures}
            return found | {"status": jnp.max(history.status)}

        return answer

    compiled = jax.jit(asked(solver))
    if is_traced(scene):
        return compiled
    foresees = slip_patterns.applies(scene) and not isinstance(solver, slip_patterns.Foresight)
    quick = asked(slip_patterns.Foresight.of(solver, checked=True) if foresees else solver)
    first = Native(quick, worth=scene.model.nodes <= FEW)

    def ask(*values: Array) -> dict[str, Array]:
        found: dict[str, Array] | None = first.now(*values)
        if found is None or (foresees and np.asarray(found["status"]).item() != Status.CONVERGED):
            return compiled(*values)
        return found

    return ask

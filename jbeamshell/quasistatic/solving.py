"""Front door of the solver: a history from a scene, within a tolerance."""

from __future__ import annotations

from jax.typing import ArrayLike

from jbeamshell.common.checks import require
from jbeamshell.common.progress import patience
from jbeamshell.history.history import History
from jbeamshell.numerics.newton import Newton
from jbeamshell.quasistatic import solver as quasistatic
from jbeamshell.quasistatic.advice import within
from jbeamshell.scene.scene import Scene


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

    Settings that the scene leaves open are chosen so that the dissipation, the loop and the secant
    stiffness are within ``model.tolerance`` of plane elasticity, where that can stand for the
    scene; `jbeamshell.advise` says what is chosen and why.

    Parameters
    ----------
    scene, path, contact, solver, throw : see `jbeamshell.quasistatic.solver.solve`
    tolerance : ``model.tolerance``, .0001 to .1; None is the scene's own
    by : "steps" solves in load steps by Newton's method, to check what the contact line or a closed
        form says; None leaves it to the plan

    Returns
    -------
    History
        fields, forces and works at every step; steps without equilibrium hold NaN

    Raises
    ------
    InputError
        if the path is invalid or exceeds gross slip under force control
    UnconvergedError
        if a step has no equilibrium, even in smaller steps

    Warns
    -----
    DoubtfulWarning
        if a converged history may be wrong, see `jbeamshell.History.doubts`

    Examples
    --------
    ::

        history = jb.solve(jb.library.standard(), tolerance=0.02)
        history.dissipation, history.scene.plan
    """
    with patience("solving"):
        require("by", by, by in (None, "steps"), "choose None or 'steps'")
        scene = within(scene, tolerance) if by is None else within(scene, tolerance).by_load_steps()
        return quasistatic.solve(scene, path, contact=contact, solver=solver, throw=throw)

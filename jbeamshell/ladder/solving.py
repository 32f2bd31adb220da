"""Front door of the solver: a history from a scene, on request by the cheapest adequate model."""

from __future__ import annotations

from jax.typing import ArrayLike

from jbeamshell.common.checks import require
from jbeamshell.common.progress import patience
from jbeamshell.history.history import History
from jbeamshell.ladder.advice import advise
from jbeamshell.numerics.newton import Newton
from jbeamshell.quasistatic import solver as quasistatic
from jbeamshell.scene.scene import Scene


def solve(
    scene: Scene,
    path: ArrayLike | None = None,
    *,
    contact: ArrayLike | None = None,
    solver: Newton | None = None,
    throw: bool = True,
    tolerance: float | None = None,
) -> History:
    """Press the strip down, follow a load path, and return the history of all load steps.

    Parameters
    ----------
    scene, path, contact, solver, throw : see `jbeamshell.quasistatic.solver.solve`
    tolerance : largest relative error of the dissipation against plane elasticity, .005 to 1.  The
        scene's model is replaced by the cheapest one that `jbeamshell.advise` finds.  None keeps
        the scene's model

    Returns
    -------
    History
        fields, forces and works at every step; steps without equilibrium hold NaN

    Raises
    ------
    InputError
        if the path is invalid or exceeds gross slip under force control, or if no model is accurate
        enough
    UnconvergedError
        if a step has no equilibrium, even in smaller steps

    Warns
    -----
    DoubtfulWarning
        if a converged history may be wrong, see `jbeamshell.History.doubts`

    Examples
    --------
    ::

        history = jb.solve(jb.library.standard(), tolerance=0.05)
        history.dissipation, history.scene.model.rung
    """
    if tolerance is not None:
        fix = "a tolerance is for the scene's own cycles; leave the path out"
        require("path", "given", path is None, fix)
        scene = advise(scene, tolerance).applied(scene)
    with patience("solving"):
        return quasistatic.solve(scene, path, contact=contact, solver=solver, throw=throw)

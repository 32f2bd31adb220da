"""The front door: a scene in, a history out, with the cheapest model that keeps a tolerance."""

from __future__ import annotations

from jax.typing import ArrayLike

from jbeamshell.common.checks import require
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
    """Press the strip down, walk a load path, and report what happened.

    Parameters
    ----------
    scene, path, contact, solver, throw : see `jbeamshell.quasistatic.solver.solve`
    tolerance : largest relative error of the dissipation, against plane elasticity; the scene's
        model gives way to the cheapest that is estimated to keep it, see `jbeamshell.advise`.
        None keeps the scene's model.

    Returns
    -------
    History
        whose steps without equilibrium hold NaN

    Raises
    ------
    InputError
        if the path makes no sense or exceeds gross slip under force control, or if no model keeps
        the tolerance
    UnconvergedError
        if a step has no equilibrium, even when it is walked in smaller steps

    Warns
    -----
    DoubtfulWarning
        if what converged may be wrong all the same, see `jbeamshell.History.doubts`
    """
    if tolerance is not None:
        require("path", "given", path is None, "a tolerance is for the scene's own cycles")
        scene = advise(scene, tolerance).applied(scene)
    return quasistatic.solve(scene, path, contact=contact, solver=solver, throw=throw)

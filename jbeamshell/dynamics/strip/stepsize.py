"""Methods of time integration and their time steps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import numpy as np
from jax import Array

from jbeamshell.common.checks import POSITIVE, is_traced, require, require_choice, require_number
from jbeamshell.dynamics.strip.attached_masses import AttachedMasses
from jbeamshell.dynamics.strip.equations import Equations, movable
from jbeamshell.dynamics.strip.excitation import Excitation
from jbeamshell.dynamics.strip.inertia import Inertia
from jbeamshell.dynamics.strip.modes import first_period, highest_omega
from jbeamshell.scene.scene import Scene

STIFF: dict[str, Callable[..., Any]] = {
    "kvaerno3": diffrax.Kvaerno3,
    "kvaerno5": diffrax.Kvaerno5,
}
EXPLICIT: dict[str, Callable[[], Any]] = {
    "tsit5": diffrax.Tsit5,
    "bosh3": diffrax.Bosh3,
}
METHODS = ("midpoint", *STIFF, *EXPLICIT)
PER_PERIOD = 200  # default number of midpoint steps in the first period of the stuck strip
MARGIN = 0.9  # default step of explicit methods, over the stable one


def stable_step(
    scene: Scene,
    inertia: Inertia | None = None,
    attached: AttachedMasses | None = None,
    method: str = "tsit5",
) -> float:
    """Largest time step with which an explicit method is stable.

    The method's stability limit along the imaginary axis bounds vibrations, by the highest
    frequency of the stuck strip; its limit along the real axis bounds the relaxation of tractions,
    if there is friction.  Tractions of nodes that slip fast decay still faster, with the rate
    k_t abs(v_t) m/cap, which is not known beforehand: check `Motion.imbalance`.

    Parameters
    ----------
    scene, inertia, attached : see `simulate`
    method : "tsit5" or "bosh3"

    Raises
    ------
    InputError
        for another method, or a scene that has no equations of motion
    """
    inertia, attached = inertia or Inertia(), attached or AttachedMasses()
    require_choice("method", method, tuple(EXPLICIT))
    scene = movable(scene, inertia)
    vibration, decay = stability_limits(EXPLICIT[method]().tableau)
    limit = vibration / highest_omega(scene, inertia, attached)
    has_friction = float(scene.contact.friction) > 0.0 and scene.contact.normal != "none"
    if has_friction:
        limit = min(limit, decay * float(_relaxation_time(scene, inertia, attached)))
    return limit


def stability_limits(tableau: Any) -> tuple[float, float]:
    """Largest z for which abs(R) <= 1 on the segments up to i z and to -z, R of a tableau."""
    stages = len(tableau.b_sol)
    a = np.zeros((stages, stages))
    for i, row in enumerate(tableau.a_lower):
        a[i + 1, : i + 1] = row
    b, ones = np.asarray(tableau.b_sol), np.ones(stages)
    terms = [b @ np.linalg.matrix_power(a, k) @ ones for k in range(stages)]
    grid = np.linspace(0.0, 12.0, 24001)[1:]

    def limit(direction: complex) -> float:
        z = direction * grid
        growth = np.abs(1.0 + sum(c * z ** (k + 1) for k, c in enumerate(terms)))
        unstable = np.flatnonzero(growth > 1.0 + 1e-6)
        return float(grid[unstable[0] - 1]) if unstable.size and unstable[0] else float(grid[-1])

    return limit(1j), limit(-1.0)


@eqx.filter_jit
def _relaxation_time(scene: Scene, inertia: Inertia, attached: AttachedMasses) -> Array:
    return Equations(scene, inertia, attached, Excitation()).relaxation_time


def longest_step(
    scene: Scene, inertia: Inertia, attached: AttachedMasses, method: str, step: float | None
) -> float | None:
    """Largest time step to take; None if the solver chooses its steps."""
    if step is not None:
        require_number("step", step, POSITIVE + " (time)")
    if method in STIFF:
        fix = f"{method} chooses its own steps from the tolerance: leave it out"
        require("step", step, step is None, fix)
        return None
    if is_traced(scene, inertia, attached):
        fix = "has no default for a traced scene: give a number"
        require("step", step, step is not None, fix)
        return step
    if method == "midpoint":
        return step or first_period(scene, inertia, attached) / PER_PERIOD
    limit = stable_step(scene, inertia, attached, method)
    fix = f"is above the largest stable one of {method}, {limit:.6g}: take less, or the midpoint"
    require("step", step, step is None or step <= limit, fix)
    return step or MARGIN * limit

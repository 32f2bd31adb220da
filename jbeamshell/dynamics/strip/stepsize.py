"""Methods of time integration, and the steps they may take."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import numpy as np
from jax import Array

from jbeamshell.common.checks import POSITIVE, is_traced, require, require_choice, require_number
from jbeamshell.dynamics.strip.attached_masses import AttachedMasses
from jbeamshell.dynamics.strip.equations import Equations, check
from jbeamshell.dynamics.strip.excitation import Excitation
from jbeamshell.dynamics.strip.inertia import Inertia
from jbeamshell.dynamics.strip.modes import first_period, highest_frequency
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
PER_PERIOD = 200  # midpoint steps in the first period of the stuck strip, where no step is given
MARGIN = 0.9  # of the stable step, taken where none is given


def stable_step(
    scene: Scene,
    inertia: Inertia | None = None,
    attached: AttachedMasses | None = None,
    method: str = "tsit5",
) -> float:
    """Largest time step with which an explicit method stays stable.

    The method's stability limits along the imaginary axis (vibration, with the highest frequency of
    the stuck strip) and along the real one (a traction's relaxation); without friction the second
    does not count.  Points that slip fast have a faster decay of their own, k_t abs(v_t) m/cap,
    which no step known beforehand allows for: look at the energy left over.
    """
    inertia, attached = inertia or Inertia(), attached or AttachedMasses()
    require_choice("method", method, tuple(EXPLICIT))
    check(scene, inertia)
    vibration, decay = stability_limits(EXPLICIT[method]().tableau)
    limit = vibration / highest_frequency(scene, inertia, attached)
    rubs = float(scene.contact.friction) > 0.0 and scene.contact.normal != "none"
    if rubs:
        limit = min(limit, decay * float(_relaxation(scene, inertia, attached)))
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
        beyond = np.flatnonzero(growth > 1.0 + 1e-6)
        return float(grid[beyond[0] - 1]) if beyond.size and beyond[0] else float(grid[-1])

    return limit(1j), limit(-1.0)


@eqx.filter_jit
def _relaxation(scene: Scene, inertia: Inertia, attached: AttachedMasses) -> Array:
    return Equations(scene, inertia, attached, Excitation()).relaxation


def longest_step(
    scene: Scene, inertia: Inertia, attached: AttachedMasses, method: str, step: float | None
) -> float | None:
    """The constant step to take; None where the solver chooses."""
    if step is not None:
        require_number("step", step, POSITIVE + " (time)")
    if method in STIFF:
        require("step", step, step is None, f"{method} chooses its own from the tolerance")
        return None
    if is_traced(scene, inertia, attached):
        fix = "a traced scene's own cannot be known: give it"
        require("step", step, step is not None, fix)
        return step
    if method == "midpoint":
        return step or first_period(scene, inertia, attached) / PER_PERIOD
    limit = stable_step(scene, inertia, attached, method)
    fix = f"is above the largest stable one of {method}, {limit:.6g}: take less, or the midpoint"
    require("step", step, step is None or step <= limit, fix)
    return step or MARGIN * limit

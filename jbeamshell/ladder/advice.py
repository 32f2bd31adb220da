"""Which model is enough: the cheapest rung, grid and load path within a tolerance.

``advise(scene, 0.05)`` reads the error of every rung off a map of strips that finite elements have
solved, or climbs the ladder on the scene itself where the map does not reach, and names the
cheapest that stays below 5 %, or none of them.  ``solve(scene, tolerance=0.05)`` goes by it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from jbeamshell.common.checks import is_traced, require
from jbeamshell.common.errors import InputError, UnconvergedError
from jbeamshell.history.linearisation import linear_error
from jbeamshell.ladder import chart
from jbeamshell.ladder.candidates import CANDIDATES
from jbeamshell.ladder.climb import Option, climb
from jbeamshell.quasistatic.load_path import check
from jbeamshell.scene.scene import Scene

__all__ = ["Advice", "Option", "advise"]

NONE = "none of these: use finite elements"
SMALLEST = 0.005  # the finite elements behind the map are known to .1 to .2 %
KINEMATIC_SHARE = 0.1  # of the tolerance, which linear kinematics may use up


@dataclasses.dataclass(frozen=True)
class Advice:
    """The cheapest model that is enough.

    Attributes
    ----------
    rung : its name, or "none"
    estimated_error : relative, of ``quantity``; of the best rung where none is enough
    estimated_ms : time of a warm run; by the map that of the machine it was measured on
    settings : dotted values, empty where none is enough; see `applied`
    quantity, tolerance : what was asked for
    basis : what the estimates rest on
    considered : all that was looked at, the cheapest first
    """

    rung: str
    estimated_error: float
    estimated_ms: float
    settings: dict[str, Any]
    quantity: str
    tolerance: float
    basis: str
    considered: tuple[Option, ...]

    def applied(self, scene: Scene) -> Scene:
        """The scene with the advised model; `InputError` where no rung is enough."""
        if self.rung == "none":
            raise InputError(f"tolerance = {self.tolerance:g}: {self}")
        return scene.replace(self.settings)

    def figures(self) -> dict[str, Any]:
        """What there is to tell, as plain values."""
        names = ("rung", "estimated_error", "estimated_ms", "settings")
        told = {name: getattr(self, name) for name in names}
        asked = {"quantity": self.quantity, "tolerance": self.tolerance, "basis": self.basis}
        return told | asked | ({"advice": NONE} if self.rung == "none" else {})

    def __str__(self) -> str:
        of = f"{self.quantity.replace('_', ' ')} ({self.basis})"
        error = f"{100.0 * self.estimated_error:.2g} %"
        if self.rung == "none":
            return f"{NONE}; the best is estimated to be {error} off in {of}"
        settings = ", ".join(f"{key} = {_shown(value)}" for key, value in self.settings.items())
        cost = f"{self.estimated_ms:.2g} ms"
        return f"{self.rung}: estimated to be {error} off in {of}, in {cost}; {settings}"


def advise(
    scene: Scene,
    tolerance: float,
    *,
    quantity: str = "dissipation",
    tell: Callable[[str], None] = lambda text: None,
) -> Advice:
    """The cheapest rung, grid and load path whose estimated error is within a tolerance.

    The error is that against plane elasticity with ideal Coulomb friction.  Homogeneous strips,
    held at the far end under one pressure and an end force, are on a map of 512 strips that finite
    elements and every rung have solved (eta .008 to .45, A .08 to 1.95 mu F_N a, mu .05 to .5, nu
    up to .45); that takes milliseconds.  Others are solved on one rung after the other, which takes
    as long as compiling them does.

    Parameters
    ----------
    scene : what is to be solved; its own model is no more than where a climb starts
    tolerance : largest relative error, .005 to 1
    quantity : "dissipation", "secant_stiffness", "loss_factor"; off the map any of the figures
    tell : called with what is being solved, where the ladder is climbed

    Returns
    -------
    Advice
        whose ``rung`` is "none" where only finite elements will do.

    Raises
    ------
    InputError
        if the tolerance makes no sense, or the scene has no such figure
    UnconvergedError
        if so few rungs find an equilibrium that nothing can be said of their errors
    """
    require("scene", "traced", not is_traced(scene), "give plain numbers; advice has no derivative")
    require("quantity", quantity, isinstance(quantity, str), "give the name of a figure")
    number = isinstance(tolerance, int | float | np.number) and not isinstance(tolerance, bool)
    fix = f"must be a number from {SMALLEST} to 1; no rung is known finer: use finite elements"
    require("tolerance", tolerance, number and SMALLEST <= tolerance <= 1.0, fix)
    check(scene)
    here = chart.place(scene)
    if isinstance(here, str) or quantity not in chart.QUANTITIES:
        off = here if isinstance(here, str) else f"{quantity} instead of a loop's figures"
        options, note = climb(scene, tolerance, quantity, tell)
        basis = f"off the map for {off}; {note}"
    else:
        options, basis = _from_map(scene, here, tolerance, quantity)
    options = sorted(options, key=lambda option: option.ms)
    enough = [option for option in options if option.error <= tolerance]
    asked = (quantity, float(tolerance), basis, tuple(options))
    if not enough:
        best = min(options, key=lambda option: option.error)
        if not np.isfinite(best.error):
            raise UnconvergedError(
                f"no rung's error can be told ({basis}): some found no equilibrium; take more "
                "load.steps_per_half_cycle, a lower contact.stick_stiffness, or finite elements"
            )
        return Advice("none", best.error, best.ms, {}, *asked)
    chosen = enough[0]
    return Advice(chosen.rung, chosen.error, chosen.ms, chosen.settings, *asked)


def _shown(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _from_map(
    scene: Scene, here: np.ndarray, tolerance: float, quantity: str
) -> tuple[list[Option], str]:
    known, errors = chart.chart(), chart.estimates(here, quantity)
    turned = {rung: linear_error(scene.replace({"model.rung": rung})) for rung in ("squeeze", "p2")}
    options = []
    for name, error in errors.items():
        candidate = CANDIDATES[name]
        rotated = turned["p2" if candidate.section.startswith("p") else "squeeze"]
        linear = rotated <= KINEMATIC_SHARE * tolerance
        # The bar has nothing that turns.
        if not chart.suits(candidate, scene) or (candidate.rung == "bar" and not linear):
            continue
        settings = candidate.settings | {"model.kinematics": "linear" if linear else "exact"}
        total = error + (rotated if linear else 0.0)
        longer = 1.0 if linear else known.exact_over_linear[candidate.rung]
        options.append(Option(candidate.rung, settings, total, longer * known.linear_ms[name]))
    return options, f"map of {len(known.strips)} strips"

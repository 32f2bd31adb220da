"""Advice on the model of a scene: the cheapest rung, grid and load path within a tolerance.

``advise(scene, 0.05)`` names the cheapest rung whose error is at most 5 %, or "none".  It reads the
errors from a map of strips that were solved by finite elements and by every rung; off the map it
solves the scene on one rung after the other.  ``solve(scene, tolerance=0.05)`` follows the advice.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from jbeamshell.common.checks import is_traced, require
from jbeamshell.common.errors import InputError, UnconvergedError
from jbeamshell.common.progress import patience
from jbeamshell.history.reliability import doubted_from
from jbeamshell.ladder import error_map
from jbeamshell.ladder.candidates import CANDIDATES
from jbeamshell.ladder.climb import Option, climb
from jbeamshell.scene.keys import COARSEST
from jbeamshell.scene.linearisation import linear_error
from jbeamshell.scene.load_path import check
from jbeamshell.scene.scene import Scene

NONE = "none of these: use finite elements"
SMALLEST = 0.005  # least tolerance: the finite elements behind the map are right to .1 to .2 %
KINEMATIC_SHARE = 0.1  # largest error of linear kinematics, over the tolerance


@dataclasses.dataclass(frozen=True)
class Advice:
    """Cheapest model that is accurate enough.

    Attributes
    ----------
    rung : name of the rung, or "none" if no rung is accurate enough
    estimated_error : relative error of ``quantity``; that of the best rung if none is enough
    estimated_ms : time of a warm run [ms]; on the map, that of the machine which measured it
    settings : dotted values of the model for `Scene.replace`; empty if no rung is enough
    quantity, tolerance : arguments of `advise`
    basis : source of the estimates: the map, or the rungs that were solved
    considered : all rungs and grids that were compared, the cheapest first
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
        """Scene with the advised model; raises `InputError` if no rung is accurate enough."""
        if self.rung == "none":
            raise InputError(f"tolerance = {self.tolerance:g}: {self}")
        return scene.replace(self.settings)

    def figures(self) -> dict[str, Any]:
        """Advice as plain values for JSON, without the models that were compared."""
        names = [field.name for field in dataclasses.fields(self) if field.name != "considered"]
        figures = {name: getattr(self, name) for name in names}
        return figures | ({"advice": NONE} if self.rung == "none" else {})

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
    tell: Callable[[str], None] | None = None,
) -> Advice:
    """Name the cheapest rung, grid and load path whose estimated error is within a tolerance.

    Errors are relative to plane elasticity with ideal Coulomb friction.  For a homogeneous strip
    that is held at the far end, under one pressure and an end force, they come from a map of 512
    strips that were solved by finite elements and by every rung (eta .008 to .45, A .08 to 1.95
    mu F_N a, mu .05 to .5, nu up to .45), within milliseconds.  Other scenes, such as lap joints,
    are solved as plane elasticity and on the cheaper rungs, or, where plane elasticity has no such
    scene, on one rung after the other.  That takes as long as compiling these does: some 20 s.

    What is advised runs without doubts, unless nothing else is accurate enough: its settings hold
    the tolerance as ``model.tolerance``, up to .1, which doubts know.

    Parameters
    ----------
    scene : strip, contact and load; its own model serves as the finest grid of a climb only
    tolerance : largest relative error, .005 to 1
    quantity : "dissipation", "secant_stiffness" or "loss_factor"; off the map, any figure of
        `History.figures`
    tell : called with the name of each rung that is solved; None shows the seconds that pass

    Returns
    -------
    Advice
        its ``rung`` is "none" if only finite elements are accurate enough

    Raises
    ------
    InputError
        if the tolerance is out of range, if the scene has no such figure, or if it is traced
    UnconvergedError
        if so few rungs find an equilibrium that no error can be estimated

    Examples
    --------
    >>> import jbeamshell as jb
    >>> advice = jb.advise(jb.library.standard(), 0.05)
    >>> advice.rung, advice.settings["model.nodes"]  # doctest: +SKIP
    >>> scene = advice.applied(jb.library.standard())
    """
    require("scene", "traced", not is_traced(scene), "give plain numbers; advice has no derivative")
    require("quantity", quantity, isinstance(quantity, str), "give the name of a figure")
    number = isinstance(tolerance, int | float | np.number) and not isinstance(tolerance, bool)
    fix = f"must be a number from {SMALLEST} to 1; for a smaller error use finite elements"
    require("tolerance", tolerance, number and SMALLEST <= tolerance <= 1.0, fix)
    check(scene)
    allowed = min(float(tolerance), COARSEST)  # for doubts
    place = error_map.place(scene)
    if isinstance(place, str) or quantity not in error_map.QUANTITIES:
        reason = place if isinstance(place, str) else f"{quantity} instead of a loop's figures"
        with contextlib.nullcontext() if tell else patience("comparing models"):
            options, note = climb(scene, tolerance, allowed, quantity, tell or (lambda text: None))
        basis = f"off the map for {reason}; {note}"
    else:
        options, basis = _from_map(scene, place, tolerance, allowed, quantity)
    options = sorted(options, key=lambda option: option.ms)
    enough = [option for option in options if option.error <= tolerance]
    asked = (quantity, float(tolerance), basis, tuple(options))
    if not enough:
        best = min(options, key=lambda option: option.error)
        if not np.isfinite(best.error):
            raise UnconvergedError(
                f"no rung's error can be estimated ({basis}): some found no equilibrium; take more "
                "load.steps_per_half_cycle, a lower contact.stick_stiffness, or finite elements"
            )
        return Advice("none", best.error, best.ms, {}, *asked)
    # The finest of those that doubt themselves, if no other is left: its doubt is told by its run.
    chosen = next((option for option in enough if not option.doubted), enough[-1])
    return Advice(chosen.rung, chosen.error, chosen.ms, chosen.settings, *asked)


def _shown(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _from_map(
    scene: Scene, place: np.ndarray, tolerance: float, allowed: float, quantity: str
) -> tuple[list[Option], str]:
    """Options of the map at a place, and their basis."""
    known, errors = error_map.load(), error_map.estimates(place, quantity)
    doubts, doubted = error_map.doubts(place), doubted_from(allowed)
    sections = ("squeeze", "p2")
    kinematic = {name: linear_error(scene.replace({"model.rung": name})) for name in sections}
    options = []
    for name, error in errors.items():
        candidate = CANDIDATES[name]
        rotation_error = kinematic["p2" if candidate.section.startswith("p") else "squeeze"]
        small = rotation_error <= KINEMATIC_SHARE * tolerance
        # Bars do not rotate.  Load steps are for rotations that matter: where these do not, the
        # contact line is solved as soon without error in time, and plane elasticity beats order p.
        linear = small or candidate.on_contact_line
        idle = not small if candidate.rung == "bar" else small and not candidate.on_contact_line
        if idle or not error_map.suits(candidate, scene):
            continue
        settings = candidate.settings | {"model.kinematics": "linear" if linear else "exact"}
        settings |= {"model.tolerance": allowed}
        total = error + (rotation_error if linear else 0.0)
        slowdown = 1.0 if linear else known.exact_over_linear[candidate.rung]
        ms = slowdown * known.linear_ms[name]
        options.append(Option(candidate.rung, settings, total, ms, doubts[name] > doubted))
    return options, f"map of {len(known.strips)} strips"

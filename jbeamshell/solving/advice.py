"""Advice on the model of a scene: the one that a plain call takes, and why."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from jbeamshell.common.checks import is_traced, require
from jbeamshell.mechanics.friction import SharpSlip
from jbeamshell.scene.buckling import weakest_column
from jbeamshell.scene.keys import CONTROLS, KAPPA_S, TABLE
from jbeamshell.scene.load_path import check
from jbeamshell.scene.mounting import in_words
from jbeamshell.scene.planning import has_contact_line, may_be_elastic, reference
from jbeamshell.scene.rows import AUTO
from jbeamshell.scene.scene import Scene

CHOSEN = ("section", "kinematics", "nodes")


@dataclasses.dataclass(frozen=True, eq=False)
class Advice:
    """Model that `jbeamshell.solve` takes for a scene.

    Attributes
    ----------
    scene : scene with that model
    to : what the tolerance is relative to, "plane elasticity" or "its own fine mesh"
    reason : why this section was taken, in words
    """

    scene: Scene
    to: str
    reason: str

    @property
    def settings(self) -> dict[str, Any]:
        """Dotted values of the model, for `Scene.replace`."""
        return {f"model.{name}": getattr(self.scene.plan, name) for name in CHOSEN}

    def figures(self) -> dict[str, Any]:
        """Advice as plain values for JSON."""
        own = {"tolerance": self.scene.model.tolerance, "to": self.to, "reason": self.reason}
        mounting = in_words(self.scene)
        return own | {"settings": self.settings} | ({"mounting": mounting} if mounting else {})

    def __str__(self) -> str:
        percent = 100.0 * self.scene.model.tolerance
        chosen = f"{self.scene.plan}, for {percent:g} % of {self.to}: {self.reason}"
        return "\n".join(filter(None, (chosen, in_words(self.scene))))


def advise(scene: Scene, tolerance: float | None = None) -> Advice:
    """Explain the model that a plain call takes for a scene, without solving it.

    Parameters
    ----------
    scene : scene whose section may be open
    tolerance : ``model.tolerance``; None is the scene's own

    Returns
    -------
    Advice
        which section and grid, and why

    Raises
    ------
    InputError
        if the tolerance is out of range, if the scene cannot be solved, or if it is traced

    Examples
    --------
    >>> advice = jb.advise(jb.Scene(), 0.02)
    >>> print(advice)
    >>> advice.settings["model.nodes"]  # doctest: +SKIP
    """
    require("scene", scene, isinstance(scene, Scene), "give a jbeamshell.Scene")
    require("scene", "traced", not is_traced(scene), "give plain numbers; advice has no derivative")
    scene = within(scene, tolerance)
    check(scene)
    return Advice(scene, reference(scene), _why(scene))


def within(scene: Scene, tolerance: float | None) -> Scene:
    """Scene with a tolerance; None keeps its own."""
    return scene if tolerance is None else scene.replace({"model.tolerance": tolerance})


def _why(scene: Scene) -> str:
    """Reason for the section of a scene."""
    if not may_be_elastic(scene):
        return _why_not(scene)
    if scene.plan.elastic:
        return "the scene has all that plane elasticity needs"
    if scene.model.kinematics == "exact":
        return "plane elasticity has no exact rotations"
    if weakest_column(scene).near:
        return "a part without pressure may buckle, of which linear rotations know nothing"
    return "rotations are so large that linear ones, as plane elasticity has, would be far off"


def _why_not(scene: Scene) -> str:
    """Reason why plane elasticity does not stand for a scene."""
    strip, contact, load, model = scene.strip, scene.contact, scene.load, scene.model
    kappa_s = TABLE[KAPPA_S].default
    reasons = {
        "its section is named": model.section != AUTO,
        "it is to be solved in load steps": model.by != AUTO,
        "it has a strain energy of its own": scene.energy is not None,
        "it is curved": strip.curvature is not None,
        "it is held down": contact.normal == "held",
        "its base is not rigid": contact.normal != "rigid",
        "its friction is smooth": not isinstance(contact.law, SharpSlip),
        f"elasticity has no load.control = {load.control}": load.control not in CONTROLS,
        "elasticity has no strip.kappa_s of its own": bool(np.any(strip.kappa_s != kappa_s)),
        "it has no load cycle": load.cycles == 0,
        "its grid or its constants are named": not has_contact_line(scene)
        or model.constants != "consistent",
    }
    return next(reason for reason, holds in reasons.items() if holds)

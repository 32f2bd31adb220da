"""Advice on the model of a scene: the one that a plain call takes, and why."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from jbeamshell.common.checks import is_traced, require
from jbeamshell.mechanics.friction import SharpSlip
from jbeamshell.scene.keys import CONTROLS, KAPPA_S, TABLE
from jbeamshell.scene.load_path import check
from jbeamshell.scene.planning import has_contact_line, may_be_elastic, only_pressed, reference
from jbeamshell.scene.rows import AUTO
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.section_error import SectionError, known_beforehand

CHOSEN = ("section", "kinematics", "nodes")


@dataclasses.dataclass(frozen=True, eq=False)
class Advice:
    """Model that `jbeamshell.solve` takes for a scene.

    Attributes
    ----------
    scene : scene with that model
    to : what the tolerance is relative to, "plane elasticity" or "its own fine mesh"
    reason : why this section was taken, in words
    section_error : largest error of the section beside plane elasticity that is expected; None
        where none is known, zero for plane elasticity itself
    """

    scene: Scene
    to: str
    reason: str
    section_error: float | None

    @property
    def settings(self) -> dict[str, Any]:
        """Dotted values of the model, for `Scene.replace`."""
        return {f"model.{name}": getattr(self.scene.plan, name) for name in CHOSEN}

    def figures(self) -> dict[str, Any]:
        """Advice as plain values for JSON."""
        own = {"tolerance": self.scene.model.tolerance, "to": self.to, "reason": self.reason}
        return own | {"section_error": self.section_error, "settings": self.settings}

    def __str__(self) -> str:
        percent = 100.0 * self.scene.model.tolerance
        return f"{self.scene.plan}, for {percent:g} % of {self.to}: {self.reason}"


def advise(scene: Scene, tolerance: float | None = None) -> Advice:
    """Explain the model that a plain call takes for a scene, without solving it.

    Parameters
    ----------
    scene : scene whose section may be open
    tolerance : ``model.tolerance``; None is the scene's own

    Returns
    -------
    Advice
        which section and grid, why, and how far the section is off

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
    known = known_beforehand(scene, "squeeze", scene.number)
    if not may_be_elastic(scene):
        return Advice(scene, reference(scene), _why_not(scene), None)
    at = "for slip as long as a bar's"
    if scene.plan.elastic:
        if only_pressed(scene):
            text = "a squeeze section lifts off too near to the edge of a pressure"
        elif known is None:
            text = "no curve says how far a squeeze section is off for such a scene"
        else:
            text = f"a squeeze section may be off by {_percent(known)} {at}"
        return Advice(scene, reference(scene), text, 0.0)
    assert known is not None
    text = f"a squeeze section is at most {_percent(known)} off {at}"
    return Advice(scene, reference(scene), text, known.largest)


def within(scene: Scene, tolerance: float | None) -> Scene:
    """Scene with a tolerance; None keeps its own."""
    return scene if tolerance is None else scene.replace({"model.tolerance": tolerance})


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


def _percent(known: SectionError) -> str:
    size = known.largest
    return f"{100.0 * size:.2g} %" if size < 1.0 else f"a factor of {1.0 + size:.2g}"

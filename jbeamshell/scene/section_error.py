"""Error of a section beside plane elasticity, from the slip length that a run itself has.

Two things decide the dissipation before any grid does: how the force enters the loaded end, and
whether the section may warp.  A straight section (the beamshell) is a rigid face that may turn,
whatever ``load.entry`` says.  What that makes falls on curves of the slip length over the half
height, which `verification/section_errors.py` records and writes to section_errors.json beside this
file.
"""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jbeamshell.common.checks import is_traced
from jbeamshell.mechanics.friction import SharpSlip
from jbeamshell.scene.keys import TABLE
from jbeamshell.scene.linearisation import Parts

ENTERS = {
    "member": "enters a member that goes on beyond the contact",
    "face": "enters a rigid face that may turn",
    "guided": "enters a rigid face that may not turn",
    "traction": "is an even traction on the face",
}
TOLD_FROM = 0.005  # error that is told


class SectionError(NamedTuple):
    """Relative error of the dissipation of a section.

    Attributes
    ----------
    typical : median over strips of the same slip length over half height; positive if too large
    usual : size that nine strips in ten keep, of these and of all that slip more
    largest : largest size over these and all that slip more
    """

    typical: float
    usual: float
    largest: float


@functools.cache
def curves() -> dict[str, Any]:
    """Recorded curves by kind of scene, entry and section."""
    path = Path(__file__).with_name("section_errors.json")
    record: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return record


def kind_of(scene: Parts) -> str:
    """Kind of a scene for which curves are recorded; empty if there are none for it."""
    strip, contact, member, load = scene.strip, scene.contact, scene.member, scene.load
    straight = strip.curvature is None and scene.energy is None
    base = contact.normal in ("rigid", "held") and isinstance(contact.law, SharpSlip)
    pulled = load.kind == "force" and load.arm is None
    if not straight or not base or not pulled or strip.overhang is not None:
        return ""
    if member.support != "none":
        return {"rolling": "double shear", "clamped": "single lap"}[member.support]
    if strip.far_end != TABLE["strip.far_end"].default:
        return ""
    if is_traced(contact.bottom_pressure) or np.any(contact.bottom_pressure):
        return ""
    if strip.layers is not None:
        return "laminate"
    if contact.pressure.ndim == 0:
        return "even"
    end = np.asarray(contact.pressure)[-1]
    return "patch" if end[0] < float(strip.length) or end[1] == 0.0 else "table"


def section_of(scene: Parts) -> str:
    """Section of a scene for which curves are recorded; empty if there are none for it."""
    section = scene.plan.section
    return section if section in ("bar", "shell", "squeeze") else ""


def section_error(scene: Parts, slip_length: float) -> SectionError | None:
    """Error of a scene's section beside plane elasticity under the same entry of the force.

    Parameters
    ----------
    scene : scene without traced leaves
    slip_length : slip length of its own run, length

    Returns
    -------
    SectionError or None
        from the curve, at that slip length.  None where nothing slips, for plane elasticity, and
        for scenes unlike those that were recorded
    """
    reach = slip_length / float(scene.strip.half_height)
    curve = curves().get(kind_of(scene), {}).get(scene.load.entry, {}).get(section_of(scene))
    if curve is None or not reach > 0.0:
        return None
    place = np.log(reach), np.log(curve["slip_over_H"])
    sizes = (np.exp(np.interp(*place, np.log(curve[name]))) for name in ("usual", "largest"))
    return SectionError(float(np.interp(*place, curve["typical"])), *map(float, sizes))


def in_words(scene: Parts, slip_length: float | None) -> str:
    """Line that says how the force enters, and what the section makes of it.

    Parameters
    ----------
    scene : scene without traced leaves
    slip_length : see `section_error`; None if it is not known
    """
    load = scene.load
    what = "moment" if load.kind == "moment" else "force"
    line = f"the {what} {ENTERS[load.entry]} (load.entry = {load.entry})"
    error = None if slip_length is None else section_error(scene, slip_length)
    if slip_length is None or error is None:
        return line
    reach = slip_length / float(scene.strip.half_height)
    about = f"where slip reaches {reach:.2g} H the section {section_of(scene)}"
    return f"{line}; {about} typically loses {_compared(error.typical)} plane elasticity"


def doubt_of_section(scene: Parts, slip_length: float, allowed: float) -> str:
    """Doubt about a section that the user names; empty if its own slip length speaks for it.

    Parameters
    ----------
    scene : scene without traced leaves
    slip_length : see `section_error`
    allowed : relative error of the dissipation that is no doubt
    """
    error = section_error(scene, slip_length)
    if error is None or error.usual <= allowed:
        return ""
    reach = slip_length / float(scene.strip.half_height)
    off = f"more than {100.0 * min(error.usual, 1.0):.3g} %"
    fix = "leave model.section open, or take model.section = plane"
    if scene.model.by == "steps":
        fix = "do without load steps, with model.section open or plane"
    if scene.contact.normal == "held":
        fix = "let it lift off (contact.normal = rigid), with model.section = plane"
    return (
        f"where slip reaches {reach:.2g} H the section {section_of(scene)} typically loses "
        f"{_compared(error.typical)} plane elasticity, and one strip in ten is off by {off}; {fix}"
    )


def _compared(error: float) -> str:
    """Words for a loss that is off by a relative error."""
    if abs(error) < TOLD_FROM:
        return f"as much, within {100.0 * TOLD_FROM:g} %, as"
    if error > 1.0:
        return f"{1.0 + error:.2g} times as much as"
    return f"{100.0 * abs(error):.2g} % {'more' if error > 0.0 else 'less'} than"

"""Lap joint: the rules of a scene with a second member."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from jbeamshell.common.checks import is_traced, require
from jbeamshell.mechanics.friction import SharpSlip, law_name
from jbeamshell.mechanics.homogeneous import Energy
from jbeamshell.scene.keys import CONTROLS
from jbeamshell.scene.layers import check_layers
from jbeamshell.scene.parts import Contact, Load, Member, Model, Strip
from jbeamshell.scene.plan import Plan
from jbeamshell.scene.pressure import pressure_values
from jbeamshell.scene.rows import AUTO, rows


class Parts(Protocol):
    """Parts of a `jbeamshell.Scene` that the rules read."""

    strip: Strip
    contact: Contact
    load: Load
    model: Model
    member: Member
    energy: Energy | None
    plan: Plan


def check_joint(scene: Parts) -> None:
    """Raise `InputError` for a lap joint that is none, or that cannot be solved."""
    strip, contact, member, plan = scene.strip, scene.contact, scene.member, scene.plan
    if member.support == "none":
        _check_alone(scene)
        return
    fix = "must be 'free' in a lap joint, whose second member is held at X = 0"
    require("strip.far_end", strip.far_end, strip.far_end == "free", fix)
    fix = "must be left out in a lap joint, whose strip is straight"
    require("strip.curvature", strip.curvature, strip.curvature is None, fix)
    require("energy", scene.energy, scene.energy is None, "must be left out in a lap joint")
    fix = "must be 'rigid' in a lap joint, whose second member is elastic"
    require("contact.normal", contact.normal, contact.normal == "rigid", fix)
    by = scene.model.by
    fix = "is no engine of a lap joint: its pressures stay beside elastic sliders or a gap; "
    fix += "for vibrations take jb.dynamics.let_go, or Joint.of(scene) in a structure"
    require("model.by", by, by == AUTO, fix)
    fix = "must be linear in a lap joint, which is solved on its contact line: leave it out"
    require("model.kinematics", plan.kinematics, plan.kinematics == "linear", fix)
    fix = "is no section of a lap joint: take plane, squeeze or shell"
    bends = plan.section not in ("bar", "assumed")
    require("model.section", plan.section, bends, fix)
    grid, sharp = scene.model.grid, isinstance(contact.law, SharpSlip)
    fix = "must be finite-difference in a lap joint: leave it out"
    require("model.grid", grid, grid == "finite-difference", fix)
    fix = "must be the sharp slider in a lap joint: leave contact.smoothing out"
    require("contact.law", law_name(contact.law), sharp, fix)
    control = scene.load.control
    require(
        "load.control", control, control in CONTROLS, "must be force or displacement in a lap joint"
    )
    _check_section(strip, member)
    fix = "needs member.bearing_stiffness"
    bears = member.clearance is None or member.bearing_stiffness is not None
    require("member.clearance", member.clearance, bears, fix)
    load = scene.load
    fix = "is for a force: leave it out with load.kind = moment"
    require("load.arm", load.arm, load.arm is None or load.kind == "force", fix)
    turned = load.kind == "moment" or load.arm is not None
    fix = "may not turn: take member, face or traction, or a force without load.arm"
    require("load.entry", load.entry, load.entry != "guided" or not turned, fix)
    if member.support != "rolling":
        return
    bottom = contact.bottom_pressure
    none = is_traced(bottom) or not np.any(pressure_values(np.asarray(bottom)))
    fix = "must be 0 on a symmetry plane: take member.support = clamped"
    require("contact.bottom_pressure", bottom, none, fix)
    squeezed = plan.section != "shell" or member.loaded_end == "free"
    fix = "leaves no lift to a shell on a symmetry plane: take model.section = squeeze or plane"
    require("member.loaded_end", member.loaded_end, squeezed, fix)


def _check_section(strip: Strip, member: Member) -> None:
    """Refuse a section of the second member that is said twice, or not wholly."""
    if member.layers is not None:
        ratio = strip.height_ratio if member.height_ratio is None else member.height_ratio
        check_layers(member.layers, ratio * strip.length, strip.plane, "member.layers")
    numbers = [member.axial_stiffness is not None, member.poisson_ratio is not None]
    fix = "needs member.axial_stiffness and member.poisson_ratio both on a strip with layers"
    whole = strip.layers is None or member.layers is not None or all(numbers) or not any(numbers)
    require("member", "homogeneous", whole, fix)


def _check_alone(scene: Parts) -> None:
    """Refuse what only a lap joint knows."""
    fix = "needs a second member: leave it out, or give member.support, rolling or clamped"
    for name, key in rows(Member).items():
        value = getattr(scene.member, name)
        left_out = value is None if key.kind == "number" else value == key.default
        require(f"member.{name}", value, left_out, fix)
    fix = "needs the contact line of a linear strip: leave it out, or take model.kinematics = "
    fix += "linear and the sharp slider on a rigid base"
    linear = scene.strip.overhang is None or scene.plan.on_contact_line
    require("strip.overhang", scene.strip.overhang, linear, fix)
    load = scene.load
    fix = "needs a second member: take 'force', or give member.support"
    require("load.kind", load.kind, load.kind == "force", fix)
    fix = "needs a second member: leave it out, or give member.support"
    require("load.arm", load.arm, load.arm is None, fix)

"""Domain of the model: rules on numbers that go together, for one scene or for a sweep.

Every rule is an array function.  For one scene its numbers are scalars, and a rule that does not
hold raises `InputError`.  For a sweep they are arrays over its strips, and those where it does not
hold are marked.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from jbeamshell.common.checks import require
from jbeamshell.scene.keys import FAR_ENDS
from jbeamshell.scene.parts import Contact, Load, Member, Strip
from jbeamshell.scene.plan import Plan
from jbeamshell.scene.pressure import face_resultant, is_table, resultant

EDGE = 1e-12  # part of the length by which a table may run beyond the strip, for round-off
BALANCED = 1e-3  # of the pressing force, by which the pressures of a single lap may differ
MARGIN = 1e-9  # part of gross slip: a force that is closer to it counts as beyond

Numbers = Callable[[str], np.ndarray]  # value of a dotted key: a scalar, or an array over strips


class Rule(NamedTuple):
    """Condition on a scene.

    Attributes
    ----------
    key : dotted key that the message names
    value : value that the message shows
    holds : True where the condition holds, one truth or an array of them
    fix : fix in words, for one scene
    """

    key: str
    value: Any
    holds: Any
    fix: str

    def demand(self) -> None:
        """Raise `InputError` unless the condition holds everywhere."""
        require(self.key, self.value, bool(np.all(self.holds)), self.fix)


@np.errstate(over="ignore", invalid="ignore")  # one of the rules refuses infinite forces
def support_rules(
    strip: Strip, member: Member, contact: Contact, plan: Plan, load: Load, numbers: Numbers
) -> list[Rule]:
    """Rules by which pressures, friction and supports hold the strip, in the order of the checks.

    Parameters
    ----------
    strip, member, contact, plan, load : parts of the scene, for their words
    numbers : values by dotted key
    """
    length, friction = numbers("strip.length"), numbers("contact.friction")
    top, bottom = numbers("contact.pressure"), numbers("contact.bottom_pressure")
    held_fields = FAR_ENDS[strip.far_end]
    top_force, _ = face_resultant(top, length)
    force, moment = resultant(top, bottom, length, member.support)
    rough = (friction > 0.0) | ("v" in held_fields)
    fix = "nothing holds the strip along X (rigid-body motion): give strip.far_end or friction"
    rules = [Rule("contact.friction", friction, rough, fix)]
    for key, pressure in (("contact.pressure", top), ("contact.bottom_pressure", bottom)):
        if is_table(pressure):
            rules.append(_on_strip(key, pressure[:, 0], length))
    rules.append(Rule("contact.pressure", top, top_force > 0.0, "must press somewhere"))
    fix = "overflows together with contact.pressure: take other units"
    rules.append(Rule("strip.length", length, np.isfinite(moment), fix))
    if member.support == "clamped" and load.entry == "member":
        bottom_force, bottom_moment = face_resultant(bottom, length)
        excess = np.maximum(
            np.abs(top_force - bottom_force), np.abs(moment - bottom_moment) / length
        )
        fix = "must balance contact.pressure in a single lap that is pressed before it is mounted: "
        fix += "give both the same, or another load.entry, whose clamp carries the rest"
        rules.append(Rule("contact.bottom_pressure", bottom, excess <= BALANCED * top_force, fix))
    if contact.normal != "none":
        fix = "nothing holds the strip down (rigid-body motion): press more on top"
        rules.append(Rule("contact.bottom_pressure", bottom, force > 0.0, fix))
        if "beta" not in held_fields and plan.lifts:
            inside = (moment >= 0.0) & (moment <= force * length)
            fix = "the strip tips over (rigid-body motion): the pressures' resultant misses it"
            rules.append(Rule("contact.bottom_pressure", bottom, inside, fix))
    return rules


def gross_slip(numbers: Callable[[str], Any], support: str) -> Any:
    """End force per unit of width at which all of the contact slides, mu F_N L.

    It has any shape, and may be traced.

    Parameters
    ----------
    numbers : values by dotted key
    support : of the member, see `resultant`
    """
    top, bottom = numbers("contact.pressure"), numbers("contact.bottom_pressure")
    force, _ = resultant(top, bottom, numbers("strip.length"), support)
    return numbers("contact.friction") * force


@np.errstate(over="ignore", invalid="ignore")
def gross_slip_rule(
    load: Load, member: Member, numbers: Numbers, targets: Any, part: Any = 1.0
) -> Rule:
    """Rule that a controlled force stays below gross slip, mu F_N L.

    Parameters
    ----------
    load, member : for their words
    numbers : values by dotted key
    targets : controlled loads of one unit of width, any shape
    part : part of the pressures that acts with each
    """
    key, size = "load.amplitude", np.abs(np.asarray(targets))
    if load.control != "force" or load.kind == "moment":
        return Rule(key, size, True, "")
    if np.all(numbers("member.bolt_stiffness") > 0.0):
        return Rule(key, size, True, "")  # bolts hold a joint beyond
    limit = gross_slip(numbers, member.support)
    below = stays_below(size, limit, np.asarray(part))
    worst = np.max(np.broadcast_to(size, np.shape(below)), where=~below, initial=0.0)
    width = numbers("strip.width")
    wide = np.where(np.isnan(width), 1.0, width * (2.0 if member.support == "rolling" else 1.0))
    return Rule(
        key,
        float(np.max(wide * worst)),
        below,
        f"must stay below gross slip, mu F_N L = {np.max(wide * limit):.6g}; "
        "set load.control to 'displacement' or 'arc-length' to go beyond",
    )


def stays_below(size: Any, limit: Any, part: Any) -> Any:
    """True where forces stay below gross slip, or where nothing resists; any shape, traced or not.

    Parameters
    ----------
    size : forces, positive
    limit : mu F_N L
    part : part of the pressures that acts
    """
    return (size == 0.0) | (limit == 0.0) | (size < (1.0 - MARGIN) * (limit * part))


def _on_strip(key: str, x: np.ndarray, length: np.ndarray) -> Rule:
    """Rule that the X of a table lie on the strip."""
    end = length * (1.0 + EDGE)
    outliers = x[(x < 0.0) | (x > np.max(end))]
    fix = f"lies off the strip, whose X runs from 0 to {np.max(length):.6g}"
    return Rule(key, outliers, (x.min() >= 0.0) & (x.max() <= end), fix)

"""Choice of the parameters to fit where nobody names any: what the measurements can tell.

A loop with a plateau tells friction and one stiffness: that of the sliders if the way to the
plateau is straight, else that of the strip.  A loop below gross slip tells by its work the force of
gross slip over the height, and by its displacement the stiffness.  What the user gives stays fixed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from jbeamshell.identify.starts import HEIGHT, STIFFNESS, Estimate, suits
from jbeamshell.measured.curves import SqueezeCurve

FRICTION, SLIDERS = "contact.friction", "contact.stick_stiffness"
TALL, STIFF, SQUEEZE = "strip.height_ratio", "strip.axial_stiffness", "strip.kappa_s"
USUAL = (FRICTION, TALL)


def chosen_free(
    known: Mapping[str, Any], data: Sequence[Any], found: Estimate | None
) -> dict[str, str]:
    """Keys to fit, each with the reason why these data tell it.

    Parameters
    ----------
    known : values by dotted key that were given
    data : measurements of a specimen
    found : figures of its loops; None without loops
    """
    reasons = _told(known, data, found)
    other_names = dict.fromkeys(STIFFNESS, STIFF) | dict.fromkeys(HEIGHT, TALL)
    given = {other_names.get(key, key) for key in known}
    if "strip.layers" in known:
        given |= {STIFF, TALL}
    free = {key: reason for key, reason in reasons if key not in given}
    return free or dict.fromkeys(USUAL, "the usual ones, as all that the data tell is given")


def _told(
    known: Mapping[str, Any], data: Sequence[Any], found: Estimate | None
) -> list[tuple[str, str]]:
    """Parameters that data tell, with reasons; the last of several stiffnesses if it is unknown."""
    if all(isinstance(item, SqueezeCurve) for item in data):
        return [(SQUEEZE, "the squeeze stress decays by it")]
    if found is None:
        return [(FRICTION, "the figures over the amplitude tell it"), (TALL, "and the height")]
    if found.slides:
        way = (
            (SLIDERS, "the way to the plateau is straight, as of soft sliders")
            if found.soft
            else (STIFF, "the way to the plateau is bent, as of a strip that slides from its end")
        )
        return [(FRICTION, "the plateau is mu F_N L"), way]
    if suits(known, found):
        return [(FRICTION, "of the standard strip, which suits the loops"), (TALL, "likewise")]
    if found.work is None:
        return [(STIFF, "the loops are lines: they tell a stiffness, and no friction")]
    by_work = (FRICTION, "the work of a cycle tells mu F_N L over the height")
    if any(key in known for key in STIFFNESS):
        return [by_work, (TALL, "the stiffness is given, so the displacement tells the height")]
    return [by_work, (STIFF, "the displacement tells it")]

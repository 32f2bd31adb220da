"""Choice of the parameters to fit where nobody names any: what the measurements can tell.

A loop with a plateau tells friction and one stiffness: that of the sliders if the way to the
plateau is straight, else that of the strip.  A loop below gross slip tells by its work the force of
gross slip over the height, and by its displacement the stiffness.  What the user gives stays fixed.

Where Young's modulus is given, friction and height act by their product alone: a long strip of
elasticity has no other scale than A/(mu F_N H), with displacements in units of A/E'.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from typing import Any

from jbeamshell.identify.parameters import Parameter, as_parameters
from jbeamshell.identify.starts import HEIGHT, STIFFNESS, Estimate, suits
from jbeamshell.measured.curves import SqueezeCurve
from jbeamshell.scene.scene import Scene

FRICTION, SLIDERS = "contact.friction", "contact.stick_stiffness"
TALL, SQUEEZE = "strip.height_ratio", "strip.kappa_s"
STIFF, MODULUS = STIFFNESS


def chosen_free(
    scene: Scene | None, known: Mapping[str, Any], data: Sequence[Any], found: Estimate | None
) -> tuple[tuple[Parameter, ...], str]:
    """Parameters to fit, and a sentence on why these data tell them.

    Parameters
    ----------
    scene : whole scene, whose numbers are starts; None where only some values are known
    known : values by dotted key that were given, and that stay fixed if others are left to fit
    data : measurements of a specimen
    found : figures of its loops; None without loops
    """
    said = set(known) if scene is None else scene.strip.said
    suited = scene is None and found is not None and suits(known, found)
    other_names = dict.fromkeys(STIFFNESS, STIFF) | dict.fromkeys(HEIGHT, TALL)
    given = {other_names.get(key, key) for key in known}
    layers = "strip.layers" in known if scene is None else scene.strip.layers is not None
    reasons = {
        key: reason
        for key, reason in _told(data, found, said, suited)
        if not (layers and key in (STIFF, TALL))
        and not (scene is not None and scene.get(key) is None)
    }
    free = {k: reason for k, reason in reasons.items() if other_names.get(k, k) not in given}
    if not free:  # all that the data tell is given: these values are starts
        free = {k: f"{reason}; it is given and starts there" for k, reason in reasons.items()}
    free = free or {FRICTION: "the data tell nothing that the layers leave open"}
    told = "; ".join(f"{key} ({reason})" for key, reason in free.items())
    note = f"Fitted: {told}; choose with free= (--free on the command line)"
    return as_parameters(list(free)), note


def _told(
    data: Sequence[Any], found: Estimate | None, said: Set[str], suited: bool
) -> list[tuple[str, str]]:
    """Parameters that data tell, with reasons; a stiffness by the key that says it.

    Parameters
    ----------
    said : keys by which the strip is given
    """
    stiff = MODULUS if MODULUS in said else STIFF
    over_height = "the work of a cycle tells mu F_N L over the height"
    if all(isinstance(item, SqueezeCurve) for item in data):
        return [(SQUEEZE, "the squeeze stress decays by it")]
    if found is not None and found.slides:
        way = (
            (SLIDERS, "the way to the plateau is straight, as of soft sliders")
            if found.soft
            else (stiff, "the way to the plateau is bent, as of a strip that slides from its end")
        )
        return [(FRICTION, "the plateau is mu F_N L"), way]
    if found is not None and found.work is None and not suited:
        return [(stiff, "the loops are lines: they tell a stiffness, and no friction")]
    if MODULUS in said and FRICTION in said and said.isdisjoint(HEIGHT):
        return [(TALL, over_height)]
    if found is None:
        other = (stiff, "and the stiffness") if MODULUS in said else (TALL, "and the height")
        return [(FRICTION, "the figures over the amplitude tell it"), other]
    if MODULUS in said:
        return [(FRICTION, over_height), (stiff, "the displacement tells it")]
    if suited:
        return [(FRICTION, "of the standard strip, which suits the loops"), (TALL, "likewise")]
    if STIFF in said:
        given = "the stiffness is given, so the displacement tells the height"
        return [(FRICTION, over_height), (TALL, given)]
    return [(FRICTION, over_height), (stiff, "the displacement tells it")]

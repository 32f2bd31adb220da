"""Width of a joint: totals at the scene's door, one unit of width behind it.

The problem is plane.  A scene holds, and engines solve, one unit of width.  Where `strip.width` is
given, `Scene.replace` divides forces by it, and `Scene.get` and a history's figures multiply by it.

A joint in double shear is modelled by one half.  With a width its end force is that of both halves;
a bolt presses both of its contacts with its whole force.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from jax import Array

from jbeamshell.common.checks import is_traced, shown
from jbeamshell.common.errors import InputError
from jbeamshell.scene.keys import DERIVED, LENGTHS, TABLE, TOTALS, TWINS, WIDTH_OF_ALL, leaf_of
from jbeamshell.scene.parts import Contact, Load, Member, Strip


class Parts(Protocol):
    """Parts of a `jbeamshell.Scene` that have forces."""

    strip: Strip
    contact: Contact
    load: Load
    member: Member

    def get(self, key: str) -> Any: ...


def times(key: str, value: Any, factor: Any) -> Any:
    """Number of a key of `TOTALS` times a factor; of bolts the forces alone."""
    if key != "contact.bolts":
        return value * factor
    rows = value.ndim == 2 and value.shape[1] == 3  # anything else is refused by its own rule
    return value.at[:, 1].multiply(factor) if rows else value


def halves(key: str, support: str) -> float:
    """Number of modelled halves that share a force: two of the end force in double shear."""
    return 2.0 if support == "rolling" and key == "load.amplitude" else 1.0


def is_total(key: str, control: str) -> bool:
    """True for a number that is a total where there is a width; an amplitude may be a length."""
    return key in TOTALS and not (key == "load.amplitude" and control in LENGTHS)


def per_width(scene: Parts, values: Mapping[str, Any]) -> dict[str, Any]:
    """New values of a scene with its totals for one unit of width.

    Totals that a new width leaves out stay as they are, but for the pressures of bolts, which
    `pressure_factor` tells.

    Parameters
    ----------
    scene : scene that is changed
    values : values by dotted key, totals if the new scene has a width

    Raises
    ------
    InputError
        if a scene per width gets a width, or loses it, without new values for its forces
    """
    before, width = scene.strip.width, values.get(WIDTH_OF_ALL, scene.strip.width)
    if before is None and width is None:
        return dict(values)
    width = None if width is None else leaf_of(WIDTH_OF_ALL, width)
    control = values.get("load.control", scene.load.control)
    support = values.get("member.support", scene.member.support)
    found = dict(values)
    for key in TOTALS:
        if not is_total(key, control):
            continue
        whole = None if width is None else width * halves(key, support)
        if values.get(key) is not None:
            if whole is not None:
                found[key] = times(key, leaf_of(key, values[key]), 1.0 / whole)
        elif WIDTH_OF_ALL in values and key not in values and _holds(scene, key, values):
            if before is None or width is None:
                if not _is_default(scene, key):
                    raise InputError(_given_anew(scene, key, width))
                found[key] = TABLE[key].default / (1.0 if whole is None else whole)
            elif key != "contact.bolts":
                found[key] = scene.get(key) / whole
    return found


def check_width(where: str, below: Mapping[str, Any], given: Mapping[str, Any]) -> None:
    """Refuse a width for values of a scene whose forces were said without one.

    Parameters
    ----------
    where : name of the scene, or its file
    below : values by dotted key of that scene
    given : values by dotted key that override them

    Raises
    ------
    InputError
        for a force that is given per unit of width only
    """
    if WIDTH_OF_ALL in below or given.get(WIDTH_OF_ALL) is None:
        return
    for key in TOTALS:
        if key in below and not {key, TWINS.get(key)} & set(given):
            raise InputError(
                f"{key} = {shown(below[key])}: is per unit of width in {where}, and a total with "
                "strip.width: give it too, or write strip.width and totals into the scene"
            )


def pressure_factor(scene: Parts, values: Mapping[str, Any]) -> Array | None:
    """Factor of the pressures of bolts whose forces stay while the width changes; None is 1."""
    before, width = scene.strip.width, values.get(WIDTH_OF_ALL)
    new = {"contact.bolts", "contact.pressure"} & set(values)
    if before is None or width is None or new or not scene.contact.bolted:
        return None
    factor: Array = before / leaf_of(WIDTH_OF_ALL, width)
    return factor


def _holds(scene: Parts, key: str, values: Mapping[str, Any]) -> bool:
    """True if a scene has a force under a key that new values do not replace otherwise."""
    if key == "contact.bolts":
        return scene.contact.bolted and "contact.pressure" not in values
    if key == "strip.axial_stiffness":
        said = key in scene.strip.said
        return said and "strip.youngs_modulus" not in values and "strip.layers" not in values
    if key == "load.amplitude":
        cycles = values.get("load.cycles", scene.load.cycles)
        return cycles != 0 and scene.load.control not in LENGTHS
    heading, name = key.split(".")
    return key not in DERIVED and getattr(getattr(scene, heading), name) is not None


def _is_default(scene: Parts, key: str) -> bool:
    """True if a number is that of the standard strip, which nobody gave."""
    default, value = TABLE[key].default, scene.get(key)
    return default is not None and not is_traced(value) and np.allclose(value, default, 1e-6, 0.0)


def _given_anew(scene: Parts, key: str, width: Any) -> str:
    """Message for a force that was given without a width, or with one, and must be given anew."""
    if width is None:
        was, now = "a total", "is per unit of width without strip.width"
    else:
        was, now = "per unit of width", f"is a total with strip.width = {float(width):.6g}"
    fix = "or take scene.of_width(...), which keeps the joint and turns its forces into totals"
    return f"{key} = {shown(scene.get(key))}: was {was} and {now}: give it too, {fix}"

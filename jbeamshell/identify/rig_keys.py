"""Keys that a fit knows beside those of the scene: of the rig, laws of a joint, structures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError
from jbeamshell.laws import LAWS, Law, law_named
from jbeamshell.scene.keys import TABLE, check_key
from jbeamshell.scene.rows import Key

PREFIX = "rig."
OF_STRUCTURE = "structure."
ANY = -math.inf  # lower bound of a number of any sign


def _row(
    name: str, sentence: str, unit: str, low: float = 0.0, scale: str = "log"
) -> tuple[str, Key]:
    key = PREFIX + name
    return key, Key(key, "number", 0.0, sentence, unit=unit, low=low, scale=scale, closed=True)


RIG: dict[str, Key] = dict(
    (
        _row("compliance", "Compliance of a spring in series.", "length/(force/width)"),
        _row("stiffness", "Stiffness of a spring in parallel.", "(force/width)/length"),
        _row("loss", "Force of damping in parallel at the middle of the cycle.", "force/width"),
        _row("force_zero", "Reading of the force without load.", "force/width", ANY, "linear"),
        _row("displacement_zero", "Reading of the displacement.", "length", ANY, "linear"),
        _row("drift", "Change of the response's reading over the loop.", "mixed", ANY, "linear"),
    )
)


def law_of(key: object) -> type[Law] | None:
    """Law that has a number of a dotted key; None if there is none."""
    if not isinstance(key, str):
        return None
    heading = key.partition(".")[0]
    known = heading in LAWS or heading.removeprefix("sliders").isdecimal()
    law = law_named(heading) if known else None
    return law if law is not None and key in law.table() else None


def fitted_row(key: str) -> Key:
    """Row of a key of the scene, the rig, a law or a structure; raises `InputError` for others."""
    if law := law_of(key):
        return law.table()[key]
    if is_of_structure(key):
        return Key(key, "number", 1.0, "Number of a structure.", low=0.0, scale="log")
    of_rig = isinstance(key, str) and key.startswith(PREFIX)
    (check_rig_key if of_rig else check_key)(key)
    return RIG[key] if of_rig else TABLE[key]


def is_of_structure(key: object) -> bool:
    """True for a dotted key of a number of a structure, whose names users choose."""
    return isinstance(key, str) and key.startswith(OF_STRUCTURE) and len(key) > len(OF_STRUCTURE)


def check_rig_key(key: str) -> None:
    """Raise `InputError` for a key of the rig that does not exist."""
    if key not in RIG:
        raise InputError(f"unknown key {key!r}: keys of the rig are {', '.join(RIG)}")


def check_rig(values: Mapping[str, Any]) -> None:
    """Raise `InputError` for unknown keys of a rig, and values out of their domain."""
    for key, value in values.items():
        check_rig_key(key)
        low = RIG[key].low
        number = isinstance(value, int | float) and not isinstance(value, bool)
        fix = "give a number" + (", 0 or more" if low == 0.0 else "")
        require(key, value, number and math.isfinite(value) and value >= low, fix)

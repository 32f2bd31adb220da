"""Keys of the rig, beside those of the scene: numbers of an experiment that can be fitted."""

from __future__ import annotations

import math

from jbeamshell.common.errors import InputError
from jbeamshell.scene.keys import TABLE
from jbeamshell.scene.rows import Key

PREFIX = "rig."
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
FITTED = TABLE | RIG  # all numbers that a fit may change, and the settings that it may not


def check_rig_key(key: str) -> None:
    """Raise `InputError` for a key of the rig that does not exist."""
    if key not in RIG:
        raise InputError(f"unknown key {key!r}: keys of the rig are {', '.join(RIG)}")

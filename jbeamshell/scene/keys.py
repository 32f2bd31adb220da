"""scene.keys."""

from __future__ import annotations

import difflib

from jbeamshell.common.errors import InputError
from jbeamshell.scene.parts import ARC_LENGTH

LENGTHS = ("displacement", ARC_LENGTH)  # controls whose amplitude is a length

# Keys that set a leaf through others, in the order in which they apply.
DERIVED = {
    "strip.half_height": "strip.height_ratio",
    "strip.youngs_modulus": "strip.axial_stiffness",
}

NUMBERS = (
    "strip.length",
    "strip.height_ratio",
    "strip.half_height",
    "strip.axial_stiffness",
    "strip.youngs_modulus",
    "strip.poisson_ratio",
    "strip.kappa_s",
    "strip.layers",
    "strip.deviation",
    "strip.curvature",
    "contact.friction",
    "contact.pressure",
    "contact.bottom_pressure",
    "contact.stick_stiffness",
    "contact.smoothing",
    "contact.normal_stiffness",
    "load.amplitude",
)
SETTINGS = (
    "load.cycles",
    "load.steps_per_half_cycle",
    "load.pressure_steps",
    "model.nodes",
    "model.order",
    "model.end_size",
)
WORDS = (
    "strip.far_end",
    "strip.plane",
    "contact.law",
    "contact.normal",
    "load.control",
    "model.fields",
    "model.kinematics",
    "model.grid",
    "model.constants",
    "model.squeeze",
    "model.solution",
    "model.rung",
)
KEYS = NUMBERS + SETTINGS + WORDS
OPTIONAL = ("strip.layers", "strip.curvature")  # may be None


def check_key(key: str) -> None:
    """Raise `InputError` for a key that does not exist, with the nearest one that does."""
    if not isinstance(key, str):
        raise InputError(f"{key!r}: is no key; keys are {', '.join(KEYS)}")
    if key not in KEYS:
        near = difflib.get_close_matches(key, KEYS, 1)
        hint = f"did you mean {near[0]!r}?" if near else f"keys are {', '.join(KEYS)}"
        raise InputError(f"unknown key {key!r}: {hint}")

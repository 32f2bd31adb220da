"""Scenes as TOML text and files, by dotted keys."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import read_toml, write_text
from jbeamshell.mechanics.friction import law_name
from jbeamshell.scene.keys import KEYS, LENGTHS, NUMBERS, TWINS
from jbeamshell.scene.parts import PARTS, Load
from jbeamshell.scene.rows import AUTO
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.width import halves, is_total

NEIGHBOURS = 4  # numbers on both sides of a total, of which one gives the same scene
FEW_DIGITS = {4: 6, 8: 12}  # of a number that somebody wrote, by the bytes of its precision


def scene_from_values(values: Mapping[str, Any]) -> Scene:
    """Scene from dotted keys on top of the standard strip."""
    control, kind = values.get("load.control", "force"), values.get("load.kind", "force")
    if (control in LENGTHS or kind == "moment") and "load.amplitude" not in values:
        return Scene(load=Load(control, kind))  # raises: the amplitude is missing
    return Scene().replace(values)


def overridden(values: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Dotted keys with others on top, in which ``half_height`` replaces ``height_ratio``, etc."""
    displaced = {TWINS[key] for key in overrides if key in TWINS}
    return {k: v for k, v in values.items() if k not in displaced} | dict(overrides)


def read_values(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Values of a TOML file by dotted key."""
    values: dict[str, Any] = {}
    for section, table in read_toml(path).items():
        if section not in PARTS:
            raise InputError(
                f"{path}: unknown section {section!r}; sections are {', '.join(PARTS)}"
            )
        if not isinstance(table, dict):
            raise InputError(f"{path}: {section} must be a table: write [{section}] above its keys")
        values |= {f"{section}.{name}": value for name, value in table.items()}
    return values


def read_scene(path: str | os.PathLike[str]) -> Scene:
    """Scene of a TOML file; keys that it leaves out are those of ``Scene()``.

    Raises
    ------
    InputError
        if the file cannot be read, is no TOML, or describes no scene

    Warns
    -----
    UserWarning
        if the file does not say how the load enters
    """
    values = read_values(path)
    scene = scene_from_values(values)
    note = entry_note(values)
    if note:
        warnings.warn(f"{path}: {note}", stacklevel=2)
    return scene


def entry_note(values: Mapping[str, Any]) -> str:
    """Sentence on what a file means that does not say how its load enters; else empty."""
    if "load.entry" in values or values.get("load.cycles") == 0:
        return ""
    return (
        "load.entry is not given and read as 'member', a member that goes on beyond the contact; "
        "say it, or 'face', 'guided' or 'traction'"
    )


def scene_to_toml(scene: Scene) -> str:
    """TOML text of a scene; `read_scene` makes the same scene of it, to the last bit.

    What two keys can say is written by the one that was given.  Settings that the scene left open
    are written as such; write ``scene.pinned()`` to keep what was chosen.
    """
    require("scene", scene, isinstance(scene, Scene), "give a jbeamshell.Scene")
    if scene.energy is not None or not isinstance(law_name(scene.contact.law), str):
        raise InputError(
            "energy, law: a function of your own cannot be written to TOML; keep it in code"
        )
    fix = "is a grid of its own, which no file holds: keep it in code"
    require("end_size", scene.model.end_size, scene.model.end_size == AUTO, fix)
    tables: dict[str, dict[str, Any]] = {heading: {} for heading in PARTS}
    bolts = _bolts(scene)
    for key in KEYS:
        heading, name = key.split(".")
        value = bolts[key] if key in bolts else scene.get(key)
        if key == "strip.plane":
            value = scene.strip.given_plane
        if value is None or scene.strip.derives(key):  # such as no layers
            continue
        if key in NUMBERS:
            value = _shortest(_total(scene, key, value))
        if key == "contact.smoothing" and np.isinf(value):
            value = "sharp"
        tables[heading][name] = list(value) if isinstance(value, tuple) else value
    return tomli_w.dumps(tables)


def _bolts(scene: Scene) -> dict[str, Any]:
    """Bolts, if the pressures are theirs, and None for what follows from them, by key."""
    given, none = scene.contact, {"contact.bolts": None}
    if given.bolts is None:
        return none
    rows = _rounded(scene.get("contact.bolts"))
    copy = scene.replace({"contact.bolts": rows}).contact
    if not np.array_equal(copy.pressure, given.pressure):
        return none
    said = {"contact.bolts": rows, "contact.pressure": None}
    if given.bolted and np.array_equal(copy.bottom_pressure, given.bottom_pressure):
        said["contact.bottom_pressure"] = None
    return said


def _rounded(value: Any) -> NDArray[Any]:
    """Numbers without the digits that only round-off makes, of the same precision."""
    array = np.asarray(value)
    digits = FEW_DIGITS[array.dtype.itemsize]
    few = [float(f"{number:.{digits}g}") for number in array.ravel()]
    return np.asarray(few, array.dtype).reshape(array.shape)


def _total(scene: Scene, key: str, value: Any) -> Any:
    """Number that gives the same scene to the last bit: a total is rounded as it is divided."""
    width = scene.strip.width
    if width is None or key == "contact.bolts" or not is_total(key, scene.load.control):
        return value
    heading, name = key.split(".")
    held, value = getattr(getattr(scene, heading), name), np.asarray(value)
    near = [_rounded(value), value]
    for way in (np.inf, -np.inf):
        step = value
        for _ in range(NEIGHBOURS):
            step = np.nextafter(step, np.asarray(way, value.dtype))
            near.append(step)
    whole = width * halves(key, scene.member.support)
    return next((one for one in near if one * (1.0 / whole) == held), value)


def _shortest(value: Any) -> Any:
    """Number, or lists of numbers, in the fewest digits that mean the same in their precision."""
    array = np.asarray(value)
    numbers = [float(str(number)) for number in array.ravel()]
    return np.asarray(numbers, float).reshape(array.shape).tolist()


def write_scene(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write the scene as TOML, whole or not at all."""
    write_text(path, scene_to_toml(scene))

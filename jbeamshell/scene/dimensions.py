"""Dimensions of a real specimen, with units, as values of a scene in SI.

Forces of a scene are per unit width, so N/m.  X runs from the supported end to the loaded one.

The pressure of a bolt is even over the patch where its pressure cone meets the contact. The cone
widens from the head, or the washer, of width d at 30 degrees to its axis, as is usual for clamped
plates (Shigley, Mechanical Engineering Design, 10th ed., section 8-5; VDI 2230 part 1).  It goes
through the whole thickness 2H, so the patch is d + 2 (2H) tan 30 = d + 4 H tan 30 wide.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from jbeamshell.common.checks import require, shown
from jbeamshell.common.errors import InputError
from jbeamshell.measured.columns import factor_of
from jbeamshell.scene.dimension_table import DIMENSIONS

HALF_ANGLE = math.radians(30.0)
HEAD = 1.5  # bearing diameter of a bolt's head over its nominal one (Shigley, table A-29)
# Stress areas of coarse metric threads [m^2] by nominal diameter [m] (Shigley, table 8-1).
STRESS_AREA = {
    1e-3 * diameter: 1e-6 * area
    for diameter, area in (
        *((3, 5.03), (4, 8.78), (5, 14.2), (6, 20.1), (8, 36.6), (10, 58.0), (12, 84.3)),
        *((14, 115.0), (16, 157.0), (20, 245.0), (24, 353.0), (30, 561.0), (36, 817.0)),
    )
}
PRELOAD = 0.75 * 600e6  # usual preload over stress area [Pa], property class 8.8 (section 8-9)
ROUNDING = 1e-9  # part of the length within which two ends of patches are one

KEYS = {
    "length": "strip.length",
    "modulus": "strip.youngs_modulus",
    "poisson": "strip.poisson_ratio",
    "pressure": "contact.pressure",
}
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
QUANTITY = re.compile(rf"\s*({NUMBER})\s*([^\d\s.+-].*?)?\s*")
KIND = re.compile(r"\s*(?:(\d+)\s*[x*]\s*)?([^@]+)@(.+)")


class Dimensions(NamedTuple):
    """Dimensions of a specimen in SI.

    Attributes
    ----------
    values : values of a scene by dotted key; forces are per unit width
    width : width [m], None if it is not known
    notes : sentences on what was taken for granted
    """

    values: dict[str, Any]
    width: float | None
    notes: tuple[str, ...]


def dimensions_of(texts: Mapping[str, Any]) -> Dimensions:
    """Dimensions from texts with units; what is left out is not known.

    Parameters
    ----------
    texts : texts by name, one of `DIMENSIONS`: length, thickness, width, modulus, poisson (a
        number), pressure or bolts, head

    Raises
    ------
    InputError
        for an unknown name or unit, a number without unit, a bolt off the strip, and bolts whose
        pressure is not determined, naming the fix

    Examples
    --------
    >>> steel = dimensions_of({"length": "120 mm", "thickness": "12 mm", "modulus": "210 GPa"})
    >>> steel.values["strip.half_height"], steel.values["strip.youngs_modulus"]
    (0.006, 210000000000.0)
    """
    for name in texts:
        if name not in DIMENSIONS:
            raise InputError(f"{name!r}: is no dimension; known are {', '.join(DIMENSIONS)}")
    sizes = {name: _size(name, text) for name, text in texts.items() if name != "bolts"}
    values: dict[str, Any] = {KEYS[name]: sizes[name] for name in KEYS if name in sizes}
    if "thickness" in sizes:
        values["strip.half_height"] = 0.5 * sizes["thickness"]
    notes: tuple[str, ...] = ()
    if "bolts" in texts:
        values["contact.bolts"], notes = _bolted(texts["bolts"], sizes)
    elif "head" in texts:
        raise InputError(f"head = {texts['head']!r}: belongs to bolts: give bolts, or leave it out")
    return Dimensions(values, sizes.get("width"), notes)


def quantity(name: str, text: Any, unit: str, example: str) -> float:
    """Positive number in a base unit from a text such as "120 mm".

    Parameters
    ----------
    name : name for messages
    text : number and unit
    unit : base unit, "m", "N" or "Pa"
    example : text that would do

    Raises
    ------
    InputError
        if it is no positive number, or if its unit is missing or of another kind
    """
    match = QUANTITY.fullmatch(text) if isinstance(text, str) else None
    if match is None or match[2] is None:
        number = match is not None or (isinstance(text, int | float) and not isinstance(text, bool))
        fix = "names no unit" if number else "is no number with a unit"
        raise InputError(f"{name} = {shown(text)}: {fix}: write one, such as {example}")
    factor = factor_of(match[2], (unit,))
    if factor is None:
        fix = f"{match[2][:20]!r} is no unit that {unit} measures: write {example}"
        raise InputError(f"{name} = {text!r}: {fix}")
    value = float(match[1]) * factor
    require(name, text, 0.0 < value < math.inf, "must be positive")
    return value


def _size(name: str, text: Any) -> float:
    unit, example, _ = DIMENSIONS[name]
    if unit:
        return quantity(name, text, unit, example)
    try:
        return float(text)
    except (TypeError, ValueError):
        raise InputError(f"{name} = {shown(text)}: give a number, such as {example}") from None


def _bolted(text: Any, sizes: Mapping[str, float]) -> tuple[list[list[float]], tuple[str, ...]]:
    """Bolts as rows [X, force per width, width of the patch], and notes."""
    require("bolts", text, "pressure" not in sizes, "give either bolts or a pressure")
    for name in ("length", "thickness", "width"):
        fix = f"their pressure needs {name}: give it, such as {name} = {DIMENSIONS[name].example}"
        require("bolts", text, name in sizes, fix)
    length, notes, patches = sizes["length"], [], []
    kinds = text if isinstance(text, list | tuple) else str(text).split(";")
    for kind in kinds:
        force, places = _bolts(kind)
        head = sizes.get("head") or _usual_head(kind, force)
        if "head" not in sizes:
            notes.append(
                f"bolts {kind}: a head of {1e3 * head:.3g} mm is taken, that of the smallest 8.8 "
                "bolt for this preload: give head to change it"
            )
        reach = 0.5 * head + sizes["thickness"] * math.tan(HALF_ANGLE)
        for place in places:
            fix = f"X = {1e3 * place:.6g} mm lies off the strip of {1e3 * length:.6g} mm"
            require("bolts", kind, place <= length, fix)
            low, high = max(place - reach, 0.0), min(place + reach, length)
            patches.append((low, high, force / sizes["width"] / (high - low)))
    return _apart(patches, length), tuple(notes)


def _bolts(text: Any) -> tuple[float, list[float]]:
    """Preload [N] and positions [m] of some bolts alike."""
    example = DIMENSIONS["bolts"].example
    match = KIND.fullmatch(text) if isinstance(text, str) else None
    if match is None:
        raise InputError(f"bolts = {shown(text)}: write number, preload and positions: {example}")
    force = quantity("bolts: preload", match[2].strip(), "N", "8kN")
    places = [
        quantity("bolts: position", place.strip(), "m", "30mm") for place in match[3].split(",")
    ]
    count = len(places) if match[1] is None else int(match[1])
    fix = f"{count} bolts have {len(places)} positions: give one position for each"
    require("bolts", text, count == len(places), fix)
    return force, places


def _usual_head(kind: str, force: float) -> float:
    """Bearing diameter [m] of the smallest bolt of property class 8.8 that carries a preload."""
    fits = [diameter for diameter, area in STRESS_AREA.items() if PRELOAD * area >= force]
    require("bolts", kind, bool(fits), "no bolt up to M36 carries that usually: give head too")
    return HEAD * fits[0]


def _apart(patches: list[tuple[float, float, float]], length: float) -> list[list[float]]:
    """Rows of bolts for the sum of even pressures p between low and high, which may overlap."""
    ends = sorted({0.0, length, *(end for low, high, _ in patches for end in (low, high))})
    edges = [0.0]
    for end in ends[1:]:
        if end - edges[-1] > ROUNDING * length:
            edges.append(end)
    edges[-1] = length
    rows = []
    for start, stop in itertools.pairwise(edges):
        middle = 0.5 * (start + stop)
        pressure = float(np.sum([p for low, high, p in patches if low < middle < high]))
        if pressure > 0.0:
            width = stop - start
            rows.append([start + 0.5 * width, pressure * width, width])
    return rows

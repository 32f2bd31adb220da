"""Dimensions of a real specimen or lap joint, with units, as values of a scene in SI.

X runs from the supported end to the loaded one.  A bolt presses evenly on a patch under its head,
see `jbeamshell.scene.bolts`.
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
from jbeamshell.scene.bolts import FRICTION, PART_OF_HEAD, SIZES, TIGHTENING, Bolt, patch_width
from jbeamshell.scene.dimension_table import ALL
from jbeamshell.scene.quantities import quantity

PROOF = 0.75  # usual part of the proof load, by which the head of a preload is guessed
SPREAD = 3.0  # patches across that a bolt clamps, beyond which force does not spread evenly
ROUNDING = 1e-9  # part of the length within which two ends of patches are one

KEYS = {
    "length": "strip.length",
    "width": "strip.width",
    "modulus": "strip.youngs_modulus",
    "poisson": "strip.poisson_ratio",
    "pressure": "contact.pressure",
    "friction": "contact.friction",
    "force": "load.amplitude",
}
JOINTS = {"single-lap": "clamped", "double-lap": "rolling"}
OF_JOINT = ("overhang", "other_thickness")
OF_BOLTS = ("torque", "proof", "grade", "thread_friction", "head")
KIND = re.compile(r"\s*(?:(\d+)\s*[x*]\s*)?([^@]+)@(.+)")
SIZED = re.compile(r"(M\s*\d+(?:\s*x\s*\d*\.?\d+)?)(?:[\s-]+(\S+))?")


class Dimensions(NamedTuple):
    """Dimensions of a specimen in SI.

    Attributes
    ----------
    values : values of a scene by dotted key; forces are those of the whole width, if it is known
    notes : sentences on what was taken for granted
    bolts : bolts in words, a sentence for each kind
    scatter : half the range of the bolts' preloads over their mean
    """

    values: dict[str, Any]
    notes: tuple[str, ...] = ()
    bolts: tuple[str, ...] = ()
    scatter: float = 0.0

    @property
    def width(self) -> float | None:
        """Width [m], None if it is not known."""
        return self.values.get("strip.width")


def dimensions_of(texts: Mapping[str, Any]) -> Dimensions:
    """Dimensions from texts with units; what is left out is not known.

    Parameters
    ----------
    texts : texts by name, those of `jbeamshell.scene.dimension_table`

    Raises
    ------
    InputError
        for an unknown name or unit, a number without unit, a bolt off the strip or loaded beyond
        its proof load, and bolts whose pressure is not determined, naming the fix

    Examples
    --------
    >>> steel = dimensions_of({"length": "120 mm", "thickness": "12 mm", "modulus": "210 GPa"})
    >>> steel.values["strip.half_height"], steel.values["strip.youngs_modulus"]
    (0.006, 210000000000.0)
    """
    for name in texts:
        if name not in ALL:
            raise InputError(f"{name!r}: is no dimension; known are {', '.join(ALL)}")
    sizes = {name: _size(name, text) for name, text in texts.items() if ALL[name].unit != "word"}
    totals: dict[str, Any] = {KEYS[name]: sizes[name] for name in KEYS if name in sizes}
    if "thickness" in sizes:
        totals["strip.half_height"] = 0.5 * sizes["thickness"]
    if "force" in texts:
        fix = "is that of a whole width: give width, such as width = 50mm"
        require("force", texts["force"], "width" in sizes, fix)
    totals |= _lap(texts, sizes)
    if "bolts" in texts:
        return _bolted(texts, sizes, totals)
    for name in OF_BOLTS:
        fix = "belongs to bolts: give bolts, or leave it out"
        require(name, texts.get(name), name not in texts, fix)
    return Dimensions(totals, scatter=_scatter(sizes, 1.0))


def _lap(texts: Mapping[str, Any], sizes: Mapping[str, float]) -> dict[str, Any]:
    """Values of a lap joint; none of a strip on a base."""
    joint = texts.get("joint")
    if joint is None:
        for name in OF_JOINT:
            fix = "belongs to a joint: give joint = single-lap or double-lap"
            require(name, texts.get(name), name not in texts, fix)
        return {}
    require("joint", joint, joint in JOINTS, f"choose {' or '.join(JOINTS)}")
    support = JOINTS[joint]
    found: dict[str, Any] = {"member.support": support, "strip.far_end": "free"}
    found["member.assembly"] = "frictional"  # as bolts are tightened
    if support == "clamped":
        found["member.loaded_end"] = "level"
        if "pressure" in sizes:
            found["contact.bottom_pressure"] = sizes["pressure"]
    if "overhang" in sizes:
        found |= dict.fromkeys(("strip.overhang", "member.overhang"), sizes["overhang"])
    usual = {"clamped": 1.0, "rolling": 2.0}[support] * sizes.get("thickness", math.nan)
    other = sizes.get("other_thickness", usual)
    if "length" in sizes and math.isfinite(other):
        # The symmetry plane of a double lap halves its inner plate.
        half = other if support == "clamped" else 0.5 * other
        found["member.height_ratio"] = half / sizes["length"]
    return found


def _size(name: str, text: Any) -> float:
    unit, example, _ = ALL[name]
    if unit:
        return quantity(name, text, unit, example)
    try:
        return float(text)
    except (TypeError, ValueError):
        raise InputError(f"{name} = {shown(text)}: give a number, such as {example}") from None


def _bolted(
    texts: Mapping[str, Any], sizes: Mapping[str, float], totals: dict[str, Any]
) -> Dimensions:
    """Dimensions with bolts as rows [X, force, width of the patch]."""
    text = texts["bolts"]
    require("bolts", text, "pressure" not in sizes, "give either bolts or a pressure")
    for name in ("length", "width"):
        fix = f"their pressure needs {name}: give it, such as {name} = {ALL[name].example}"
        require("bolts", text, name in sizes, fix)
    length, notes, words, patches = sizes["length"], [], [], []
    rows: list[tuple[str, float, float]] = []
    scatter = 0.0
    kinds = text if isinstance(text, list | tuple) else str(text).split(";")
    for kind in kinds:
        what, places = _placed(kind)
        sized = SIZED.fullmatch(what)
        if sized is not None:
            bolt = _of_size(sized, texts, sizes)
            force, patch = bolt.preload, 1e-3 * bolt.patch
            scatter = max(scatter, bolt.scatter)
            words.append(str(bolt))
            _check_hole(kind, bolt, sizes["width"])
        else:
            force = quantity("bolts: preload", what, "N", "8kN")
            for name in ("torque", "proof", "grade"):
                fix = (
                    f"{kind.strip()} has a preload already: leave it out, or give a size such as M8"
                )
                require(name, texts.get(name), name not in texts, fix)
            head = sizes.get("head") or _usual_head(kind, force)
            patch = patch_width(head, PART_OF_HEAD * head)
            scatter = max(scatter, _scatter(sizes, 1.0))
            if "head" not in sizes:
                notes.append(
                    f"bolts {kind}: a head of {1e3 * head:.3g} mm is taken, that of the smallest "
                    "8.8 bolt for this preload: give head to change it"
                )
        rows += [(kind.strip(), place, patch) for place in places]
        for place in places:
            fix = f"X = {1e3 * place:.6g} mm lies off the strip of {1e3 * length:.6g} mm"
            require("bolts", kind, place <= length, fix)
            low, high = max(place - 0.5 * patch, 0.0), min(place + 0.5 * patch, length)
            patches.append((low, high, force / (high - low)))
    notes += _too_wide(rows, sizes["width"])
    totals = totals | {"contact.bolts": _apart(patches, length)}
    return Dimensions(totals, tuple(notes), tuple(words), scatter)


def _of_size(sized: re.Match[str], texts: Mapping[str, Any], sizes: Mapping[str, float]) -> Bolt:
    """Bolt of a size, tightened as the dimensions say."""
    if not {"torque", "proof"} & set(texts):
        fix = "says no preload: give torque, such as torque = 25Nm, or proof, such as proof = 0.75"
        raise InputError(f"bolts = {sized[0]!r}: {fix}")
    head = 1e3 * sizes["head"] if "head" in sizes else None
    return Bolt(
        sized[1],
        sized[2] or str(texts.get("grade", "8.8")),
        texts.get("torque"),
        sizes.get("proof"),
        friction=sizes.get("thread_friction", FRICTION),
        tightening=sizes.get("tightening", TIGHTENING),
        head=head,
    )


def _check_hole(kind: str, bolt: Bolt, width: float) -> None:
    """Refuse a hole that is as wide as the plate."""
    fix = f"its hole of {bolt.holed:g} mm leaves nothing of a plate {1e3 * width:g} mm wide: "
    require("bolts", kind, bolt.holed < 999.999 * width, f"{fix}take a smaller bolt, or give width")


def _too_wide(rows: list[tuple[str, float, float]], width: float) -> list[str]:
    """Sentence on plates that are wider than their bolts clamp; none where they are not.

    Beside finite elements, see `calibration/finite_elements/bolt_patch.py`.
    """
    for kind, place, patch in rows:
        beside = sum(abs(other - place) < 0.5 * patch for _, other, _ in rows)
        if width > SPREAD * patch * beside:
            return [
                f"doubtful: {kind}: {beside} side by side at X = {1e3 * place:g} mm clamp some "
                f"{1e3 * SPREAD * patch * beside:.0f} mm of plates {1e3 * width:g} mm wide, over "
                "which the plane model spreads force and pressure evenly: the joint is softer, and "
                "may lose half as much again"
            ]
    return []


def _scatter(sizes: Mapping[str, float], usual: float) -> float:
    """Half the range of preloads over their mean, by the tightening factor."""
    factor = sizes.get("tightening", usual)
    fix = "is the largest preload over the smallest: give 1, or more, such as 1.6"
    require("tightening", factor, 1.0 <= factor < math.inf, fix)
    return (factor - 1.0) / (factor + 1.0)


def _placed(text: Any) -> tuple[str, list[float]]:
    """Size or preload of some bolts alike, and their positions [m]."""
    example = ALL["bolts"].example
    match = KIND.fullmatch(text) if isinstance(text, str) else None
    if match is None:
        raise InputError(f"bolts = {shown(text)}: write number, preload and positions: {example}")
    places = [
        quantity("bolts: position", place.strip(), "m", "30mm") for place in match[3].split(",")
    ]
    count = len(places) if match[1] is None else int(match[1])
    fix = f"{count} bolts have {len(places)} positions: give one position for each"
    require("bolts", text, count == len(places), fix)
    return match[2].strip(), places


def _usual_head(kind: str, force: float) -> float:
    """Bearing diameter [m] of the smallest bolt of property class 8.8 that carries a preload."""
    bolts = (Bolt(f"M{size}", proof=PROOF) for size in SIZES)
    fits = [bolt.bearing for bolt in bolts if bolt.preload >= force]
    require("bolts", kind, bool(fits), "no bolt up to M36 carries that usually: give head too")
    return 1e-3 * fits[0]


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

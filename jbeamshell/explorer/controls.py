"""Controls of a scene: the numbers that sliders move, with labels, units and ranges."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from jbeamshell.common.errors import InputError
from jbeamshell.plotting.shapes import round_down
from jbeamshell.scene.keys import unit_of
from jbeamshell.scene.scene import Scene

STEPS = 200  # of a slider, about
BELOW, ABOVE = 0.1, 4.0  # range of a slider, in parts of the scene's own number
NEAR_GROSS_SLIP = 0.99  # part of gross slip up to which the slider of a force goes
LARGEST_RATIO = 0.49  # Poisson's ratio
HEIGHTS = {
    "strip.height_ratio": "Height ratio η = H/(L/2)",
    "strip.half_height": "Half height H [length]",
}
FACTOR = "pressure factor"
BOLT = "bolt {} {}"  # number of the bolt, and "force" or "place"


class Control(NamedTuple):
    """Number of a scene that a slider moves.

    Attributes
    ----------
    name : dotted key, or a name of this module for what is no key of its own
    label : words with symbol and unit
    value : number of the scene
    low, high, step : range of the slider, and its step
    """

    name: str
    label: str
    value: float
    low: float
    high: float
    step: float


def controls_of(scene: Scene) -> tuple[Control, ...]:
    """Controls of a scene; numbers that it does not have, or that change nothing, have none."""
    return tuple(_controls(scene))


def _controls(scene: Scene) -> Iterator[Control]:
    strip, contact, load = scene.strip, scene.contact, scene.load
    if strip.layers is None:
        key = strip.given_height.key  # as it was given, so that the scene's text stays so
        yield _around(key, HEIGHTS[key], float(scene.get(key)))
    if strip.width is not None:
        yield _around("strip.width", "Width b [length]", float(scene.get("strip.width")))
    if scene.member.support != "none" and scene.member.layers is None and strip.layers is None:
        below = float(scene.member.beside(strip).height_ratio)
        yield _around("member.height_ratio", "Height ratio of the lower member η₂", below)
    if load.cycles and float(contact.friction) > 0.0:
        yield _around("contact.friction", "Friction μ", float(contact.friction))
    if load.cycles:
        yield _load(scene)
    yield from _pressure(scene)
    if strip.layers is None:
        ratio = float(scene.get("strip.poisson_ratio"))
        low, high = min(ratio, 0.0), max(ratio, LARGEST_RATIO)
        yield Control("strip.poisson_ratio", "Poisson's ratio nu", ratio, low, high, 0.005)


def _load(scene: Scene) -> Control:
    """Control of the amplitude, below gross slip where a force is controlled."""
    key, whole = "load.amplitude", scene.strip.width is not None
    amplitude = float(scene.get(key))
    label = f"Load amplitude A [{unit_of(key, scene.load, whole)}]"
    limit = largest_force(scene)
    if scene.load.control != "force" or not math.isfinite(limit):
        return _around(key, label, amplitude)
    low, high = 0.02 * limit, NEAR_GROSS_SLIP * limit
    return Control(key, label, amplitude, low, max(high, amplitude), round_down(limit / STEPS))


def _pressure(scene: Scene) -> Iterator[Control]:
    """Controls of the bolts, of an even pressure, or of a factor of tables of pressure."""
    contact = scene.contact
    rows, length = bolts_of(scene), float(scene.strip.length)
    if rows is not None:
        for number, (place, force, width) in enumerate(rows.tolist(), 1):
            name = f"Bolt {number}" if len(rows) > 1 else "Bolt"
            unit = "force/width" if scene.strip.width is None else "force"
            label = f"{name}: force [{unit}]"
            yield _around(BOLT.format(number, "force"), label, force)
            low, high = 0.5 * width, length - 0.5 * width
            if high > low:
                label = f"{name}: place X [length]"
                step = round_down((high - low) / STEPS)
                yield Control(BOLT.format(number, "place"), label, place, low, high, step)
    elif contact.pressure.ndim == 0 and contact.bottom_pressure.ndim == 0:
        label = "Pressure F_N [stress]"
        yield _around("contact.pressure", label, float(contact.pressure))
    else:
        yield _around(FACTOR, "Pressures, times the scene's [1]", 1.0)


def bolts_of(scene: Scene) -> np.ndarray | None:
    """Bolts (k, 3) of X, force and width if they are all that presses the scene, else None."""
    contact = scene.contact
    if contact.bolts is None:
        return None
    clamped = scene.member.support == "clamped"
    below = np.asarray(contact.pressure if clamped else 0.0)
    same = np.array_equal(np.asarray(contact.bottom_pressure), below)
    return np.array(scene.get("contact.bolts"), dtype=float) if same else None


def largest_force(scene: Scene) -> float:
    """Force at which all of the contact slides; infinite where something else holds."""
    shanks = scene.member.bolt_stiffness is not None
    return math.inf if shanks else float(scene.gross_slip)


def scene_at(scene: Scene, values: Mapping[str, float]) -> Scene:
    """Scene with numbers of its controls, by their names.

    Raises
    ------
    InputError
        if a number lies outside its domain, or numbers do not go together
    """
    changes: dict[str, Any] = {}
    rows = bolts_of(scene)
    for name, value in values.items():
        if name == FACTOR:
            for key in ("contact.pressure", "contact.bottom_pressure"):
                changes[key] = _scaled(scene.number(key), value)
        elif name.startswith("bolt "):
            _, number, what = name.split()
            if rows is None:
                raise InputError(f"{name}: the scene has no bolts")
            rows[int(number) - 1, 0 if what == "place" else 1] = value
            changes["contact.bolts"] = rows
        else:
            changes[name] = value
    return scene.replace(changes)


def _scaled(pressure: np.ndarray, factor: float) -> np.ndarray:
    """Pressure, or the pressures of a table, times a factor."""
    if pressure.ndim == 0:
        return pressure * factor
    return np.stack([pressure[:, 0], pressure[:, 1] * factor], axis=1)


def _around(name: str, label: str, value: float) -> Control:
    """Control of a positive number around the scene's own."""
    size = abs(value)
    step = round_down((ABOVE - BELOW) * size / STEPS)
    low, high = (step * max(round(part * size / step), 1) for part in (BELOW, ABOVE))
    return Control(name, label, value, low, high, step)

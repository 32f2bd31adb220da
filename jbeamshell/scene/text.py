"""Text of a scene: its numbers with their units, and what differs from the standard strip."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from jbeamshell.common.checks import is_traced
from jbeamshell.common.summary import Summary
from jbeamshell.mechanics.homogeneous import PLANES
from jbeamshell.scene import mounting
from jbeamshell.scene.forms import HOLDERS
from jbeamshell.scene.keys import TABLE, unit_of
from jbeamshell.scene.linearisation import Parts as Plain
from jbeamshell.scene.planning import in_words

ALWAYS = {
    *("strip.length", *HOLDERS, "strip.poisson_ratio"),
    *("contact.friction", "contact.pressure", "load.control", "load.amplitude"),
}
TITLE = ("model.section", "model.kinematics", "model.nodes")


class Parts(Plain, Protocol):
    """Scene, whose values are read by their keys."""

    def get(self, key: str) -> Any: ...


def summary(scene: Parts, own_energy: bool) -> Summary:
    """Numbers of a scene, and its words and settings that differ from the standard strip.

    Parameters
    ----------
    scene : scene
    own_energy : True if it has a strain energy of the user's own
    """
    rows = []
    for name, key in TABLE.items():
        follows = name == "contact.bolts" or scene.strip.derives(name)
        if follows or name in TITLE:
            continue
        value = scene.get(name)
        plane = name == "strip.plane" and value != PLANES[0]
        if value is None or not (name in ALWAYS or plane or _differs(value, key.default)):
            continue
        whole = scene.strip.width is not None
        unit = unit_of(name, scene.load, whole) if key.kind == "number" else ""
        rows.append((name, _shown(value) + (f"  [{unit}]" if unit not in ("", "1") else "")))
    energy = " with a strain energy of its own" * own_energy
    title = f"Strip{energy}: {scene.plan}"
    notes = in_words(scene), mounting.in_words(scene)
    return Summary(title, rows, tuple(filter(None, notes)))


def _differs(value: Any, default: Any) -> bool:
    if is_traced(value):
        return True
    if isinstance(default, float | int) and not isinstance(default, bool):
        number = np.asarray(value)
        return number.ndim > 0 or float(number) != float(default)
    return bool(default is None or _shown(value) != _shown(default)) and default != "auto"


def _shown(value: Any) -> str:
    """Value in words: a number to six digits, a table by its rows."""
    if is_traced(value):
        return "traced"
    if isinstance(value, tuple):
        return ",".join(map(str, value))
    if isinstance(value, str):
        return value
    array = np.asarray(value)
    if array.ndim == 0:
        return f"{array.item():.6g}" if array.dtype.kind == "f" else str(array.item())
    return f"table of {len(array)} rows"

"""Standard strip as it is solved in the studies."""

from collections.abc import Mapping
from typing import Any

import jbeamshell as jb


def in_load_steps() -> jb.Scene:
    """Standard strip, held down, in load steps with exact rotations; a study changes the rest."""
    held = {"model.kinematics": "exact", "contact.normal": "held"}
    return jb.library.standard().replace(held).by_load_steps()


def changed(scene: jb.Scene, values: Mapping[str, Any]) -> jb.Scene:
    """Scene with other values, by dotted key.

    Two words that are no keys may stand among them: ``by``, which is "steps" for load steps, and
    ``end_size``, the smallest elements over H.
    """
    scene = scene.replace({key: value for key, value in values.items() if "." in key})
    if values.get("by") == "steps":
        scene = scene.by_load_steps()
    size = values.get("end_size")
    return scene if size is None else scene.on_grid(scene.plan.nodes, size)

"""Unilateral contact by an active set, and by a compliance."""

from __future__ import annotations

from typing import Any

import numpy as np

import jbeamshell as jb
from calibration.methods.strips import CLAMP, number, scene_of
from jbeamshell.scene import library


def figures(stiffness: float | None, nodes: int = 401) -> dict[str, Any]:
    """The receding strip, whose contact ends just beyond X = 50; None is the active set.

    Returns
    -------
    contact_end over H from the end of the load, reaction_max over the pressure, the angle of the
    lifted end, Newton iterations, the deepest penetration over H
    """
    history = jb.solve(_with(library.receding().replace({"model.nodes": nodes}), stiffness))
    strip_, top = history.scene.strip, float(history.scene.contact.largest_pressure)
    half_height = float(strip_.half_height)
    return {
        "k_n": stiffness,
        "contact_end": number((float(history.contact_end[-1]) - 50.0) / half_height),
        "reaction_max": number(float(history.reaction_max[-1]) / top),
        "lift_slope": number(history.lift_slope[-1]),
        "iterations": int(np.sum(np.asarray(history.iterations))),
        "penetration": number(max(0.0, -float(np.min(np.asarray(history.gap)))) / half_height),
    }


def clamp(stiffness: float | None, nodes: int = 81) -> dict[str, Any]:
    """Dissipation of the receding clamp, and iterations per load step."""
    history = jb.solve(
        _with(scene_of(CLAMP, nodes, steps_per_half_cycle=20), stiffness), throw=False
    )
    return {
        "k_n": stiffness,
        "dissipation": number(history.dissipation),
        "iterations": number(np.mean(np.asarray(history.iterations))),
        "unfound": int(np.sum(np.asarray(history.status) > 0)),
    }


def _with(scene: jb.Scene, stiffness: float | None) -> jb.Scene:
    if stiffness is None:
        return scene
    return scene.replace({"contact.normal": "compliant", "contact.normal_stiffness": stiffness})

"""Histories in files.

A file is NumPy's .npz without any pickled object: the arrays of a history by name, the strip's
state after the last step among them, and one line of JSON with the scene's TOML.
"""

from __future__ import annotations

import dataclasses
import json
import os
from typing import Any

import jax
import numpy as np

from jbeamshell.common.checks import require
from jbeamshell.common.files import as_path, written_whole
from jbeamshell.scene.toml import scene_to_toml

FORMAT = "jbeamshell history 2"


def write_history(history: Any, path: str | os.PathLike[str]) -> None:
    """Write a history, whole or not at all; `InputError` for a scene with one's own functions."""
    about = {
        "format": FORMAT,
        "scene": scene_to_toml(history.scene),
        "dtype": history.x.dtype.name,
        "cycles": history.cycles,
    }
    target = as_path(path)
    require("path", str(path), target.suffix == ".npz", "end the name in .npz")
    arrays: dict[str, Any] = {name: np.asarray(leaf) for name, leaf in named_arrays(history)}
    with written_whole(target) as draft:
        np.savez(draft, about=np.array(json.dumps(about)), **arrays)


def named_arrays(history: Any) -> list[tuple[str, Any]]:
    """Arrays of a history by name, without those of the scene, which its TOML has."""
    leaves = jax.tree_util.tree_leaves_with_path(without_scene(history))
    return [
        (jax.tree_util.keystr(place, simple=True, separator="."), leaf) for place, leaf in leaves
    ]


def without_scene(history: Any) -> Any:
    """History whose scene is left out."""
    return dataclasses.replace(history, scene=None)

"""Writing of histories to files; `jbeamshell.read_history` reads them.

A file is an .npz of NumPy without pickled objects.  It holds the arrays of a history by name, and
as ``about`` one line of JSON: the format, the scene as TOML, the data type and the cycles.  A check
sum covers all of them.
"""

from __future__ import annotations

import dataclasses
import json
import os
from typing import Any

import jax
import numpy as np

from jbeamshell.common.arrays import write_arrays
from jbeamshell.common.checks import require
from jbeamshell.common.files import as_path
from jbeamshell.scene.rows import AUTO
from jbeamshell.scene.toml import scene_to_toml

FORMAT = "jbeamshell history 6"


def write_history(history: Any, path: str | os.PathLike[str]) -> None:
    """Write a history to a file, whole or not at all.

    Parameters
    ----------
    history : `jbeamshell.History` to write
    path : file to write, with the suffix .npz

    Raises
    ------
    InputError
        for another suffix, and for a scene with an energy or a law of the user's own
    """
    scene = history.scene.pinned()
    about = {
        "format": FORMAT,
        "scene": scene_to_toml(scene.but(model=scene.model.but(end_size=AUTO))),
        "end_size": scene.model.end_size,
        "dtype": history.x.dtype.name,
        "cycles": history.cycles,
    }
    target = as_path(path)
    require("path", str(path), target.suffix == ".npz", "end the name in .npz")
    arrays = {name: np.asarray(leaf) for name, leaf in named_arrays(history)}
    write_arrays(target, {"about": np.array(json.dumps(about)), **arrays})


def named_arrays(history: Any) -> list[tuple[str, Any]]:
    """Arrays of a history by name, without those of its scene, which go into the TOML."""
    leaves = jax.tree_util.tree_leaves_with_path(without_scene(history))
    return [
        (jax.tree_util.keystr(place, simple=True, separator="."), leaf) for place, leaf in leaves
    ]


def without_scene(history: Any) -> Any:
    """Copy of a history with None as its scene, and its fields above the contact as arrays."""
    return dataclasses.replace(history, scene=None, above=history.above.found)

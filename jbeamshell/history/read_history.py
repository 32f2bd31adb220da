"""Reader of the files that `History.save` writes."""

from __future__ import annotations

import dataclasses
import functools
import json
import os
import tomllib
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jbeamshell.common.arrays import read_arrays
from jbeamshell.common.errors import InputError, Status
from jbeamshell.common.files import as_path, check_regular
from jbeamshell.history.history import History
from jbeamshell.history.record import Above
from jbeamshell.history.saved import FORMAT, named_arrays, without_scene
from jbeamshell.mechanics.kinematics import FIELDS, Strains
from jbeamshell.scene.toml import scene_from_values

# Names of a history's arrays, by what their axes run along.
ALONG_X = ("x", "tributary", "load")
ALONG_PATH = (
    *("force", "displacement", "pressure", "target"),
    *("slip_work", "stored_energy", "sinking", "error"),
)
ALONG_BOTH = ("contact_v", "gap", "traction", "reaction")
COUNTS = ("iterations", "status")


def read_history(path: str | os.PathLike[str]) -> History:
    """Read a history from a file, equal to the last bit; nothing in the file is executed.

    Raises
    ------
    InputError
        if the file cannot be read, is damaged or of another format, or if it was written in double
        precision and JAX runs in single precision
    """
    check_regular(path)
    try:
        arrays = read_arrays(as_path(path))
        about = json.loads(str(arrays.pop("about")))
        if about["format"] != FORMAT:
            raise ValueError("of another format")
        precise = about["dtype"] != "float64" or jax.config.read("jax_enable_x64")
        blank = _blank(about, arrays) if precise else None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except Exception as error:  # a broken file may raise anything in a parser
        reason = f"{type(error).__name__}: {error}"[:200]
        raise InputError(f"{path}: cannot be read as a history ({reason}): save it again") from None
    if blank is None:
        fix = "write jax.config.update('jax_enable_x64', True) first"
        raise InputError(f"{path}: is in double precision: {fix}")
    for name, wanted in named_arrays(blank):
        held = arrays.get(name)
        if held is None or (held.shape, held.dtype) != (wanted.shape, wanted.dtype):
            raise InputError(f"{path}: {name} is missing or of another shape: save it again")
    converged = np.cumsum(arrays["status"] != Status.CONVERGED) == 0
    for name in ("force", "displacement", "above.fields", *ALONG_BOTH):
        if not np.all(np.isfinite(arrays[name][converged])):
            raise InputError(f"{path}: {name} holds NaN in a converged step: save it again")
    leaves = [jnp.asarray(arrays[name]) for name, _ in named_arrays(blank)]
    read: History = jax.tree.unflatten(jax.tree.structure(without_scene(blank)), leaves)
    return dataclasses.replace(read, scene=blank.scene)


def _blank(about: dict[str, Any], arrays: dict[str, np.ndarray]) -> History:
    """History of the scene in a file, with shapes in place of arrays."""
    tables = tomllib.loads(about["scene"])
    flat = {f"{part}.{name}": v for part, table in tables.items() for name, v in table.items()}
    scene = jax.tree.map(lambda leaf: leaf.astype(about["dtype"]), scene_from_values(flat))
    model = dataclasses.replace(scene.model, end_size=about["end_size"])
    scene = dataclasses.replace(scene, model=model)
    number = functools.partial(jax.ShapeDtypeStruct, dtype=jnp.dtype(about["dtype"]))
    count = functools.partial(jax.ShapeDtypeStruct, dtype=jnp.result_type(int))
    steps, elements = len(arrays["force"]), len(arrays["middles"])
    sections: list[Any] = [number((steps, elements))] * len(Strains._fields)
    nodes, width = scene.plan.nodes, len(FIELDS)
    fields: Any = number((steps, nodes, width))
    shapes: dict[str, Any] = {name: number((steps,)) for name in ALONG_PATH}
    shapes |= {name: count((steps,)) for name in COUNTS}
    shapes |= {name: number((nodes,)) for name in ALONG_X}
    shapes |= {name: number((steps, nodes)) for name in ALONG_BOTH}
    shapes |= {
        "middles": number((elements,)),
        "above": Above(fields, Strains(*sections)),
        "slipping": jax.ShapeDtypeStruct((steps, nodes), bool),
    }
    if scene.member.support != "none":
        member = number((steps, nodes, arrays["above.member"].shape[-1]))
        shapes["above"] = shapes["above"]._replace(member=member)
    shapes |= {name: number(()) for name in ("change", "overhung") if name in arrays}
    cycles = tuple((int(a), int(b), int(c)) for a, b, c in about["cycles"])
    return History(scene=scene, cycles=cycles, **shapes)

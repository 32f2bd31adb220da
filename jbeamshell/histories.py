"""Histories on disk, and load paths that go on from where one ended.

A file is NumPy's .npz without any pickled object: the arrays of a `History` by name, the strip's
state after the last step among them, and one line of JSON with the scene's TOML.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import os
import tomllib
import warnings
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jbeamshell.cycles import closed_cycles
from jbeamshell.errors import DoubtfulWarning, InputError
from jbeamshell.files import as_path, written_whole
from jbeamshell.history import History
from jbeamshell.kinematics import Strains
from jbeamshell.newton import Newton
from jbeamshell.parts import require
from jbeamshell.patterns import Foresight
from jbeamshell.quasistatic import check, check_solver, history_of, raise_if_failed
from jbeamshell.scene import Scene, scene_from_values, scene_to_toml
from jbeamshell.stepping import Path, State, Steps, at_rest, march, recover

FORMAT = "jbeamshell history 1"
# Arrays of a history by what they run along.
ALONG_X = ("x", "tributary", "load")
ALONG_PATH = (
    *("force", "displacement", "pressure", "target"),
    *("slip_work", "stored_energy", "sinking", "error"),
)
ALONG_BOTH = ("gap", "traction", "reaction")
COUNTS = ("iterations", "status")


def continued(
    history: History,
    path: ArrayLike | None = None,
    *,
    solver: Newton | None = None,
    throw: bool = True,
) -> History:
    """The history with further load steps, as `jbeamshell.solve` gives it of both paths in one.

    To the last bit, where both have two load steps or more; to round-off else.

    Parameters
    ----------
    history : solved step by step by `jbeamshell.solve`, or read from a file
    path : loads to go on with, as of `jbeamshell.solve`; None is the scene's own cycles once more,
        where the last load is its amplitude
    solver, throw : as of `jbeamshell.solve`

    Raises
    ------
    InputError
        if nothing can go on from the history, or the path makes no sense
    UnconvergedError
        if a step has no equilibrium, even when it is walked in smaller steps
    """
    check_solver(solver)
    _check_end(history)
    scene, solver = history.scene, solver or Newton()
    whole, _ = check(scene, path)
    pressing, half = scene.load.pressure_steps, scene.load.steps_per_half_cycle
    begun = pressing
    if path is None:
        last, amplitude = float(history.end.target), float(scene.load.amplitude)
        require("path", None, scene.load.cycles > 0, "the scene has no cycles: give the loads")
        fix = f"the last load is {last:.6g}, not load.amplitude = {amplitude:.6g}: give the loads"
        require("path", None, last == amplitude, fix)
        begun += max(half // 2, 1)
    further: Path = jax.tree.map(lambda column: np.asarray(column)[begun:], whole)
    # A single step would be compiled without its loop, and rounded otherwise.
    count, least = further.target.size, max(further.target.size, 2)
    walked: Path = jax.tree.map(lambda a: np.pad(a, (0, least - count), mode="edge"), further)
    steps = _march(scene, history.end, walked, Foresight.of(solver, checked=True))
    if not np.asarray(steps.state.sound)[count - 1]:
        steps = recover(scene, steps, walked, solver, history.end)
        if throw:
            part = jax.tree.map(lambda a: a[:count], steps)
            raise_if_failed(part, further, history.force.size)
    added = jax.tree.map(lambda a: a[:count], _steps_of(history_of(scene, steps, walked.pressure)))
    joined = jax.tree.map(lambda a, b: jnp.concatenate([a, b]), _steps_of(history), added)
    end = jax.tree.map(lambda a: a[count - 1], steps.state)
    known = np.append(0.0, np.asarray(joined["target"])[pressing:])
    cycles = tuple(
        (a + pressing - 1, b + pressing - 1, c + pressing - 1) for a, b, c in closed_cycles(known)
    )
    result = dataclasses.replace(history, **joined, end=end, cycles=cycles)
    if throw:
        for doubt in result.doubts:
            warnings.warn(f"doubtful: {doubt}", DoubtfulWarning, stacklevel=3)
    return result


@eqx.filter_jit
def _march(scene: Scene, start: State, path: Path, solver: Newton) -> Steps:
    return march(scene, start, path, solver)


def _check_end(history: History) -> None:
    """Whether there is a state to go on from."""
    solution = history.scene.model.solution
    fix = "keeps no state of the contact to go on from: take 'stepwise'"
    require("model.solution", solution, solution == "stepwise", fix)
    if history.end is None:
        raise InputError("history: was made by hand and has no end to go on from: solve it")
    if not bool(history.end.sound):
        raise InputError("history: its last step found no equilibrium: go on from one that did")


def _steps_of(history: History) -> dict[str, Any]:
    """The fields that have an entry for every step."""
    rest = {"scene", "cycles", "end", "middles", *ALONG_X}
    names = [field.name for field in dataclasses.fields(history) if field.name not in rest]
    return {name: getattr(history, name) for name in names}


# --- files ----------------------------------------------------------------------------------------


def write_history(history: History, path: str | os.PathLike[str]) -> None:
    """Write a history, whole or not at all; `InputError` for a scene with one's own functions."""
    about = {
        "format": FORMAT,
        "scene": scene_to_toml(history.scene),
        "dtype": history.x.dtype.name,
        "cycles": history.cycles,
    }
    target = as_path(path)
    require("path", str(path), target.suffix == ".npz", "end the name in .npz")
    arrays: dict[str, Any] = {name: np.asarray(leaf) for name, leaf in _named(history)}
    with written_whole(target) as draft:
        np.savez(draft, about=np.array(json.dumps(about)), **arrays)


def read_history(path: str | os.PathLike[str]) -> History:
    """The history in a file, to the last bit; nothing in the file is executed.

    Raises
    ------
    InputError
        for a file that cannot be read, is damaged or none of ours, and in single precision for one
        that was written in double
    """
    try:
        # A handle of our own: NumPy leaves its own open where the file is damaged.
        with as_path(path).open("rb") as handle, np.load(handle, allow_pickle=False) as file:
            about = json.loads(str(file["about"]))
            if about["format"] != FORMAT:
                raise ValueError("of another format")
            arrays = {name: file[name] for name in file.files if name != "about"}
        precise = about["dtype"] != "float64" or jax.config.read("jax_enable_x64")
        blank = _blank(about, arrays) if precise else None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except Exception as error:  # whatever a parser stumbles over in a broken file
        reason = f"{type(error).__name__}: {error}"[:200]
        raise InputError(
            f"{path}: is no history that can be read ({reason}): save it anew"
        ) from None
    if blank is None:
        fix = "write jax.config.update('jax_enable_x64', True) first"
        raise InputError(f"{path}: is in double precision: {fix}")
    for name, wanted in _named(blank):
        held = arrays.get(name)
        if held is None or (held.shape, held.dtype) != (wanted.shape, wanted.dtype):
            raise InputError(f"{path}: {name} is missing or of another shape: save it anew")
    leaves = [jnp.asarray(arrays[name]) for name, _ in _named(blank)]
    read: History = jax.tree.unflatten(jax.tree.structure(_without_scene(blank)), leaves)
    return dataclasses.replace(read, scene=blank.scene)


def _named(history: History) -> list[tuple[str, Any]]:
    """The arrays by name, those of the scene left out, which its TOML has."""
    leaves = jax.tree_util.tree_leaves_with_path(_without_scene(history))
    return [
        (jax.tree_util.keystr(place, simple=True, separator="."), leaf) for place, leaf in leaves
    ]


def _without_scene(history: History) -> History:
    nothing: Any = None
    return dataclasses.replace(history, scene=nothing)


def _blank(about: dict[str, Any], arrays: dict[str, np.ndarray]) -> History:
    """A history of the scene in a file, with shapes for arrays, as many steps as its loads."""
    tables = tomllib.loads(about["scene"])
    flat = {f"{part}.{name}": v for part, table in tables.items() for name, v in table.items()}
    scene = jax.tree.map(lambda leaf: leaf.astype(about["dtype"]), scene_from_values(flat))
    number = functools.partial(jax.ShapeDtypeStruct, dtype=jnp.dtype(about["dtype"]))
    count = functools.partial(jax.ShapeDtypeStruct, dtype=jnp.result_type(int))
    steps, elements = len(arrays["force"]), len(arrays["middles"])
    sections: list[Any] = [number((steps, elements))] * len(Strains._fields)
    nodes, width = scene.model.nodes, scene.model.width
    shapes: dict[str, Any] = {name: number((steps,)) for name in ALONG_PATH}
    shapes |= {name: count((steps,)) for name in COUNTS}
    shapes |= {name: number((nodes,)) for name in ALONG_X}
    shapes |= {name: number((steps, nodes)) for name in ALONG_BOTH}
    shapes |= {
        "middles": number((elements,)),
        "fields": number((steps, nodes, width)),
        "sections": Strains(*sections),
        "slipping": jax.ShapeDtypeStruct((steps, nodes), bool),
    }
    cycles = tuple((int(a), int(b), int(c)) for a, b, c in about["cycles"])
    stepwise = scene.model.solution == "stepwise"
    end = eqx.filter_eval_shape(at_rest, scene) if stepwise else None
    return History(scene=scene, cycles=cycles, end=end, **shapes)

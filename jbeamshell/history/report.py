"""Report of a run: tables, pictures, the scene and the figures as files in a folder."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import jax
import numpy as np
from numpy.typing import ArrayLike

from jbeamshell.common.errors import InputError
from jbeamshell.common.files import as_json, csv_text
from jbeamshell.history.history import History
from jbeamshell.plotting.folder import write_folder
from jbeamshell.scene.toml import scene_to_toml


def write_run(
    folder: Path,
    history: History,
    figures: Mapping[str, Any],
    units: Mapping[str, str] = MappingProxyType({}),
) -> list[Path]:
    """Write the files of a run, and return their paths.

    | file | content |
    |---|---|
    | ``loop.csv`` | force, displacement and convergence of every step |
    | ``profiles.csv`` | fields and contact along X at the `turning_steps` |
    | ``sections.csv`` | section forces along X at the `turning_steps` |
    | ``result.json`` | the figures |
    | ``scene.toml`` | the scene, unless it has an energy or a law of the user's own |
    | ``loop.png`` | the loop, if there are loads after the pressure |
    | ``profiles.png`` | slip, rotation, traction and reaction, if there are loads and friction |
    | ``contact.png`` | reaction, gap and squeeze, if w or psi is a field |
    | ``joint.png`` | the members of a lap joint, its loop, slip and pressure |

    Parameters
    ----------
    folder : folder to write into, made if it does not exist
    history : run to report
    figures : content of result.json, such as ``history.figures()``
    units : names of the scene's units by words such as "length", for the pictures
    """
    from jbeamshell.plotting import in_units

    history = jax.tree.map(np.asarray, history)  # quicker than JAX where nothing is compiled
    steps = turning_steps(history)
    texts = {
        "loop.csv": loop_table(history),
        "profiles.csv": profile_table(history, steps),
        "sections.csv": section_table(history, steps),
        "result.json": as_json(figures),
    }
    refined = history.change is not None  # which no file holds
    with contextlib.suppress(InputError):
        texts["scene.toml"] = scene_to_toml(history.scene if refined else history.scene.pinned())
    scene, drawn = history.scene, {}
    if history.force.size > history.pressed + 1:
        drawn["loop.png"] = history.plot()
        if float(scene.contact.friction) > 0.0:
            drawn["profiles.png"] = history.plot_profiles()
    if {"w", "psi"} & set(scene.plan.fields):
        drawn["contact.png"] = history.plot_contact()
    if scene.member.support != "none":
        drawn["joint.png"] = history.plot_joint() if history.cycles else history.plot_deformed()
    for axes in drawn.values():
        in_units(axes, units)
    pictures = {name: np.ravel(axes)[0].figure for name, axes in drawn.items()}
    return write_folder(folder, texts, pictures)


def turning_steps(history: History) -> list[int]:
    """Steps to look at: the end of the pressing, and where the first and the last cycle turn.

    These are the start of the first cycle, and the start, turn and end of the last.  A path without
    a cycle gives the first and the middle step of the pressing instead, and its last step.
    """
    pressed, end = history.pressed, history.force.size - 1
    marks = [pressed]
    if history.cycles:
        marks += [history.cycles[0][0], *history.cycles[-1]]
    else:
        marks += [0, pressed // 2, end]
    return sorted(set(marks))


def loop_table(history: History) -> str:
    """CSV of the load path, a row for every step; see `History.table` for its columns."""
    columns = history.table()
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return csv_text(tuple(columns), rows)


def profile_table(history: History, steps: Sequence[int]) -> str:
    """CSV of the fields and the contact, a row for every node at each of the steps."""
    names = ("slip", "w", "beta", "psi", "gap", "traction", "reaction", "slipping")
    columns = {name: getattr(history, name) for name in names}
    loads = {step: float(history.force[step]) for step in steps}
    rows = ((step, loads[step], *row) for step, *row in _along(history.x, columns, steps))
    return csv_text(("step", "force", "x", *names), rows)


def section_table(history: History, steps: Sequence[int]) -> str:
    """CSV of section forces and mean squeeze stress, a row for every element at each step."""
    names = ("N", "Q", "M", "chi", "xi")
    columns = dict(zip(names, history.sections, strict=True))
    columns["squeeze_stress"] = history.squeeze_stress
    return csv_text(("step", "x", *columns), _along(history.middles, columns, steps))


def _along(
    x: ArrayLike, columns: Mapping[str, ArrayLike], steps: Sequence[int]
) -> Iterator[tuple[Any, ...]]:
    """Rows of step, X and the values of columns (steps, points)."""
    tables = [np.asarray(column) for column in columns.values()]
    for step in steps:
        values = [table[step].tolist() for table in tables]
        yield from ((step, *row) for row in zip(np.asarray(x).tolist(), *values, strict=True))

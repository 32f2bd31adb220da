"""What a run or a fit leaves in a folder: tables, pictures, the scene, the figures as JSON."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from jbeamshell.common.errors import InputError
from jbeamshell.history.history import History
from jbeamshell.scene.toml import scene_to_toml

if TYPE_CHECKING:  # a run that draws and fits nothing need not wait for them
    pass
from jbeamshell.common.files import as_json, csv_text
from jbeamshell.plotting.folder import write_folder


def write_run(folder: Path, history: History, figures: Mapping[str, Any]) -> list[Path]:
    """Write the tables, the scene, the figures as JSON, and the pictures that show something.

    These are loop.csv, profiles.csv, sections.csv, scene.toml and result.json; loop.png of a path
    that goes on after the pressure, profiles.png if friction acts on it, and contact.png if w or
    psi is a field.  A scene with a user's own energy or law has no scene.toml.
    """
    steps = turning_steps(history)
    texts = {
        "loop.csv": loop_table(history),
        "profiles.csv": profile_table(history, steps),
        "sections.csv": section_table(history, steps),
        "result.json": as_json(figures),
    }
    with contextlib.suppress(InputError):
        texts["scene.toml"] = scene_to_toml(history.scene)
    scene, drawn = history.scene, {}
    if history.force.size > history.pressed + 1:
        drawn["loop.png"] = history.plot()
        if float(scene.contact.friction) > 0.0:
            drawn["profiles.png"] = history.plot_profiles()
    if {"w", "psi"} & set(scene.model.fields):
        drawn["contact.png"] = history.plot_contact()
    pictures = {name: np.ravel(axes)[0].figure for name, axes in drawn.items()}
    return write_folder(folder, texts, pictures)


def turning_steps(history: History) -> list[int]:
    """Steps to look at: the end of the pressing, the first peak, the last cycle's turns and end.

    A path without a cycle has its end instead, and the pressing's first and middle step.
    """
    pressed, end = history.pressed, history.force.size - 1
    marks = [pressed]
    if history.cycles:
        marks += [history.cycles[0][0], *history.cycles[-1]]
    else:
        marks += [0, pressed // 2, end]
    return sorted(set(marks))


def loop_table(history: History) -> str:
    """CSV of the load path: what acts and answers, work of friction, and how it converged.

    With unilateral contact also where the contact ends.
    """
    columns = {
        "step": range(history.force.size),
        "force": history.force,
        "displacement": history.displacement,
        "pressure": history.pressure,
        "friction_work": np.cumsum(history.slip_work),
    }
    scene = history.scene
    if "w" in scene.model.fields and scene.contact.normal != "none":
        columns["contact_end"] = history.contact_end
    columns |= {"newton_iterations": history.iterations, "error": history.error}
    rows = zip(*(np.asarray(c).tolist() for c in columns.values()), strict=True)
    return csv_text(tuple(columns), rows)


def profile_table(history: History, steps: Sequence[int]) -> str:
    """CSV of the fields and the contact at the nodes at chosen steps."""
    names = ("slip", "w", "beta", "psi", "gap", "traction", "reaction", "slipping")
    columns = {name: getattr(history, name) for name in names}
    loads = {step: float(history.force[step]) for step in steps}
    rows = ((step, loads[step], *row) for step, *row in _along(history.x, columns, steps))
    return csv_text(("step", "force", "x", *names), rows)


def section_table(history: History, steps: Sequence[int]) -> str:
    """CSV of the section forces and the mean squeeze stress of the elements at chosen steps."""
    names = ("N", "Q", "M", "chi", "xi")
    columns = dict(zip(names, history.sections, strict=True))
    columns["squeeze_stress"] = history.squeeze_stress
    return csv_text(("step", "x", *columns), _along(history.middles, columns, steps))


def _along(
    x: ArrayLike, columns: Mapping[str, ArrayLike], steps: Sequence[int]
) -> Iterator[tuple[Any, ...]]:
    """Step, X and the columns' (steps, points) values, for chosen steps."""
    tables = [np.asarray(column) for column in columns.values()]
    for step in steps:
        values = [table[step].tolist() for table in tables]
        yield from ((step, *row) for row in zip(np.asarray(x).tolist(), *values, strict=True))

"""What a run or a fit leaves in a folder: tables, pictures, the scene, the figures as JSON."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from jbeamshell.errors import InputError
from jbeamshell.files import as_path, write_text
from jbeamshell.history import History
from jbeamshell.measured.curves import Backbone, DissipationCurve, SqueezeCurve, StiffnessCurve
from jbeamshell.measured.loops import Loop
from jbeamshell.scene import scene_to_toml

if TYPE_CHECKING:  # a run that draws and fits nothing need not wait for them
    from jbeamshell.identify.likelihood import Profile
    from jbeamshell.identify.results import Fit

# Table of a fit: types of its measurements, columns of the data, columns of the model.
TABLES: dict[str, tuple[tuple[type, ...], tuple[str, ...], tuple[str, ...]]] = {
    "overlay.csv": ((Loop, Backbone), ("force", "displacement"), ("force", "displacement")),
    "squeeze.csv": ((SqueezeCurve,), ("x", "stress"), ("stress",)),
    "dissipation.csv": ((DissipationCurve,), ("amplitude", "dissipation"), ("dissipation",)),
    "stiffness.csv": ((StiffnessCurve,), ("amplitude", "stiffness"), ("stiffness",)),
}


def as_json(figures: Mapping[str, Any]) -> str:
    """JSON text; a number that is not finite is refused rather than written as NaN."""
    return json.dumps(figures, indent=2, allow_nan=False) + "\n"


def check_folder(path: str | os.PathLike[str]) -> Path:
    """The folder, if it is there or can be made; nothing is made yet."""
    folder = as_path(path)
    if not os.fspath(path):
        raise InputError("--out '': is empty: name a folder")
    try:  # a link to nothing is there, too
        ground = next(p for p in (folder, *folder.parents) if p.is_symlink() or p.exists())
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"--out {path}: cannot be made ({reason})") from None
    if not ground.is_dir():
        raise InputError(f"--out {path}: {ground} is a file: name a folder")
    if not os.access(ground, os.W_OK | os.X_OK):
        raise InputError(f"--out {path}: {ground} cannot be written to: name another folder")
    return folder


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
    return _write(folder, texts, pictures)


def write_fit(
    folder: Path, result: Fit, figures: Mapping[str, Any], profiles: Sequence[Profile] = ()
) -> list[Path]:
    """Write the tables, the fitted scene, the figures as JSON, and the pictures.

    These are overlay.csv of loops and backbones, squeeze.csv, dissipation.csv and stiffness.csv of
    the other curves, as far as there are any; scene.toml, or scene_1.toml and so on of several
    specimens; result.json, overlay.png and residuals.png; profiles.csv and profiles.png if asked.
    """
    from jbeamshell import plotting

    texts: dict[str, str] = {}
    for name, (types, given, answered) in TABLES.items():
        pairs = [p for p in zip(result.data, result.model, strict=True) if isinstance(p[0], types)]
        rows = [
            (data.label, *values)
            for data, model in pairs
            for values in zip(
                *(getattr(data, column).tolist() for column in given),
                *(getattr(model, column).tolist() for column in answered),
                strict=True,
            )
        ]
        if pairs:
            first = "loop" if Loop in types else "curve"
            header = (first, *given, *(f"model_{column}" for column in answered))
            texts[name] = _table(header, rows)
    scenes = list(result.scenes.values()) or [result.scene]
    for number, scene in enumerate(scenes, 1):
        name = "scene.toml" if len(scenes) == 1 else f"scene_{number}.toml"
        with contextlib.suppress(InputError):
            texts[name] = scene_to_toml(scene)
    if profiles:
        rows = [
            (profile.name, *pair)
            for profile in profiles
            for pair in zip(profile.values.tolist(), profile.rises.tolist(), strict=True)
        ]
        texts["profiles.csv"] = _table(("parameter", "value", "rise"), rows)
    texts["result.json"] = as_json(figures)
    drawn = {"overlay.png": result.plot(), "residuals.png": result.plot_residuals()}
    if profiles:
        drawn["profiles.png"] = plotting.likelihoods(profiles)
    pictures = {name: np.ravel(axes)[0].figure for name, axes in drawn.items()}
    return _write(folder, texts, pictures)


def _write(folder: Path, texts: Mapping[str, str], pictures: Mapping[str, Any]) -> list[Path]:
    """Write what is complete by now; so what cannot be put into words leaves no file behind."""
    from jbeamshell import plotting

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror})") from None
    for name, text in texts.items():
        write_text(folder / name, text)
    for name, figure in pictures.items():
        plotting.save(figure, folder / name)
        plotting.close(figure)
    return [folder / name for name in (*texts, *pictures)]


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
    return _table(tuple(columns), rows)


def profile_table(history: History, steps: Sequence[int]) -> str:
    """CSV of the fields and the contact at the nodes at chosen steps."""
    names = ("slip", "w", "beta", "psi", "gap", "traction", "reaction", "slipping")
    columns = {name: getattr(history, name) for name in names}
    loads = {step: float(history.force[step]) for step in steps}
    rows = ((step, loads[step], *row) for step, *row in _along(history.x, columns, steps))
    return _table(("step", "force", "x", *names), rows)


def section_table(history: History, steps: Sequence[int]) -> str:
    """CSV of the section forces and the mean squeeze stress of the elements at chosen steps."""
    names = ("N", "Q", "M", "chi", "xi")
    columns = dict(zip(names, history.sections, strict=True))
    columns["squeeze_stress"] = history.squeeze_stress
    return _table(("step", "x", *columns), _along(history.middles, columns, steps))


def _along(
    x: ArrayLike, columns: Mapping[str, ArrayLike], steps: Sequence[int]
) -> Iterator[tuple[Any, ...]]:
    """Step, X and the columns' (steps, points) values, for chosen steps."""
    tables = [np.asarray(column) for column in columns.values()]
    for step in steps:
        values = [table[step].tolist() for table in tables]
        yield from ((step, *row) for row in zip(np.asarray(x).tolist(), *values, strict=True))


def _table(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()

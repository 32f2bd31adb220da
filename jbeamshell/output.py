"""What a run or a fit leaves in a folder: tables, pictures, the scene, the figures as JSON."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jbeamshell import plotting
from jbeamshell.errors import InputError
from jbeamshell.files import write_text
from jbeamshell.history import History
from jbeamshell.identify import Fit
from jbeamshell.scene import scene_to_toml


def as_json(figures: Mapping[str, Any]) -> str:
    """JSON text; a number that is not finite is refused rather than written as NaN."""
    return json.dumps(figures, indent=2, allow_nan=False) + "\n"


def check_folder(path: str | os.PathLike[str]) -> Path:
    """The folder, if it is there or can be made; nothing is made yet."""
    folder = Path(path)
    try:
        ground = next(p for p in (folder, *folder.parents) if p.exists())
    except OSError as error:
        raise InputError(f"--out {path}: cannot be made ({error.strerror})") from None
    if not ground.is_dir():
        raise InputError(f"--out {path}: {ground} is a file: name a folder")
    if not os.access(ground, os.W_OK | os.X_OK):
        raise InputError(f"--out {path}: {ground} cannot be written to: name another folder")
    return folder


def write_run(folder: Path, history: History, figures: Mapping[str, Any]) -> list[Path]:
    """Write loop.csv, profiles.csv, scene.toml, result.json, loop.png and profiles.png.

    A scene with a user's own energy or law has no scene.toml.
    """
    texts = {
        "loop.csv": loop_table(history),
        "profiles.csv": profile_table(history, turning_steps(history)),
        "result.json": as_json(figures),
    }
    with contextlib.suppress(InputError):
        texts["scene.toml"] = scene_to_toml(history.scene)
    pictures = {
        "loop.png": history.plot().figure,
        "profiles.png": np.ravel(history.plot_profiles())[0].figure,
    }
    return _write(folder, texts, pictures)


def write_fit(folder: Path, result: Fit, figures: Mapping[str, Any]) -> list[Path]:
    """Write overlay.csv, scene.toml (fitted), result.json and overlay.png."""
    rows = [
        (data.label, *values)
        for data, model in zip(result.data, result.model, strict=True)
        for values in zip(
            data.force, data.displacement, model.force, model.displacement, strict=True
        )
    ]
    header = ("loop", "force", "displacement", "model_force", "model_displacement")
    texts = {
        "overlay.csv": _table(header, rows),
        "scene.toml": scene_to_toml(result.scene),
        "result.json": as_json(figures),
    }
    return _write(folder, texts, {"overlay.png": result.plot().figure})


def _write(folder: Path, texts: Mapping[str, str], pictures: Mapping[str, Any]) -> list[Path]:
    """Write what is complete by now; so what cannot be put into words leaves no file behind."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror})") from None
    for name, text in texts.items():
        write_text(folder / name, text)
    for name, figure in pictures.items():
        plotting.save(figure, folder / name)
        plotting.plt.close(figure)
    return [folder / name for name in (*texts, *pictures)]


def turning_steps(history: History) -> list[int]:
    """Steps of the pressure, the first peak, and the last cycle's start, turn and end."""
    marks = [0, *(i for cycle in (history.cycles[:1] + history.cycles[-1:]) for i in cycle)]
    return sorted(set(marks))


def loop_table(history: History) -> str:
    """CSV of the load path: step, force, displacement, work of friction, and how it converged."""
    columns = (
        range(history.force.size),
        history.force,
        history.displacement,
        np.cumsum(history.slip_work),
        history.iterations,
        history.error,
    )
    header = ("step", "force", "displacement", "friction_work", "newton_iterations", "error")
    return _table(header, zip(*(np.asarray(c).tolist() for c in columns), strict=True))


def profile_table(history: History, steps: Sequence[int]) -> str:
    """CSV of the fields along X at chosen steps."""
    names = ("slip", "w", "beta", "psi", "traction", "reaction", "slipping")
    x = np.asarray(history.x).tolist()
    rows: list[tuple[Any, ...]] = []
    for step in steps:
        fields = [np.asarray(getattr(history, name)[step]).tolist() for name in names]
        load = float(history.force[step])
        rows += [(step, load, *values) for values in zip(x, *fields, strict=True)]
    return _table(("step", "force", "x", *names), rows)


def _table(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()

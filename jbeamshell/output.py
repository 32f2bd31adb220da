"""What a run or a fit leaves in a folder: tables, pictures, the scene, the figures as JSON."""

from __future__ import annotations

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
from jbeamshell.scene import write_scene


def as_json(figures: Mapping[str, Any]) -> str:
    """JSON text; a number that is not finite is refused rather than written as NaN."""
    return json.dumps(figures, indent=2, allow_nan=False) + "\n"


def make_folder(path: str | os.PathLike[str]) -> Path:
    """The folder, made if need be."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {path}: cannot be made ({error.strerror})") from None
    return folder


def write_run(folder: Path, history: History, figures: Mapping[str, Any]) -> list[Path]:
    """Write loop.csv, profiles.csv, loop.png, profiles.png, scene.toml and result.json."""
    write_text(folder / "loop.csv", loop_table(history))
    write_text(folder / "profiles.csv", profile_table(history, turning_steps(history)))
    plotting.save(history.plot().figure, folder / "loop.png")
    plotting.save(np.ravel(history.plot_profiles())[0].figure, folder / "profiles.png")
    if history.scene.energy is None:
        write_scene(history.scene, folder / "scene.toml")
    write_text(folder / "result.json", as_json(figures))
    return sorted(p for p in folder.iterdir() if p.suffix in {".csv", ".png", ".toml", ".json"})


def write_fit(folder: Path, result: Fit, figures: Mapping[str, Any]) -> list[Path]:
    """Write overlay.png, overlay.csv, scene.toml (fitted) and result.json."""
    plotting.save(result.plot().figure, folder / "overlay.png")
    rows = [
        (data.label, *values)
        for data, model in zip(result.data, result.model, strict=True)
        for values in zip(
            data.force, data.displacement, model.force, model.displacement, strict=True
        )
    ]
    header = ("loop", "force", "displacement", "model_force", "model_displacement")
    write_text(folder / "overlay.csv", _table(header, rows))
    write_scene(result.scene, folder / "scene.toml")
    write_text(folder / "result.json", as_json(figures))
    return [folder / n for n in ("overlay.png", "overlay.csv", "scene.toml", "result.json")]


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
    def cell(value: Any) -> str:
        text = repr(value) if isinstance(value, float) else str(value)
        return f'"{text}"' if "," in text else text

    return "\n".join([",".join(header), *(",".join(map(cell, row)) for row in rows)]) + "\n"

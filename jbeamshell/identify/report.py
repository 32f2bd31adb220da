"""Report of a fit: tables, scenes, figures and pictures in a folder."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jbeamshell import plotting
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import as_json, csv_text
from jbeamshell.identify.models import as_model
from jbeamshell.laws import Law
from jbeamshell.measured.form import by_form
from jbeamshell.plotting.folder import write_folder


def write_fit(
    folder: Path,
    result: Any,
    figures: Mapping[str, Any],
    profiles: Sequence[Any] = (),
) -> list[Path]:
    """Write tables, fitted scenes, figures and pictures of a fit.

    The files are a table for each form of measurement, such as overlay.csv of loops and backbones
    or dissipation.csv; scene.toml, law.toml for a law, or scene_1.toml and so on for several
    specimens; result.json, overlay.png and residuals.png. With profiles there are profiles.csv and
    profiles.png too.

    Parameters
    ----------
    folder : folder to write to; it is made if it is not there
    result : fit with its data
    figures : content of result.json
    profiles : profile likelihoods

    Returns
    -------
    list of Path
        paths of the files

    Raises
    ------
    InputError
        if the folder cannot be made, or a file cannot be written
    """
    texts = {f"{name}.csv": text for name, text in tables(result).items()}
    scenes = list(result.scenes.values()) or [result.scene]
    for number, scene in enumerate(scenes, 1):
        kind = "law" if isinstance(scene, Law) else "scene"
        name = f"{kind}.toml" if len(scenes) == 1 else f"{kind}_{number}.toml"
        with contextlib.suppress(InputError):
            if text := as_model(scene).as_toml():
                texts[name] = text
    if profiles:
        rows = [
            (profile.name, *pair)
            for profile in profiles
            for pair in zip(profile.values.tolist(), profile.rises.tolist(), strict=True)
        ]
        texts["profiles.csv"] = csv_text(("parameter", "value", "rise"), rows)
    texts["result.json"] = as_json(figures)
    drawn: dict[str, Any] = {
        "overlay.png": plotting.overlay(result),
        "residuals.png": plotting.residuals(result),
    }
    if profiles:
        drawn["profiles.png"] = plotting.likelihoods(profiles)
    pictures = {name: np.ravel(axes)[0].figure for name, axes in drawn.items()}
    return write_folder(folder, texts, pictures)


def tables(result: Any) -> dict[str, str]:
    """CSV texts by name, one for each form: labels, measured columns, answers of the model."""
    texts = {}
    for form, places in by_form(result.data):
        rows = [
            (result.data[i].label, *values)
            for i in places
            for values in zip(
                *(getattr(result.data[i], name).tolist() for name in form.columns),
                *(getattr(result.model[i], name).tolist() for name in form.answers),
                strict=True,
            )
        ]
        header = (form.heading, *form.columns, *(f"model_{name}" for name in form.answers))
        texts[form.name] = csv_text(header, rows)
    return texts

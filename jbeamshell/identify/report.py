"""Report of a fit: tables, scenes, figures and pictures in a folder."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from jbeamshell import plotting
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import as_json, csv_text
from jbeamshell.measured.curves import Backbone, DissipationCurve, SqueezeCurve, StiffnessCurve
from jbeamshell.measured.loops import Loop
from jbeamshell.plotting.folder import write_folder
from jbeamshell.plotting.protocols import LikelihoodProfile, ModelOverData
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.toml import scene_to_toml

# Table of a fit: types of its measurements, columns of the data, columns of the model.
TABLES: dict[str, tuple[tuple[type, ...], tuple[str, ...], tuple[str, ...]]] = {
    "overlay.csv": ((Loop, Backbone), ("force", "displacement"), ("force", "displacement")),
    "squeeze.csv": ((SqueezeCurve,), ("x", "stress"), ("stress",)),
    "dissipation.csv": ((DissipationCurve,), ("amplitude", "dissipation"), ("dissipation",)),
    "stiffness.csv": ((StiffnessCurve,), ("amplitude", "stiffness"), ("stiffness",)),
}


class Fitted(ModelOverData, Protocol):
    """A model over its data, with the fitted scene of every specimen by its label."""

    @property
    def scene(self) -> Scene: ...
    @property
    def scenes(self) -> Mapping[str, Scene]: ...


def write_fit(
    folder: Path,
    result: Fitted,
    figures: Mapping[str, Any],
    profiles: Sequence[LikelihoodProfile] = (),
) -> list[Path]:
    """Write the tables, the fitted scene, the figures as JSON, and the pictures.

    These are overlay.csv of loops and backbones, squeeze.csv, dissipation.csv and stiffness.csv of
    the other curves, as far as there are any; scene.toml, or scene_1.toml and so on of several
    specimens; result.json, overlay.png and residuals.png; profiles.csv and profiles.png if asked.
    """
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
            texts[name] = csv_text(header, rows)
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

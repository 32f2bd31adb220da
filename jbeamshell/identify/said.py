"""Meaning of ``scene``: what a user says of a specimen, and the whole model that data make of it.

Whatever is said is one of three: numbers of a strip, of which the data tell the rest; a law of a
joint, which may start from the data; or a model that is whole.  What the data choose is noted.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError
from jbeamshell.common.jax_options import ONCE
from jbeamshell.identify.choose_free import chosen_free
from jbeamshell.identify.models import LawModel, Model, StripModel
from jbeamshell.identify.parameters import RIG, Parameter, as_parameters
from jbeamshell.identify.specimens import Specimen
from jbeamshell.identify.starts import doubt_of_strain, estimate, started
from jbeamshell.laws import LAWS, Law, law_named
from jbeamshell.measured.curves import AmplitudeCurve, Backbone, DissipationCurve, StiffnessCurve
from jbeamshell.measured.form import Measurement
from jbeamshell.measured.loops import Loop, driver_of
from jbeamshell.scene import library
from jbeamshell.scene.keys import CONTROLS
from jbeamshell.scene.mounting import in_words
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.toml import overridden, scene_from_values
from jbeamshell.scene.width import check_width

KINDS = (
    "give a jbeamshell.Scene, values by dotted key, the name of a scene, a law such as "
    "jbeamshell.laws.Iwan4(), or its name, such as 'iwan4', or a jbeamshell.identify.Assembly"
)
ABOVE = 1.2  # force of a start over the largest one that drives

Free = tuple[Parameter, ...]


class Completed(NamedTuple):
    """Whole model of a specimen, what to fit, and sentences on both.

    Attributes
    ----------
    model : strip, law or structure
    free : parameters to fit
    notes : sentences on what was estimated and chosen
    doubts : sentences on what may be wrong
    """

    model: Model
    free: Free
    notes: list[str]
    doubts: Sequence[str] = ()


class SaidStrip(NamedTuple):
    """Strip of which some values are said, by dotted key.

    Attributes
    ----------
    values : values by dotted key
    real : True where real dimensions are given, with their units
    """

    values: Mapping[str, Any]
    real: bool = False

    @property
    def width(self) -> float | None:
        """Width of which forces are totals."""
        return self.values.get("strip.width")

    @property
    def driver(self) -> str | None:
        """Column that is said to drive."""
        control = self.values.get("load.control")
        return control if control in CONTROLS else None

    def completed(self, data: Sequence[Measurement], free: Free) -> Completed:
        """Strip whose other values the data tell; see `chosen_free` and `started`."""
        own, notes = dict(self.values), []
        loops = [item for item in data if isinstance(item, Loop)]
        for loop in loops if self.real and self.width is None else ():
            fix = "is a total, but the specimen has no width: give --width, such as 50mm, or a "
            fix += "force per width, such as --unit force=N/mm"
            require(f"{loop.label}: force", "[N]", loop.unit("force") != "N", fix)
        if "load.control" not in own and loops:
            driver = own["load.control"] = driver_of(loops)
            notes.append(f"the {driver} drives these loops (set load.control to change it)")
            if driver != "force":
                own.pop("load.amplitude", None)
        control, found = own.get("load.control", "force"), estimate(data)
        known = found if control in CONTROLS else None
        if not free:
            free, note = chosen_free(None, own, data, known)
            notes.append(note)
        if "load.entry" not in own:
            notes.append("the force enters a member that goes on (set load.entry to change it)")
        if known is not None:
            own, fresh = started(overridden(own, _starts(free)), known)
            notes += fresh
        if "load.amplitude" not in own and control in CONTROLS:
            drives = [
                item.amplitude if isinstance(item, AmplitudeCurve) else getattr(item, control, None)
                for item in data
            ]
            largest = [float(np.max(np.abs(drive))) for drive in drives if drive is not None]
            own |= {"load.amplitude": max(largest)} if largest else {}
        scene = scene_from_values(own)
        mounting = in_words(scene, [parameter.key for parameter in free])
        doubts = doubt_of_strain(self.values, scene, found)
        return Completed(StripModel(scene), free, [*notes, *filter(None, [mounting])], doubts)


class SaidLaw(NamedTuple):
    """Law of a joint, or the class of one that starts from the data; and values that are said."""

    law: Law | type[Law]
    values: Mapping[str, Any]
    width: None = None  # its forces are those of the data

    @property
    def driver(self) -> str | None:
        """Column that is said to drive, or that alone can."""
        control = self.values.get("load.control")
        return control if control in CONTROLS else None if self.law.by_force else "displacement"

    def completed(self, data: Sequence[Measurement], free: Free) -> Completed:
        """Law that is driven as suits the data, and starts from them where it was only named."""
        own = {key: value for key, value in self.values.items() if key != "load.control"}
        model = driven(self.law, data, self.values.get("load.control")).replace(own | _starts(free))
        notes = [f"{model.law.heading} in place of a strip, driven by the {model.control}"]
        if not free:
            left = [key for key in model.law.free() if key not in own]
            told = _told(model.law, data, left)
            free = as_parameters(told)
            stays = "stays as it is: a first loading tells nothing of it"
            notes += [f"{key} {stays}" for key in left if key not in told]
        return Completed(model, free, notes)


class SaidModel(NamedTuple):
    """Model that is whole."""

    model: Model

    @property
    def width(self) -> float | None:
        """Width of which forces are totals."""
        scene = getattr(self.model, "scene", None)
        width = None if scene is None else scene.strip.width
        return None if width is None else float(width)

    @property
    def driver(self) -> str | None:
        """Column that drives it."""
        return self.model.control if self.model.control in CONTROLS else None

    def completed(self, data: Sequence[Measurement], free: Free) -> Completed:
        """Model as it is; numbers of a whole strip are starts of what the data tell."""
        notes = []
        if isinstance(self.model, StripModel) and not free:
            free, note = chosen_free(self.model.scene, {}, data, estimate(data))
            notes.append(note)
        if not free:
            raise InputError("free: name what to fit of the structure, by its keys")
        return Completed(self.model, free, notes)


def said(
    specimen: Specimen, dimensions: Mapping[str, Any], folder: Path
) -> SaidStrip | SaidLaw | SaidModel:
    """Strip, law or model that a specimen says, with its dimensions and values.

    Raises
    ------
    InputError
        if its scene is none of the kinds that a fit knows, or has forces for one unit of width
        where there is a width
    """
    given, own = specimen.scene, specimen.of_model
    if isinstance(given, str) and (given in LAWS or given.startswith("sliders")):
        return SaidLaw(law_named(given), _of_law(own))
    if isinstance(given, str):
        of_file = given.endswith(".toml") or os.path.isfile(folder / given)
        fix = f"choose a law ({', '.join(LAWS)}), a scene ({', '.join(library.NAMES)}), or a file"
        require("scene", given, of_file or given in library.NAMES, fix)
        given = library.values_from(given, folder)
    elif given is None:
        given = {}
    elif isinstance(given, Scene):
        given = StripModel(given)
    if isinstance(given, Mapping):
        check_width("the scene", given, {**dimensions, **own})
        return SaidStrip(overridden(overridden(given, dimensions), own), bool(dimensions))
    if isinstance(given, Model):
        of_strip = dimensions if isinstance(given, StripModel) else {}
        return SaidModel(given.replace(overridden(of_strip, own)))
    require("scene", given, isinstance(given, Law), KINDS)
    return SaidLaw(given, _of_law(own))


def driven(
    law: Law | type[Law], measurements: Sequence[Any], control: str | None = None
) -> LawModel:
    """Model of a law, or of the class of one that starts from the data.

    A law is driven by the displacement, as it has a force for each; by the force where curves over
    amplitude are all there is, or where loops know the noise of their displacement alone.
    """
    pulls = [item for item in measurements if isinstance(item, Loop | Backbone)]
    backward = any(
        getattr(pull, "driver", None) == "force"
        and pull.deviations is not None
        and getattr(pull, "drive_noise", None) is None
        for pull in pulls
    )
    by = control or ("force" if not pulls or (backward and law.by_force) else "displacement")
    if not isinstance(law, Law):
        kind, (size, *rest) = law, _figures(measurements, control or "force")
        law = kind.started(size, *rest)
        most = max([size, *(float(np.max(np.abs(pull.force))) for pull in pulls)])
        if by == "force" and law.capacity <= most:  # a law has no answer at its gross slip
            law = kind.started(ABOVE * most, *rest)
    return LawModel(law, by)


def _figures(measurements: Sequence[Any], control: str) -> tuple[float, float, float, float]:
    """Amplitudes of force and displacement, work of a cycle, and stiffness right after a turn.

    They are those of the largest loop or backbone, or of curves over the amplitude of a column.
    """
    if (found := estimate(measurements)) is not None:
        work = found.work or 0.5 * found.force * found.displacement
        return found.force, found.displacement, work, found.stiffness
    curves = [item for item in measurements if isinstance(item, AmplitudeCurve)]
    if not curves:
        raise InputError("data: tell no loop, backbone or curve over amplitude to start a law from")
    size = max(float(np.max(curve.amplitude)) for curve in curves)
    last = {
        type(curve): getattr(curve, curve.form.y)[np.argmax(curve.amplitude)] for curve in curves
    }
    most = max((np.max(c.stiffness) for c in curves if isinstance(c, StiffnessCurve)), default=0.0)
    work, secant = (float(last.get(kind, 0.0)) for kind in (DissipationCurve, StiffnessCurve))
    # Without one of them, as of Goodman's bar: D = (4/3) F u.
    if not secant:
        secant = 4.0 / 3.0 * size**2 / work if control == "force" else 0.75 * work / size**2
    force, displacement = (size, size / secant) if control == "force" else (size * secant, size)
    stiffness = 1.5 * max(float(most), secant)
    return force, displacement, work or 4.0 / 3.0 * force * displacement, stiffness


def _of_law(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values of a law, which has no width."""
    return {key: value for key, value in values.items() if key != "strip.width"}


def _starts(free: Free) -> dict[str, float]:
    """Starts of free parameters of the model by key, where they were given."""
    return {p.key: p.start for p in free if p.start is not None and p.key not in RIG}


def _told(law: Law, data: Sequence[Measurement], keys: Sequence[str]) -> list[str]:
    """Those of a law's keys that the data tell: first loadings tell nothing of unloading."""
    if not all(isinstance(item, Backbone) for item in data):
        return list(keys)
    way = np.concatenate([item.displacement for item in data if isinstance(item, Backbone)])
    numbers = {key: law.get(key) for key in keys}
    slopes = _slopes(law, numbers, way)
    return [key for key in keys if np.any(np.asarray(slopes[key]) != 0.0)]


@partial(jax.jit, compiler_options=ONCE)
def _slopes(law: Law, numbers: dict[str, Any], way: Any) -> dict[str, Any]:
    """Derivatives of a law's backbone by numbers of dotted keys."""
    slopes: dict[str, Any] = jax.jacfwd(lambda own: law.replace(own).backbone(way))(numbers)
    return slopes

"""Specimens of a fit: a strip, and what was measured on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError
from jbeamshell.identify.driving import as_model, feature_doubts
from jbeamshell.identify.models import Driven, Model
from jbeamshell.identify.rig_keys import PREFIX
from jbeamshell.measured.curves import Measurement
from jbeamshell.measured.inspection import inspect
from jbeamshell.measured.loops import Loop
from jbeamshell.measured.recordings import as_column
from jbeamshell.scene.keys import CONTROLS, FAR_ENDS
from jbeamshell.scene.scene import Scene

OF_SHEAR = ("strip.kappa_s", "strip.poisson_ratio", "strip.curvature")


class Specimen(NamedTuple):
    """One strip and what was measured on it.

    Attributes
    ----------
    scene : start values, and all values that stay fixed; or a law of a joint, or a structure
    data : one measurement or several
    label : name in messages and in the names of the specimen's own values
    weights : factors of the measurements' residuals, besides the curves' own; all 1 if empty
    rig : values of the rig that are not 0, by dotted key, see `jbeamshell.identify.rig`
    """

    scene: Model
    data: Measurement | Sequence[Measurement]
    label: str = ""
    weights: Sequence[float] = ()
    rig: Mapping[str, Any] = {}

    @property
    def measurements(self) -> list[Measurement]:
        """Measurements as a list."""
        # A Loop is a tuple itself.
        one = isinstance(self.data, Loop) or not isinstance(self.data, Sequence)
        return [self.data] if one else list(self.data)  # type: ignore[list-item, arg-type]

    def checked_weights(self) -> NDArray[np.float64]:
        """Weights (measurements,); raises `InputError` unless there are none or one for each."""
        count, where = len(self.measurements), f" of {self.label!r}" if self.label else ""
        fix = f"give one positive number for each of the {count} measurements"
        several = isinstance(self.weights, list | tuple | np.ndarray)
        require(f"weights{where}", self.weights, several, fix)
        given = as_column(self.weights, f"weights{where}", "data")
        weights = given if given.size else np.ones(count)
        if weights.shape != (count,) or not np.all(np.isfinite(weights) & (weights > 0.0)):
            raise InputError(f"weights{where} = {given.tolist()}: {fix}")
        return weights

    def check(self) -> None:
        """Raise `InputError` if there is no measurement, or if the load drives no column of one."""
        driver = self.scene.load.control
        fix = "does not drive a measurement: take " + " or ".join(map(repr, CONTROLS))
        require("load.control", driver, driver in CONTROLS, fix)
        if not self.measurements:
            where = f" of specimen {self.label!r}" if self.label else ""
            raise InputError(f"data{where}: no measurement given; read loops with read_loops")


def as_specimens(data: Any, scene: Any, weights: Sequence[float]) -> list[Specimen]:
    """Specimens with labels, no two alike, from what `fit` was given.

    Raises
    ------
    InputError
        if specimens are mixed with measurements or given a scene or weights besides their own, if
        measurements come without a scene, or if two specimens have one label
    """
    given = [data] if isinstance(data, Specimen) else data
    several = isinstance(given, Sequence) and not isinstance(given, Loop)
    if not (several and any(isinstance(item, Specimen) for item in given)):
        if scene is None:
            raise InputError(
                "scene: give one, or a Specimen (a scene with its data) in place of data"
            )
        one = Specimen(scene, data, weights=weights)
        return [one._replace(scene=as_model(scene, one.measurements))]
    if not all(isinstance(item, Specimen) for item in given):
        raise InputError("data: mixes specimens with measurements: make each a Specimen")
    for name, present in {"scene": scene is not None, "weights": len(weights) > 0}.items():
        if present:
            raise InputError(f"{name}: the specimens bring their own; leave it out")
    labelled = [
        specimen._replace(
            scene=as_model(specimen.scene, specimen.measurements),
            label=specimen.label or f"specimen {number}",
        )
        for number, specimen in enumerate(given, 1)
    ]
    labels = [specimen.label for specimen in labelled]
    repeated = [label for label in labels if labels.count(label) > 1]
    if repeated:
        raise InputError(f"specimens: two have the label {repeated[0]!r}: give each its own")
    return labelled


def free_of(specimens: Sequence[Specimen]) -> tuple[str, ...]:
    """Keys of the numbers that loops tell of the first specimen's law; none of other models."""
    first = specimens[0].scene
    return first.law.free() if isinstance(first, Driven) else ()


def inspected(
    specimens: Sequence[Specimen], free: Sequence[str], unchecked: bool = False
) -> list[str]:
    """Doubts about the specimens' loops, see `jbeamshell.inspect`.

    Parameters
    ----------
    specimens : strips and what was measured on them
    free : keys to fit, which say nothing of the loops yet
    unchecked : True to tell grave findings as doubts

    Raises
    ------
    InputError
        for a grave finding, such as negative work
    """
    doubts = []
    for specimen in specimens:
        loops = [item for item in specimen.measurements if isinstance(item, Loop)]
        seen = (
            inspect(loops, stiffness=plausible_stiffness(specimen.scene, [*free, *specimen.rig]))
            if loops
            else None
        )
        if seen is not None and not unchecked:
            seen.check()
        doubts += [] if seen is None else seen.doubts()
        doubts += feature_doubts(specimen.scene, loops)
    return doubts


def plausible_stiffness(scene: Model, free: Sequence[str]) -> tuple[float, float] | None:
    """Least and largest force per width over displacement that a strip can have.

    A strip that is held at its far end is at least as stiff as without friction, E'2H/L; a third of
    that leaves room for the rig.  Ten times E' is more than a strip that sticks under its load.

    Parameters
    ----------
    scene : strip with known dimensions
    free : keys to fit; None is returned if they are of the strip's stiffness or dimensions, or of
        the rig
    """
    if not isinstance(scene, Scene):
        return None
    strip = scene.strip
    unknown = any(key.startswith(("strip.", PREFIX)) and key not in OF_SHEAR for key in free)
    if strip.axial_stiffness is None or unknown:
        return None
    stretching, length = float(strip.axial_stiffness), float(strip.length)
    held = "v" in FAR_ENDS[strip.far_end]
    return stretching / (3.0 * length) * held, 10.0 * stretching / (
        length * float(strip.height_ratio)
    )

"""Specimens of a fit, as users say them, and the cases that come of them with whole models."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import read_toml
from jbeamshell.identify.models import Model, StripModel, as_model
from jbeamshell.identify.parameters import PREFIX, check_rig
from jbeamshell.measured.columns import QUANTITIES
from jbeamshell.measured.curve_files import read_curves
from jbeamshell.measured.curves import KINDS, Backbone
from jbeamshell.measured.drift import DRIFTS
from jbeamshell.measured.findings import DRIFT, OFF_CENTRE, OFF_ZERO
from jbeamshell.measured.form import Measurement, as_column
from jbeamshell.measured.inspection import inspect
from jbeamshell.measured.loop_files import read_loops
from jbeamshell.measured.loops import Loop
from jbeamshell.measured.noisy_drive import noises_of
from jbeamshell.measured.splitting import split_cycles
from jbeamshell.measured.steady import mean_loops, steady_loops
from jbeamshell.scene.dimensions import Dimensions, dimensions_of
from jbeamshell.scene.keys import CONTROLS, FAR_ENDS

CYCLES = ("auto", "steady", "recorded")
WRONG_DRIVE = (
    "the displacement goes from turn to turn as a machine drives it, the force does not: if it "
    "drives, give --set load.control=displacement"
)
QUIET = 1e-3  # noise of the driving column, over its range, above which cycles are averaged
OF_SHEAR = ("strip.kappa_s", "strip.poisson_ratio", "strip.curvature")
WIDEST = 5.0  # m, of a specimen; a larger number was meant in millimetres
ZEROS = {"rig.force_zero", "rig.displacement_zero"}


class Case(NamedTuple):
    """Whole model of one specimen, and its measurements as they are compared.

    Attributes
    ----------
    model : strip, law or structure
    measurements : what was measured
    weights : (measurements,) factors of the residuals, besides the curves' own
    rig : values of the rig by dotted key; those that are not named are 0
    label : name in messages and in the names of the specimen's own values
    """

    model: Model
    measurements: Sequence[Any]
    weights: NDArray[np.float64]
    rig: Mapping[str, Any] = {}
    label: str = ""


@dataclasses.dataclass(frozen=True)
class Specimen:
    """One strip, joint or structure, and what was measured on it.

    Attributes
    ----------
    scene : scene, with start values and all values that stay fixed; values of a scene by dotted
        key, or its name or file, of which those that are not given are estimated; a law of a joint
        or its name; or a structure.  None is a strip of which nothing is known
    data : a measurement, a file, or a list of them
    label : name in messages and in the names of the specimen's own values
    weights : factors of the measurements' residuals, besides the curves' own; all 1 if empty
    set : values by dotted key, of the scene or the rig (see `jbeamshell.identify.rig`)
    kind : kind of measurement in files, one of `KINDS`
    cycles : treatment of loops as recorded: "steady" averages the steady cycles of every amplitude;
        "recorded" takes the recording as one loop; "auto" averages if cycles repeat or if the
        driving column is noisy
    driver, drift : arguments of `steady_loops`; the driver is the column that the scene names, if
        it names one
    centre : True to take the zeros of the sensors from the loops, see `Loop.centred`; None to do so
        where they can only be offsets
    reverse : "force" or "displacement" to turn the sign of that column
    columns, units, decimal : arguments of `read_loops`
    dimensions : dimensions of the specimen with units, see `jbeamshell.scene.dimension_table`; or
        the name of a TOML file that holds them

    Raises
    ------
    InputError
        if an entry is of the wrong kind, naming the entry, the value and the fix
    """

    scene: Any = None
    data: Any = ()
    label: str = ""
    weights: Sequence[float] = ()
    set: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    kind: str = "loop"
    cycles: str = "auto"
    driver: str | None = None
    drift: str = "keep"
    centre: bool | None = None
    reverse: str | None = None
    columns: Mapping[str, str] = dataclasses.field(default_factory=dict)
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)
    decimal: str | None = None
    dimensions: Mapping[str, Any] | str = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        drives = {"driver": (None, *CONTROLS), "reverse": (None, *QUANTITIES)}
        words = {"kind": tuple(KINDS), "cycles": CYCLES, "drift": DRIFTS, **drives}
        for name, known in words.items():
            value = getattr(self, name)
            valid = (value is None or isinstance(value, str)) and value in known
            require(name, value, valid, f"choose among {', '.join(repr(w) for w in known if w)}")
        require("centre", self.centre, self.centre in (None, True, False), "give true or false")
        require("set", self.set, isinstance(self.set, Mapping), "give values by dotted key")
        check_rig(self.rig)

    @property
    def rig(self) -> dict[str, Any]:
        """Values of the rig by dotted key; those that are not named are 0."""
        return {key: value for key, value in self.set.items() if key.startswith(PREFIX)}

    @property
    def of_model(self) -> dict[str, Any]:
        """Values of the model by dotted key, such as those of a scene."""
        return {key: value for key, value in self.set.items() if not key.startswith(PREFIX)}

    @property
    def measurements(self) -> list[Any]:
        """Data as a list."""
        one = isinstance(self.data, str) or not isinstance(self.data, Sequence)
        return [self.data] if one else list(self.data)

    def case(self, model: Any, data: Sequence[Any]) -> Case:
        """Case of the specimen with a whole model and data as they are compared.

        Raises `InputError` unless there are no weights or one for each measurement.
        """
        count, where = len(data), f" of {self.label!r}" if self.label else ""
        fix = f"give one positive number for each of the {count} measurements"
        several = isinstance(self.weights, list | tuple | np.ndarray)
        require(f"weights{where}", self.weights, several, fix)
        given = as_column(self.weights, f"weights{where}", "data")
        weights = given if given.size else np.ones(count)
        if weights.shape != (count,) or not np.all(np.isfinite(weights) & (weights > 0.0)):
            raise InputError(f"weights{where} = {given.tolist()}: {fix}")
        return Case(as_model(model), data, weights, self.rig, self.label)

    def known(self, folder: Path) -> Dimensions:
        """Dimensions of the specimen in SI; a file is looked for in a folder."""
        given = self.dimensions
        read = read_toml(folder / given) if isinstance(given, str) else given
        try:
            return dimensions_of(read)
        except InputError as error:
            raise InputError(
                f"{given}: {error}" if isinstance(given, str) else str(error)
            ) from None

    def read(
        self,
        folder: Path,
        driver: str | None = None,
        free: Sequence[str] = (),
        width: float | None = None,
        unchecked: bool = False,
    ) -> list[tuple[Measurement, Sequence[str]]]:
        """Measurements as they are fitted, each with notes on what was done to it.

        Recordings, and loops as they were recorded, are averaged over their cycles and centred.

        Parameters
        ----------
        folder : folder in which files are looked for
        driver : column that drives; None finds it
        free : keys to fit
        width : width of the model, of which forces are totals; None is one unit of width
        unchecked : True to take a recording that an inspection refuses

        Raises
        ------
        InputError
            for a file that cannot be read, or a recording that an inspection refuses
        """
        items = self.measurements
        where = f" of specimen {self.label!r}" if self.label else ""
        if not items:
            raise InputError(f"data{where}: no measurement given: give loops, or files")
        named = [item for item in items if isinstance(item, str | os.PathLike)]
        if named:
            fix = "files do not mix with other data: make each a Specimen"
            require("data", str(named[0]), len(named) == len(items), fix)
            files = [folder / name for name in named]
            if self.kind not in ("loop", "backbone"):
                return list(read_curves(files, self.kind, width=width, **self._reading))
            items = list(read_loops(files, **self._reading))
        asked = self.driver or driver
        keeps_zero = bool(ZEROS & {*free, *self.set})
        found: list[tuple[Measurement, Sequence[str]]] = []
        for item in items:
            if isinstance(item, Loop) and item.titles is not None:
                if self.dimensions and item.units is None:
                    raise InputError(
                        f"{item.label}: its columns name no units, but the specimen's dimensions "
                        "do: give --unit force=N --unit displacement=mm, or what they are"
                    )
                if item.units is not None and width is not None and width > WIDEST:
                    raise InputError(
                        f"strip.width = {width:g}: beside {item.label}, whose columns have units, "
                        f"it is in metres: give {1e-3 * width:g}, or --width {width:g}mm"
                    )
                item = item if width is None else item.of_width(width)
            if isinstance(item, Loop) and item.as_recorded:
                found += self._of_recording(item, asked, keeps_zero, unchecked)
            elif isinstance(item, Loop):
                found.append(self._centred(item, keeps_zero))
            else:
                found.append((item, ()))
        return found

    @property
    def _reading(self) -> dict[str, Any]:
        """Arguments of the readers of files."""
        return {"columns": self.columns, "units": self.units, "decimal": self.decimal}

    def _of_recording(
        self, item: Loop, driver: str | None, keeps_zero: bool, unchecked: bool
    ) -> Iterator[tuple[Measurement, Sequence[str]]]:
        """Measurements of one recording, or of a loop as it was recorded."""
        item = self._turned(item)
        seen = inspect(item)
        if not unchecked:
            seen.check()
        if self.drift == "keep":  # which the mean loops do not show
            drifts = [f.text for view in seen.views for f in view.findings if f.name == DRIFT]
            item = item.but(notes=(*item.notes, *drifts))
        if driver == "force" and any(v.driver == "displacement" for v in seen.views):
            item = item.but(notes=(*item.notes, WRONG_DRIVE))
        if self.kind == "backbone":
            yield Backbone(item.force, item.displacement, label=item.label), item.notes
        else:
            for loop in self._loops(item, driver):
                yield self._centred(loop, keeps_zero)

    def _centred(self, loop: Loop, keeps_zero: bool) -> tuple[Loop, Sequence[str]]:
        """Loop without its sensors' offsets, if that was asked for or must be, and its notes."""
        wanted = self.centre
        if wanted is None:
            wanted = not (loop.free_zero or keeps_zero) and _forgets_zero(loop)
        taken = loop.centred() if wanted else loop
        return taken, taken.notes

    def _turned(self, recording: Loop) -> Loop:
        """Recording with the sign of one column turned, if that was asked for."""
        if self.reverse is None:
            return recording
        note = f"the sign of the {self.reverse} is turned"
        column = {self.reverse: -getattr(recording, self.reverse)}
        return recording.but(**column, notes=(*recording.notes, note))

    def _loops(self, recording: Loop, driver: str | None) -> list[Loop]:
        if self.cycles == "recorded" and self.drift == "keep":
            return [recording]
        if self.cycles == "auto" and self.drift == "keep":
            try:
                found = split_cycles(recording, driver)
            except InputError:  # a first loading, or an unsteady path
                return [recording]
            noise = found.noise / np.ptp(found.path)
            quiet = noises_of(found, list(found.cycles)) is None
            once = len(found.cycles) == 1 and noise < QUIET and quiet
            return [recording] if once else mean_loops(found)
        return steady_loops(recording, driver, self.drift)


def _forgets_zero(loop: Loop) -> bool:
    """True for a loop whose response has an offset that no joint makes.

    A joint that is driven to and fro alike answers about zero.  A contact that slides as a whole
    has no place of its own, so the zero of its displacement was never that of the strip.  A path
    that is not closed starts unloaded, unless its driving column has an offset too.
    """
    zeros = loop.zeros()
    off = {n: abs(zero) > OFF_CENTRE * np.ptp(getattr(loop, n)) for n, zero in zeros.items()}
    driver, answer = zeros
    if not loop.closed:
        return off[answer] and abs(zeros[driver]) < OFF_ZERO * np.ptp(getattr(loop, driver))
    if not any(off.values()):
        return False
    levels = inspect(loop).views[0].levels
    if not levels:
        return False
    shape = levels[-1].shape
    slides = off["displacement"] and shape.kind == "gross slip"
    return slides or (off[answer] and not off[driver] and not shape.asymmetric)


def plausible_stiffness(model: Model, free: Sequence[str]) -> tuple[float, float] | None:
    """Least and largest force over displacement that a strip can have.

    A strip that is held at its far end is at least as stiff as without friction, E'2H/L; a third of
    that leaves room for the rig.  Ten times E' is more than a strip that sticks under its load.

    Parameters
    ----------
    model : strip with known dimensions; None is returned for others
    free : keys to fit; None is returned if they are of the strip's stiffness or dimensions, or of
        the rig
    """
    if not isinstance(model, StripModel):
        return None
    strip = model.scene.strip
    unknown = any(key.startswith(("strip.", PREFIX)) and key not in OF_SHEAR for key in free)
    if strip.axial_stiffness is None or unknown:
        return None
    stretching = float(strip.axial_stiffness * model.scene.wide)
    length = float(strip.length)
    held = "v" in FAR_ENDS[strip.far_end]
    return stretching / (3.0 * length) * held, 10.0 * stretching / (
        length * float(strip.height_ratio)
    )

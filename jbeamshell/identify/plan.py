"""A plan of a fit: which files, of what kind, on which specimens, and what is free.

The command line makes one of its options; anything larger is a TOML file:

    scene = "standard"                 # a scene that ships, or a file; this is the default
    noise = 0.01                       # of the range; leave it out where the data bring their own

    [set]                              # keys of all specimens
    "load.control" = "displacement"

    [free."contact.friction"]          # one value for all specimens
    [free."strip.height_ratio"]
    each = true                        # one for each
    low = 0.01
    high = 0.5

    [[specimen]]
    label = "thin"
    data = ["thin-1.csv", "thin-2.csv"]
    kind = "loop"                      # or backbone, dissipation, stiffness, squeeze
    set = { "strip.length" = 12.0 }
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jbeamshell.common.checks import shown
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import as_path, read_toml
from jbeamshell.identify.experiment import Specimen
from jbeamshell.identify.parameters import Parameter
from jbeamshell.measured.curve_files import CURVES, read_curves
from jbeamshell.measured.curves import AmplitudeCurve, Backbone, Measurement
from jbeamshell.measured.loops import Loop, driver_of
from jbeamshell.measured.recordings import Recording, read_recordings
from jbeamshell.measured.splitting import split_cycles
from jbeamshell.measured.steady import DRIFTS, steady_loops
from jbeamshell.scene import library
from jbeamshell.scene.keys import CONTROLS
from jbeamshell.scene.toml import overridden, scene_from_values

KINDS = ("loop", "backbone", *CURVES)
CYCLES = ("auto", "steady", "recorded")
OPTIONS = ("method", "starts", "noise", "points", "max_iterations", "tolerance")
QUIET = 1e-3  # of the range: a driving column with more noise is no load path as it stands


class Plan(NamedTuple):
    """What `identify.fit` needs.

    Attributes
    ----------
    specimens : scenes with their measurements
    free : parameters
    options : of `identify.fit`
    notes : what was done to the data, and what was chosen for want of a word
    """

    specimens: list[Specimen]
    free: list[Parameter]
    options: dict[str, Any]
    notes: list[str]


@dataclasses.dataclass(frozen=True)
class Source:
    """Files of one kind that belong to one specimen.

    Attributes
    ----------
    data : files
    kind : what is in them, one of `KINDS`
    cycles : of recordings: "steady" averages the steady cycles of every amplitude, "recorded" takes
        all as it stands, "auto" averages where cycles repeat or what drives them is noisy
    driver, drift : see `steady_loops`
    centre : whether to take the zeros of the sensors from closed loops, see `Loop.centred`
    width : of the specimen, by which forces, works and stiffnesses are divided
    columns, units, decimal : see `read_recordings`
    label : of the specimen
    set : dotted keys of its own
    """

    data: Sequence[str]
    kind: str = "loop"
    cycles: str = "auto"
    driver: str | None = None
    drift: str = "keep"
    centre: bool = False
    width: float = 1.0
    columns: Mapping[str, str] = dataclasses.field(default_factory=dict)
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)
    decimal: str | None = None
    label: str = ""
    set: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        files = isinstance(self.data, list | tuple) and all(isinstance(f, str) for f in self.data)
        if not (files and self.data):
            raise InputError(f"specimen {self.label!r}: data = {self.data!r}: list its files")
        words = {"kind": KINDS, "cycles": CYCLES, "drift": DRIFTS, "driver": (None, *CONTROLS)}
        for name, known in words.items():
            value = getattr(self, name)
            if not (value is None or isinstance(value, str)) or value not in known:
                names = ", ".join(repr(word) for word in known if word)
                raise InputError(f"{name} = {shown(value)}: choose among {names}")
        if not isinstance(self.centre, bool):
            raise InputError(f"centre = {self.centre!r}: give true or false")
        number = isinstance(self.width, int | float) and not isinstance(self.width, bool)
        if not (number and 0.0 < self.width <= sys.float_info.max):
            raise InputError(f"width = {shown(self.width)}: give a positive number")

    def measurements(self, folder: Path) -> Iterator[tuple[Measurement, Sequence[str]]]:
        """What is in the files, each with a note or two on what was done to it."""
        files = [folder / name for name in self.data]
        if self.kind not in ("loop", "backbone"):
            if self.width != 1.0:
                raise InputError(f"width = {self.width:g}: a {self.kind} curve is per unit width")
            yield from read_curves(
                files, self.kind, columns=self.columns, units=self.units, decimal=self.decimal
            )
            return
        for recording in read_recordings(
            files, columns=self.columns, units=self.units, decimal=self.decimal
        ):
            per_width = recording._replace(force=recording.force / self.width)
            if self.kind == "backbone":
                pull = per_width.force, per_width.displacement, per_width.label
                yield Backbone(*pull), per_width.notes
            else:
                loops = self._loops(per_width)
                loops = [loop.centred() for loop in loops] if self.centre else loops
                yield from ((loop, loop.notes) for loop in loops)

    def _loops(self, recording: Recording) -> list[Loop]:
        whole = Loop(
            recording.force,
            recording.displacement,
            recording.label,
            dropped=recording.dropped,
            notes=recording.notes,
        )
        if self.cycles == "recorded" and self.drift == "keep":
            return [whole]
        if self.cycles == "auto" and self.drift == "keep":
            try:
                found = split_cycles(recording, self.driver)
            except InputError:  # a first loading, or an unsteady path
                return [whole]
            noise = found.noise / np.ptp(found.path)
            if len(found.cycles) == 1 and noise < QUIET:
                return [whole]
        return steady_loops(recording, self.driver, self.drift)


def read_plan(path: str | Path) -> Plan:
    """The plan in a TOML file; files in it are looked for beside it.

    Raises
    ------
    InputError
        naming the file, the entry and the fix
    """
    values = read_toml(path)
    try:
        return plan_from_values(values, as_path(path).parent)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def plan_from_values(values: Mapping[str, Any], folder: Path) -> Plan:
    """The plan of a file's values; see the module.

    Parameters
    ----------
    values : entries of the file
    folder : where its files are looked for

    Raises
    ------
    InputError
        for an entry that is unknown or of the wrong kind, and for files that cannot be read
    """
    _check_table("plan", values)
    given = values.get("specimen", [])
    if not (isinstance(given, list) and given and all(isinstance(s, dict) for s in given)):
        raise InputError("specimen: write a table [[specimen]] with data for each")
    plan, common = _without_specimens(values, folder)
    for number, table in enumerate(given, 1):
        source = _source(table, table.get("label") or (f"{number}" if len(given) > 1 else ""))
        read = list(source.measurements(folder))
        plan.notes.extend(f"{item.label}: {remark}" for item, remarks in read for remark in remarks)
        own = overridden(common, source.set)
        plan = _with_specimen(plan, own, [item for item, _ in read], source.label)
    return plan


def plan_for(values: Mapping[str, Any], data: Sequence[Measurement]) -> Plan:
    """The plan of a file's values without specimens, for one specimen with such data."""
    return _with_specimen(*_without_specimens(values, Path()), data, "")


def _without_specimens(values: Mapping[str, Any], folder: Path) -> tuple[Plan, dict[str, Any]]:
    """A plan still empty, and the keys of all specimens."""
    _check_names("entry", values, ("scene", "set", "free", "specimen", *OPTIONS))
    tables = {name: values.get(name, {}) for name in ("set", "free")}
    for name, table in tables.items():
        _check_table(name, table)
    free = [Parameter(key, **_parameter(key, table)) for key, table in tables["free"].items()]
    options = {name: values[name] for name in OPTIONS if name in values}
    common = overridden(_base(values.get("scene"), folder), tables["set"])
    return Plan([], free, options, []), common


def _with_specimen(
    plan: Plan, values: Mapping[str, Any], data: Sequence[Measurement], label: str
) -> Plan:
    """A plan with one more specimen.

    Without load.control the data tell which column drives, and without load.amplitude how far.
    """
    own, notes = dict(values), list(plan.notes)
    loops = [item for item in data if isinstance(item, Loop)]
    if "load.control" not in own and loops:
        driver = own["load.control"] = driver_of(loops)
        which = f"{label}: " if label else ""
        notes.append(f"{which}the {driver} drives these loops (set load.control to override)")
        if driver != "force":
            own.pop("load.amplitude", None)
    control = own.get("load.control", "force")
    if "load.amplitude" not in own and control in CONTROLS:
        drives = [
            item.amplitude if isinstance(item, AmplitudeCurve) else getattr(item, control, None)
            for item in data
        ]
        largest = [float(np.max(np.abs(drive))) for drive in drives if drive is not None]
        if largest:
            own["load.amplitude"] = max(largest)
    specimen = Specimen(scene_from_values(own), data, label)
    return plan._replace(specimens=[*plan.specimens, specimen], notes=notes)


def _base(scene: Any, folder: Path) -> dict[str, Any]:
    """Dotted values of a scene that ships, or of a file beside the plan; none is standard."""
    if scene is None:
        return {}
    if not isinstance(scene, str):
        raise InputError(f"scene = {scene!r}: give the name of one that ships, or a file")
    return library.values_from(scene, folder)


def _source(table: Mapping[str, Any], label: Any) -> Source:
    fields = [field.name for field in dataclasses.fields(Source)]
    _check_names("specimen", table, fields)
    if "data" not in table:
        raise InputError(f"specimen {label!r}: data: list its files")
    for name in ("columns", "units", "set"):
        _check_table(f"specimen {label!r}: {name}", table.get(name, {}))
    for name in ("columns", "units"):
        for quantity, word in table.get(name, {}).items():
            if not isinstance(word, str):
                raise InputError(f"specimen {label!r}: {name}.{quantity} = {word!r}: give a word")
    return Source(**{**table, "label": str(label)})


def _parameter(key: str, table: Any) -> dict[str, Any]:
    _check_table(f"free.{key!r}", table)
    fields = [field.name for field in dataclasses.fields(Parameter) if field.name != "key"]
    _check_names(f"free.{key!r}", table, fields)
    options = dict(table)
    if isinstance(options.get("prior"), list):
        options["prior"] = tuple(options["prior"])
    return options


def _check_table(name: str, table: Any) -> None:
    if not isinstance(table, Mapping):
        raise InputError(f"{name} = {shown(table)}: must be a table")


def _check_names(where: str, table: Mapping[str, Any], known: Sequence[str]) -> None:
    for name in table:
        if name not in known:
            raise InputError(f"{where}: {name!r} is unknown; known are {', '.join(known)}")

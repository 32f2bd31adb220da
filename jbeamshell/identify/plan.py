"""Plans of a fit: files, their kind, the specimens they belong to, and the free parameters.

The command line makes a plan of its options; larger studies are written in a TOML file:

    scene = "standard"                 # name of a scene, or a file; this is the default
    model = "iwan4"                    # a law of a joint in place of a strip, without a scene
    noise = 0.01                       # over the range; leave it out if the data carry noise

    [structure]                        # whose joint the scene is: see `jointed` for the entries
    mass = [[1.0]]
    stiffness = [[1e5]]
    point = 0

    [set]                              # values of all specimens
    "load.control" = "displacement"

    [free."contact.friction"]          # one value for all specimens; without free, data choose
    [free."strip.height_ratio"]
    each = true                        # one value for each specimen
    low = 0.01
    high = 0.5

    [[specimen]]
    label = "thin"
    data = ["thin-1.csv", "thin-2.csv"]
    kind = "loop"                      # or backbone, dissipation, stiffness, squeeze; of a
                                       # structure frequency, damping
    set = { "strip.length" = 12.0 }
    # or real dimensions, for data in units; a name is that of a TOML file with such entries
    # dimensions = { length = "120mm", thickness = "12mm", width = "50mm", modulus = "210GPa",
    #                bolts = "2x8kN@30mm,90mm" }
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jbeamshell.common.checks import require, shown
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import as_path, read_toml
from jbeamshell.identify.assembly import jointed
from jbeamshell.identify.choose_free import chosen_free
from jbeamshell.identify.driving import as_model
from jbeamshell.identify.models import Drive, Driven
from jbeamshell.identify.parameters import Parameter
from jbeamshell.identify.rig import rig_of
from jbeamshell.identify.rig_keys import PREFIX, RIG
from jbeamshell.identify.sources import Source
from jbeamshell.identify.specimens import Specimen
from jbeamshell.identify.starts import Estimate, estimate, started
from jbeamshell.laws import law_named
from jbeamshell.measured.curves import AmplitudeCurve, Measurement
from jbeamshell.measured.loops import Loop, driver_of
from jbeamshell.scene import library
from jbeamshell.scene.keys import CONTROLS
from jbeamshell.scene.toml import overridden, scene_from_values

OF_STRUCTURE = tuple(inspect.signature(jointed).parameters)[1:]
TABLES = ("set", "free", "specimen")
OPTIONS = ("method", "starts", "noise", "points", "max_iterations", "tolerance", "unchecked")


class Plan(NamedTuple):
    """Arguments of `identify.fit`.

    Attributes
    ----------
    specimens : scenes with their measurements
    free : parameters to fit
    options : further arguments of `identify.fit`
    notes : sentences on what was done to the data, and what was chosen by default
    model : name of a law of a joint in place of a strip; empty for a strip
    structure : arguments of `jointed` besides the scene; empty for a strip alone
    """

    specimens: list[Specimen]
    free: list[Parameter]
    options: dict[str, Any]
    notes: list[str]
    model: str = ""
    structure: Mapping[str, Any] = {}


def read_plan(path: str | Path, unchecked: bool = False) -> Plan:
    """Read a plan from a TOML file; the files it names are looked for in its folder.

    Parameters
    ----------
    path : TOML file, see `jbeamshell.identify.plan`
    unchecked : True to take data that an inspection refuses, see `jbeamshell.inspect`

    Raises
    ------
    InputError
        if the file, an entry or a data file cannot be read, naming the entry and the fix; if an
        inspection refuses a recording

    Examples
    --------
    ::

        plan = jb.identify.read_plan("study.toml")
        fit = jb.identify.fit(plan.specimens, free=plan.free, **plan.options)
    """
    values = read_toml(path) | ({"unchecked": True} if unchecked else {})
    try:
        return plan_from_values(values, as_path(path).parent)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def plan_from_values(values: Mapping[str, Any], folder: Path) -> Plan:
    """Plan from the entries of a TOML file.

    Parameters
    ----------
    values : entries, see `jbeamshell.identify.plan`
    folder : folder in which data files are looked for

    Raises
    ------
    InputError
        if an entry is unknown or of the wrong kind, or if a file cannot be read
    """
    _check_table("plan", values)
    given = values.get("specimen", [])
    if not (isinstance(given, list) and given and all(isinstance(s, dict) for s in given)):
        raise InputError("specimen: write a table [[specimen]] with data for each")
    plan, common, rig = _without_specimens(values, folder)
    for number, table in enumerate(given, 1):
        source = _source(table, table.get("label") or (f"{number}" if len(given) > 1 else ""))
        known = source.known(folder)
        of_strip, of_rig = _without_rig(source.set)
        of_scene = {} if plan.model else known.values
        own = overridden(overridden(common, of_scene), of_strip)
        if source.driver is None and own.get("load.control") in CONTROLS:
            source = dataclasses.replace(source, driver=own["load.control"])
        read = list(source.measurements(folder, bool(values.get("unchecked", False))))
        plan.notes.extend(f"{item.label}: {note}" for item, notes in read for note in notes)
        plan.notes.extend(known.notes)
        measured = [item for item, _ in read]
        plan = _with_specimen(plan, own, measured, source.label, rig | of_rig)
    return plan


def plan_for(values: Mapping[str, Any], data: Sequence[Measurement]) -> Plan:
    """Plan of one specimen from entries without [[specimen]], for measurements at hand."""
    plan, common, rig = _without_specimens(values, Path())
    return _with_specimen(plan, common, data, "", rig)


def _without_specimens(
    values: Mapping[str, Any], folder: Path
) -> tuple[Plan, dict[str, Any], dict[str, Any]]:
    """Plan without specimens, and the values of scene and rig that all specimens share."""
    _check_names("entry", values, ("scene", "model", "structure", *TABLES, *OPTIONS))
    tables = {name: values.get(name, {}) for name in ("set", "free", "structure")}
    for name, table in tables.items():
        _check_table(name, table)
    free = [Parameter(key, **_parameter(key, table)) for key, table in tables["free"].items()]
    options = {name: values[name] for name in OPTIONS if name in values}
    of_strip, of_rig = _without_rig(tables["set"])
    model = values.get("model", "")
    if model != "":
        law_named(model)
        given = values.get("scene")
        require("scene", given, given is None, f"the law {model!r} takes its place: leave it out")
        return Plan([], free, options, [], model), dict(of_strip), of_rig
    common = overridden(_base(values.get("scene"), folder), of_strip)
    structure = tables["structure"]
    _check_names("structure", structure, OF_STRUCTURE)
    for name in ("mass", "stiffness") if structure else ():
        require(f"structure.{name}", "missing", name in structure, "give a matrix")
    require("free", "none", bool(free or not structure), "name what to fit of the structure")
    return Plan([], free, options, [], structure=structure), common, of_rig


def _without_rig(values: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Values of a scene, and those of the rig."""
    rig = {key: value for key, value in values.items() if key.startswith(PREFIX)}
    rig_of(rig)  # raises for unknown keys and wrong values
    return {key: value for key, value in values.items() if key not in rig}, rig


def _with_specimen(
    plan: Plan,
    values: Mapping[str, Any],
    data: Sequence[Measurement],
    label: str,
    rig: Mapping[str, Any],
) -> Plan:
    """Plan with one more specimen.

    If load.control is not given, it follows from the data; so do load.amplitude, the parameters to
    fit, see `chosen_free`, and the starts of numbers that are not known where the standard strip
    cannot be meant, see `started`.
    """
    if plan.model:
        return _with_law(plan, values, data, label, rig)
    if plan.structure:
        model = jointed(scene_from_values(values), **plan.structure)
        specimen = Specimen(model, data, label, rig=rig)
        return plan._replace(specimens=[*plan.specimens, specimen])
    own, notes = dict(values), list(plan.notes)
    loops = [item for item in data if isinstance(item, Loop)]
    if "load.control" not in own and loops:
        driver = own["load.control"] = driver_of(loops)
        which = f"{label}: " if label else ""
        notes.append(f"{which}the {driver} drives these loops (set load.control to change it)")
        if driver != "force":
            own.pop("load.amplitude", None)
    found = estimate(data) if own.get("load.control", "force") in CONTROLS else None
    free = plan.free
    if not free:
        reasons = chosen_free(own, data, found)
        free = [Parameter(key) for key in reasons]
        told = "; ".join(f"{key} ({reason})" for key, reason in reasons.items())
        notes.append(f"free is not given (--free on the command line), so fitted are: {told}")
    if "load.entry" not in own:
        notes.append("the force enters a member that goes on (set load.entry to change it)")
    own, fresh = _started(own, found, free)
    notes += [f"{label}: {note}" if label else note for note in fresh]
    control = own.get("load.control", "force")
    if "load.amplitude" not in own and control in CONTROLS:
        drives = [
            item.amplitude if isinstance(item, AmplitudeCurve) else getattr(item, control, None)
            for item in data
        ]
        largest = [float(np.max(np.abs(drive))) for drive in drives if drive is not None]
        if largest:
            own["load.amplitude"] = max(largest)
    specimen = Specimen(scene_from_values(own), data, label, rig=rig)
    return plan._replace(specimens=[*plan.specimens, specimen], free=free, notes=notes)


def _with_law(
    plan: Plan,
    values: Mapping[str, Any],
    data: Sequence[Measurement],
    label: str,
    rig: Mapping[str, Any],
) -> Plan:
    """Plan with one more specimen, of a law that starts from its data; see `as_model`."""
    own, name = dict(values), plan.model
    control = own.pop("load.control", None)
    driven = as_model(name, data)
    assert isinstance(driven, Driven)
    given = {p.key: p.start for p in plan.free if p.start is not None and p.key not in RIG}
    driven = driven.replace(own | given)
    driven = driven if control is None else Driven(driven.law, Drive(control))
    where, by = (f"{label}: " if label else ""), driven.load.control
    notes = [*plan.notes, f"{where}{name} in place of a strip, driven by the {by}"]
    free = plan.free or [Parameter(key) for key in driven.law.free() if key not in own]
    specimen = Specimen(driven, data, label, rig=rig)
    return plan._replace(specimens=[*plan.specimens, specimen], free=free, notes=notes)


def _started(
    own: Mapping[str, Any], found: Estimate | None, free: Sequence[Parameter]
) -> tuple[dict[str, Any], list[str]]:
    """Values with starts from the data for what neither the user nor the parameters give."""
    if found is None:
        return dict(own), []
    given = {p.key: p.start for p in free if p.start is not None and p.key not in RIG}
    return started(overridden(own, given), found)


def _base(scene: Any, folder: Path) -> dict[str, Any]:
    """Dotted values of a named scene or of a file; none means the standard scene."""
    if scene is None:
        return {}
    if not isinstance(scene, str):
        raise InputError(f"scene = {scene!r}: give the name of a scene, or a file")
    return library.values_from(scene, folder)


def _source(table: Mapping[str, Any], label: Any) -> Source:
    fields = [field.name for field in dataclasses.fields(Source)]
    _check_names("specimen", table, fields)
    if "data" not in table:
        raise InputError(f"specimen {label!r}: data: list its files")
    tables = ["columns", "units", "set"]
    if not isinstance(table.get("dimensions"), str):
        tables.append("dimensions")
    for name in tables:
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

"""Files of a study: the data, their kind, the specimens they belong to, and what to fit.

The command line makes such entries of its options; larger studies are written in a TOML file:

    scene = "standard"                 # name of a scene, or a file; this is the default
    model = "iwan4"                    # a law of a joint in place of a strip, without a scene
    noise = 0.01                       # over the range; leave it out if the data carry noise

    [structure]                        # whose joint the scene is: see `Assembly.of` for the entries
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

    [[specimen]]                       # see `jbeamshell.identify.Specimen` for all entries
    label = "thin"
    data = ["thin-1.csv", "thin-2.csv"]
    kind = "loop"                      # or backbone, dissipation, stiffness, squeeze; of a
                                       # structure frequency, damping, forced
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
from typing import Any

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import as_path, read_toml
from jbeamshell.identify.assembly import Assembly
from jbeamshell.identify.parameters import Parameter
from jbeamshell.identify.plan import Options, Plan, planned
from jbeamshell.identify.specimens import Specimen
from jbeamshell.laws import law_named
from jbeamshell.scene import library
from jbeamshell.scene.toml import overridden, scene_from_values

OF_STRUCTURE = tuple(inspect.signature(Assembly.of).parameters)[1:]
TABLES = ("set", "free", "specimen")
OPTIONS = ("starts", "noise", "points", "max_iterations", "tolerance", "unchecked")
ENTRIES = [field.name for field in dataclasses.fields(Specimen) if field.name != "scene"]


def read_plan(path: str | Path, **options: Any) -> Plan:
    """Read the plan of a study from a TOML file; the files it names are looked for in its folder.

    Parameters
    ----------
    path : TOML file, see `jbeamshell.identify.plan_file`
    options : settings in place of those of the file, see `fit`

    Raises
    ------
    InputError
        if the file, an entry or a data file cannot be read, naming the entry and the fix; if an
        inspection refuses a recording

    Examples
    --------
    ::

        fit = jb.identify.read_plan("study.toml").run()
    """
    values = read_toml(path)
    try:
        return plan_from_values(values | options, as_path(path).parent)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def plan_from_values(
    values: Mapping[str, Any], folder: Path, data: Sequence[Any] | None = None
) -> Plan:
    """Plan from the entries of a TOML file.

    Parameters
    ----------
    values : entries, see `jbeamshell.identify.plan_file`
    folder : folder in which data files are looked for
    data : measurements of one specimen, in place of [[specimen]]

    Raises
    ------
    InputError
        if an entry is unknown or of the wrong kind, or if a file cannot be read
    """
    _check_table("plan", values)
    _check_names("entry", values, ("scene", "model", "structure", *TABLES, *OPTIONS))
    given = values.get("specimen", []) if data is None else [{"data": data}]
    if not (isinstance(given, list) and given and all(isinstance(s, dict) for s in given)):
        raise InputError("specimen: write a table [[specimen]] with data for each")
    tables = {name: values.get(name, {}) for name in ("set", "free", "structure")}
    for name, table in tables.items():
        _check_table(name, table)
    free = [Parameter(key, **_parameter(key, table)) for key, table in tables["free"].items()]
    for table in given if data is None else ():
        files = table.get("data")
        listed = isinstance(files, list) and files and all(isinstance(f, str) for f in files)
        require(f"specimen {table.get('label', '')!r}: data", files, bool(listed), "list its files")
    specimens = [_specimen(values, tables, table, folder) for table in given]
    options = Options(**{name: values[name] for name in OPTIONS if name in values})
    return planned(specimens, free=free, options=options, folder=folder)


def _specimen(
    values: Mapping[str, Any],
    tables: Mapping[str, Any],
    table: Mapping[str, Any],
    folder: Path,
) -> Specimen:
    """Specimen of its table, of the model that all share."""
    own, name = _entries(table), values.get("scene")
    model, common, structure = values.get("model", ""), tables["set"], tables["structure"]
    if model != "":
        law_named(model)
        fix = f"the law {model!r} takes its place: leave it out"
        require("scene", name, name is None, fix)
        return dataclasses.replace(own, scene=model, set={**common, **own.set})
    require(
        "scene", name, name is None or isinstance(name, str), "give the name of a scene, or a file"
    )
    base = {} if name is None else library.values_from(name, folder)
    shared = Specimen(set=common)
    scene: Any = overridden(base, shared.of_model)
    if structure:
        _check_names("structure", structure, OF_STRUCTURE)
        for entry in ("mass", "stiffness"):
            require(f"structure.{entry}", "missing", entry in structure, "give a matrix")
        known = overridden(overridden(scene, own.known(folder).values), own.of_model)
        scene = Assembly.of(scene_from_values(known), **structure)
        own = dataclasses.replace(own, set=own.rig)
    return dataclasses.replace(own, scene=scene, set={**shared.rig, **own.set})


def _entries(table: Mapping[str, Any]) -> Specimen:
    """Specimen of the entries of its table, still without a model."""
    label = str(table.get("label", ""))
    _check_names("specimen", table, ENTRIES)
    tables = ["columns", "units", "set"]
    if not isinstance(table.get("dimensions"), str):
        tables.append("dimensions")
    for name in tables:
        _check_table(f"specimen {label!r}: {name}", table.get(name, {}))
    for name in ("columns", "units"):
        for quantity, word in table.get(name, {}).items():
            where = f"specimen {label!r}: {name}.{quantity}"
            require(where, word, isinstance(word, str), "give a word")
    return Specimen(**{**table, "label": label})


def _parameter(key: str, table: Any) -> dict[str, Any]:
    _check_table(f"free.{key!r}", table)
    fields = [field.name for field in dataclasses.fields(Parameter) if field.name != "key"]
    _check_names(f"free.{key!r}", table, fields)
    prior = table.get("prior")
    return {**table, "prior": tuple(prior)} if isinstance(prior, list) else dict(table)


def _check_table(name: str, table: Any) -> None:
    require(name, table, isinstance(table, Mapping), "must be a table")


def _check_names(where: str, table: Mapping[str, Any], known: Sequence[str]) -> None:
    for name in table:
        if name not in known:
            raise InputError(f"{where}: {name!r} is unknown; known are {', '.join(known)}")

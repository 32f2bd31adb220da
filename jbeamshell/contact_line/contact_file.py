"""Contact of substructures in a TOML file: the arguments of `jbeamshell.solve_contact`.

::

    friction = 0.1
    amplitude = 0.5
    bolts = [8e3, 8e3]
    assembly = "frictionless"    # or "frictional"; this, and a steady cycle, if left out

    [upper]
    file = "upper.sti"           # or .npz, .mat, .mtx; paths are those beside this file
    contact = "contact.csv"      # rows of node and X
    pull = "pull.csv"            # rows of node, direction and force
    press = ["bolt_1.csv", "bolt_2.csv"]

    [lower]
    file = "lower.npz"           # of Substructure.save

Tables may be written as lists too.  Without ``contact`` a file holds a substructure.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import read_toml
from jbeamshell.contact_line.stiffness_model import StiffnessModel
from jbeamshell.contact_line.substructure import Substructure
from jbeamshell.measured.tables import read_bytes

BODIES = ("upper", "lower")
NUMBERS = (
    "friction",
    "amplitude",
    "cycles",
    "steps_per_half_cycle",
    "control",
    "path",
    "bolts",
    "gap",
    "assembly",
    "points",
)
TABLES = ("contact", "pull", "held")
OF_BODY = ("file", *TABLES, "press", "tangential", "normal", "directions")


def read_contact(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Arguments of `jbeamshell.solve_contact` in a TOML file, both bodies among them.

    Raises
    ------
    InputError
        if the file or one that it names cannot be read, or for an unknown key

    Examples
    --------
    >>> history = jb.solve_contact(**jb.read_contact("joint.toml"))
    """
    values = read_toml(path)
    arguments = check_keys(path, values)
    here = Path(path).parent
    return arguments | {key: _body(key, values[key], here) for key in BODIES if key in values}


def check_keys(
    path: str | os.PathLike[str], values: dict[str, Any], more: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Values of a file but those of its bodies; refuses unknown keys and those that clash."""
    for key in values:
        known = (*BODIES, *NUMBERS, *more)
        require(str(path), f"key {key}", key in known, f"keys are {', '.join(known)}")
    require(str(path), "without [upper]", "upper" in values, "write the body that is pulled")
    for key in ("amplitude", "cycles", "steps_per_half_cycle"):
        clash = key in values and "path" in values
        require(key, values.get(key), not clash, "is given beside path: leave one of them out")
    return {key: value for key, value in values.items() if key not in BODIES}


def _body(key: str, table: Any, here: Path) -> Substructure:
    """Substructure of a table of the file."""
    require(key, table, isinstance(table, dict), f"write [{key}] above its keys")
    for name in table:
        require(f"{key}.{name}", table[name], name in OF_BODY, f"keys are {', '.join(OF_BODY)}")
    file = table.get("file")
    require(f"{key}.file", file, isinstance(file, str), "name a file of a matrix")
    if "contact" not in table:
        beside = [name for name in table if name != "file"]
        fix = "needs contact = ... beside it: without, the file holds a body that is condensed"
        require(f"{key}.{', '.join(beside)}", "without contact", not beside, fix)
        return Substructure.read(here / str(file))
    options: dict[str, Any] = {
        name: table_from(f"{key}.{name}", table[name], here) for name in TABLES if name in table
    }
    options |= {name: table[name] for name in ("tangential", "normal") if name in table}
    loads = [table_from(f"{key}.press[{i}]", rows, here) for i, rows in enumerate(loads_of(table))]
    model = StiffnessModel.read(here / str(file), directions=table.get("directions", 2))
    return model.condensed(**options, press=loads)


def loads_of(table: dict[str, Any]) -> list[Any]:
    """Loads that press, of a body's table: a name, or a list of names and tables."""
    press = table.get("press", [])
    return [press] if isinstance(press, str) else press


def table_from(key: str, value: Any, here: Path) -> NDArray[np.float64]:
    """Rows of numbers, from a list or a CSV file."""
    try:
        if not isinstance(value, str):
            return np.array(value, float)
        lines = read_bytes(here / value).decode("utf-8-sig").splitlines()
        titled = bool(lines) and any(character.isalpha() for character in lines[0].replace("e", ""))
        return np.loadtxt(lines[int(titled) :], delimiter=",", ndmin=2)
    except (ValueError, TypeError) as error:
        raise InputError(f"{key} = {value!r}: is no table of numbers ({error})") from None

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

Without ``contact`` a file holds a substructure.  Bodies touch on a face where [upper] says so::

    [upper]
    deck = "upper.inp"           # nodes, elements and surfaces; CalculiX wrote upper.sti beside it
    face = "FACE"                # a *SURFACE of the deck
    press = ["BOLT_1", "BOLT_2"]
    pull = { surface = "END", direction = 1 }

    [lower]
    deck = "lower.inp"
    face = "FACE"
    press = ["BOLT_1", "BOLT_2"]

Surfaces that press have the resultant 1 for each bolt, against their normals; one that pulls has a
resultant of 1 along its direction.  Without a deck, ``file`` names the matrix, ``mass`` that of the
masses, and ``face`` is a table of node, X, Y and Z; ``pull`` and ``press`` are tables of node,
direction and force.  Tables are lists, or CSV files beside this one.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jbeamshell.bodies.deck import Deck
from jbeamshell.bodies.deck_check import check_deck
from jbeamshell.bodies.modes import FacePart
from jbeamshell.bodies.stiffness_model import StiffnessModel
from jbeamshell.bodies.substructure import Substructure
from jbeamshell.bodies.surface import face_surface, matched, spread
from jbeamshell.common.checks import require, require_choice
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import read_toml
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
    "softness",
    "roughness",
    "assembly",
    "points",
)
TABLES = ("contact", "pull", "held")
OF_LINE = ("file", *TABLES, "press", "tangential", "normal", "directions")
SURFACE = ("elements", "tributary", "normals")
OF_FACE = ("deck", "file", "mass", "face", *SURFACE, "pull", "press", "held")
STIFFNESSES = (".sti", ".npz")  # beside a deck, where the file does not name its matrix
PULL = 'write pull = { surface = "NAME", direction = 1 }, or rows of node, direction and force'


def read_contact(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Arguments of `jbeamshell.solve_contact` in a TOML file, both bodies among them.

    Raises
    ------
    InputError
        if the file or one that it names cannot be read, or for an unknown key, surface or node

    Examples
    --------
    >>> history = jb.solve_contact(**jb.read_contact("joint.toml"))
    """
    values = read_toml(path)
    options = _options(path, values)
    if touches_on_face(values):
        upper, lower, _ = read_parts(path)
        return options | {"upper": upper.body(), "lower": lower and lower.body()}
    here = Path(path).parent
    return options | {key: _line_body(key, values[key], here) for key in BODIES if key in values}


def touches_on_face(values: dict[str, Any]) -> bool:
    """True if the bodies of a file's values touch on a face."""
    upper = values.get("upper")
    return isinstance(upper, dict) and "face" in upper


def read_parts(
    path: str | os.PathLike[str],
) -> tuple[FacePart, FacePart | None, dict[str, Any]]:
    """Upper and lower part of a TOML file, and the other arguments of `jbeamshell.solve_contact`.

    The contact points lie on the elements of both faces.  Where one has none, the nodes of both are
    paired by their places, in the order of the upper ones.

    Raises
    ------
    InputError
        as `read_contact`

    Examples
    --------
    >>> upper, lower, options = jb.read_parts("joint.toml")
    >>> history = jb.solve_contact(upper.body(), lower.body(), **options)
    """
    values = read_toml(path)
    options = _options(path, values)
    here = Path(path).parent
    upper = _part("upper", values["upper"], here)
    if "lower" not in values:
        return upper, None, options
    lower = _part("lower", values["lower"], here)
    if upper.elements is not None and lower.elements is not None:
        return upper, lower, options
    areas, normals = upper.tributary, upper.normals
    if upper.elements is not None:  # whose nodes are those of the upper body
        areas, normals = face_surface(upper.contact, upper.elements, normals)
    nodes = matched(upper.contact, lower.contact)
    lower = lower._replace(contact=nodes, tributary=areas, normals=normals, elements=None)
    upper = upper._replace(tributary=areas, normals=normals, elements=None)
    return upper, lower, options


def _options(path: str | os.PathLike[str], values: dict[str, Any]) -> dict[str, Any]:
    """Values of a file but those of its bodies; refuses unknown keys and those that clash."""
    for key in values:
        known = (*BODIES, *NUMBERS)
        require(str(path), f"key {key}", key in known, f"keys are {', '.join(known)}")
    require(str(path), "without [upper]", "upper" in values, "write the body that is pulled")
    for key in ("amplitude", "cycles", "steps_per_half_cycle"):
        clash = key in values and "path" in values
        require(key, values.get(key), not clash, "is given beside path: leave one of them out")
    return {key: value for key, value in values.items() if key not in BODIES}


def _line_body(key: str, table: Any, here: Path) -> Substructure:
    """Substructure on a line, of a table of the file."""
    _check_table(key, table, OF_LINE)
    file = table.get("file")
    require(f"{key}.file", file, isinstance(file, str), "name a file of a matrix")
    if "contact" not in table:
        beside = [name for name in table if name != "file"]
        fix = "needs contact = ... beside it: without, the file holds a body that is condensed"
        require(f"{key}.{', '.join(beside)}", "without contact", not beside, fix)
        return Substructure.read(here / str(file))
    options: dict[str, Any] = {
        name: _table_from(f"{key}.{name}", table[name], here) for name in TABLES if name in table
    }
    options |= {name: table[name] for name in ("tangential", "normal") if name in table}
    tables = enumerate(_loads_of(table))
    loads = [_table_from(f"{key}.press[{i}]", rows, here) for i, rows in tables]
    model = StiffnessModel.read(here / str(file), directions=table.get("directions", 2))
    return model.condensed(**options, press=loads)


def _check_table(key: str, table: Any, known: tuple[str, ...]) -> None:
    """Refuse what is no table of a body, and unknown keys in it."""
    require(key, table, isinstance(table, dict), f"write [{key}] above its keys")
    for name in table:
        require(f"{key}.{name}", table[name], name in known, f"keys are {', '.join(known)}")


def _part(key: str, table: Any, here: Path) -> FacePart:
    """Part of a table of the file."""
    _check_table(key, table, OF_FACE)
    require(f"{key}.face", None, "face" in table, "name a surface of the deck, or give its nodes")
    deck = _deck(key, table, here)
    model = _model(key, table, here)
    if deck is not None:
        check_deck(key, deck, model)
    options: dict[str, Any] = {}
    if deck is None:
        nodes = _table_from(f"{key}.face", table["face"], here)
        for name in SURFACE:
            if name in table:
                options[name] = _table_from(f"{key}.{name}", table[name], here)
    else:
        for name in SURFACE:
            fix = "is that of the deck's surface: leave it out"
            require(f"{key}.{name}", table.get(name), name not in table, fix)
        nodes, elements = _surface(f"{key}.face", deck, table["face"])
        made = face_surface(nodes, elements)
        outward = 1.0 if key == "lower" else -1.0  # normals point from below to above
        options |= {"elements": elements, "normals": outward * made.normals}
    loads = enumerate(_loads_of(table))
    press = [_load(f"{key}.press[{i}]", deck, load, here) for i, load in loads]
    pull = _load(f"{key}.pull", deck, table["pull"], here) if "pull" in table else None
    return FacePart(model, nodes, press, pull, **options)


def _deck(key: str, table: dict[str, Any], here: Path) -> Deck | None:
    """Mesh that a table names."""
    if "deck" not in table:
        return None
    name = table["deck"]
    require(f"{key}.deck", name, isinstance(name, str), "name a file of a deck")
    return Deck.read(here / name)


def _model(key: str, table: dict[str, Any], here: Path) -> StiffnessModel:
    """Matrices that a table names, or those beside its deck."""
    file, mass = table.get("file"), table.get("mass")
    if file is None and "deck" in table:
        beside = [(here / table["deck"]).with_suffix(suffix) for suffix in STIFFNESSES]
        there = [path for path in beside if path.exists()]
        fix = f"there is no {' and no '.join(path.name for path in beside)}: run ccx on the deck"
        require(f"{key}.deck", table["deck"], bool(there), fix)
        file = there[0].name
    require(f"{key}.file", file, isinstance(file, str), "name a file of a matrix")
    path = here / str(file)
    if mass is None and path.suffix == ".sti" and path.with_suffix(".mas").exists():
        mass = path.with_suffix(".mas").name
    if mass is None and path.suffix == ".npz" and "deck" in table:
        mass = path.name
    model = StiffnessModel.read(path, directions=3, mass=None if mass is None else here / mass)
    if "held" in table:
        return model.without(_table_from(f"{key}.held", table["held"], here))
    return model


def _surface(key: str, deck: Deck, name: Any) -> tuple[NDArray[np.float64], list[list[int]]]:
    """Nodes and elements of a surface of a deck."""
    require(key, name, isinstance(name, str), "name a *SURFACE of the deck")
    try:
        return deck.surface(name)
    except InputError as error:
        raise InputError(f"{key}: {error}") from None


def _load(key: str, deck: Deck | None, load: Any, here: Path) -> NDArray[np.float64]:
    """Rows of node, direction and force, of a surface or of a table."""
    direction = None
    if isinstance(load, dict):
        require(key, load, set(load) == {"surface", "direction"} and deck is not None, PULL)
        load, direction = load["surface"], load["direction"]
        require_choice(f"{key}.direction", direction, (1, 2, 3))
    elif deck is None or not isinstance(load, str) or Path(load).suffix:
        return _table_from(key, load, here)
    else:
        require(key, load, not key.endswith(".pull"), PULL)
    assert deck is not None
    nodes, elements = _surface(key, deck, load)
    made = face_surface(nodes, elements)
    return spread(made, nodes[:, 0].astype(int).tolist(), direction)


def _loads_of(table: dict[str, Any]) -> list[Any]:
    """Loads that press, of a body's table: a name, or a list of names and tables."""
    press = table.get("press", [])
    return [press] if isinstance(press, str) else press


def _table_from(key: str, value: Any, here: Path) -> NDArray[np.float64]:
    """Rows of numbers, from a list or a CSV file."""
    try:
        if not isinstance(value, str):
            return np.array(value, float)
        lines = read_bytes(here / value).decode("utf-8-sig").splitlines()
        titled = bool(lines) and any(character.isalpha() for character in lines[0].replace("e", ""))
        return np.loadtxt(lines[int(titled) :], delimiter=",", ndmin=2)
    except (ValueError, TypeError) as error:
        raise InputError(f"{key} = {value!r}: is no table of numbers ({error})") from None

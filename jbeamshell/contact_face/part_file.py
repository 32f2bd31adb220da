"""Bodies of a face in a TOML file, with their loads.

::

    friction = 0.2
    amplitude = 2000.0
    bolts = [8e3, 8e3]

    [upper]
    deck = "upper.inp"          # nodes, elements and surfaces; CalculiX wrote upper.sti beside it
    face = "FACE"               # a *SURFACE of the deck
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

from jbeamshell.common.checks import require, require_choice
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import read_toml
from jbeamshell.contact_face.deck import Deck
from jbeamshell.contact_face.modes import FacePart
from jbeamshell.contact_face.surface import face_surface, matched, spread
from jbeamshell.contact_line.contact_file import check_keys, loads_of, table_from
from jbeamshell.contact_line.stiffness_model import StiffnessModel

OF_BODY = ("deck", "file", "mass", "face", "elements", "areas", "normals", "pull", "press", "held")
STIFFNESSES = (".sti", ".npz")  # beside a deck, where the file does not name its matrix
PULL = 'write pull = { surface = "NAME", direction = 1 }, or rows of node, direction and force'


def read_parts(
    path: str | os.PathLike[str],
) -> tuple[FacePart, FacePart | None, dict[str, Any]]:
    """Upper and lower part of a TOML file, and the arguments of `jbeamshell.solve_faces`.

    The nodes of both faces are paired by their places, in the order of the upper ones.

    Raises
    ------
    InputError
        if the file or one that it names cannot be read, or for an unknown key, surface or node

    Examples
    --------
    >>> upper, lower, options = jb.read_parts("joint.toml")
    >>> history = jb.solve_faces(upper.body(), lower.body(), **options)
    """
    values = read_toml(path)
    options = check_keys(path, values, more=("softness", "roughness"))
    here = Path(path).parent
    upper = _part("upper", values["upper"], here)
    if "lower" not in values:
        return upper, None, options
    lower = _part("lower", values["lower"], here)
    areas, normals = upper.areas, upper.normals
    if upper.elements is not None:  # whose nodes are those of the upper body
        areas, normals = face_surface(upper.nodes, upper.elements, normals)
    nodes = matched(upper.nodes, lower.nodes)
    if "deck" in values["lower"]:
        own = dict(zip(np.asarray(lower.nodes)[:, 0], np.asarray(lower.normals), strict=True))
        facing = np.sum([own[node] for node in nodes[:, 0]] * np.asarray(normals), axis=1)
        fix = "faces away from the upper face: name the surface of the body below"
        name = values["lower"]["face"]
        require("lower.face", name, bool(np.all(facing > 0.0)), fix)
    lower = lower._replace(nodes=nodes, areas=areas, normals=normals, elements=None)
    return upper, lower, options


def _part(key: str, table: Any, here: Path) -> FacePart:
    """Part of a table of the file."""
    require(key, table, isinstance(table, dict), f"write [{key}] above its keys")
    for name in table:
        require(f"{key}.{name}", table[name], name in OF_BODY, f"keys are {', '.join(OF_BODY)}")
    require(f"{key}.face", None, "face" in table, "name a surface of the deck, or give its nodes")
    deck = _deck(key, table, here)
    model = _model(key, table, here)
    options: dict[str, Any] = {}
    if deck is None:
        nodes = table_from(f"{key}.face", table["face"], here)
        for name in ("elements", "areas", "normals"):
            if name in table:
                options[name] = table_from(f"{key}.{name}", table[name], here)
    else:
        for name in ("elements", "areas", "normals"):
            fix = "is that of the deck's surface: leave it out"
            require(f"{key}.{name}", table.get(name), name not in table, fix)
        nodes, elements = _surface(f"{key}.face", deck, table["face"])
        made = face_surface(nodes, elements)
        outward = 1.0 if key == "lower" else -1.0  # normals point from below to above
        options |= {"areas": made.areas, "normals": outward * made.normals}
    press = [_load(f"{key}.press[{i}]", deck, load, here) for i, load in enumerate(loads_of(table))]
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
        return model.without(table_from(f"{key}.held", table["held"], here))
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
        return table_from(key, load, here)
    else:
        require(key, load, not key.endswith(".pull"), PULL)
    assert deck is not None
    nodes, elements = _surface(key, deck, load)
    made = face_surface(nodes, elements)
    return spread(made, nodes[:, 0].astype(int).tolist(), direction)

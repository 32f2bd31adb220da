"""Targets of an export by name."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from jbeamshell.common.checks import require, require_choice
from jbeamshell.common.files import as_path, written_whole
from jbeamshell.dynamics.export import calculix, fmu, opensees, table, tmdsimpy
from jbeamshell.dynamics.export.element import Element

LIBRARIES = ("openseespy", "tmdsimpy")  # no module may take their names


class Target(NamedTuple):
    """Writer of a file, and the endings of its name."""

    write: Callable[[Element, Path], None]
    endings: tuple[str, ...]


TARGETS = {
    "opensees": Target(opensees.write, (".py",)),
    "fmu": Target(fmu.write, (".fmu",)),
    "tmdsimpy": Target(tmdsimpy.write, (".py",)),
    "calculix": Target(calculix.write, (".inp",)),
    "table": Target(table.write, (".csv", ".mat")),
}


def write(element: Element, to: str, path: str | os.PathLike[str]) -> Path:
    """Write an element for a target, whole or not at all; returns the path.

    Raises
    ------
    InputError
        for an unknown target, a file of another ending, one that cannot be written, or a library
        that is missing
    """
    require_choice("to", to, tuple(TARGETS))
    target = as_path(path)
    writer, endings = TARGETS[to]
    fix = f"end the name of a file for {to!r} in {' or '.join(endings)}"
    require("path", str(target), target.suffix.lower() in endings, fix)
    fix = "name the file otherwise: Python would import it for the library"
    require("path", str(target), target.stem not in LIBRARIES, fix)
    with written_whole(target) as draft:
        writer(element, draft)
    return target

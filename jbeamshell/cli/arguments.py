"""Options that several commands share, and the KEY=VALUE texts among them."""

from __future__ import annotations

import argparse
import ast
import contextlib
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from jbeamshell.common.errors import InputError
from jbeamshell.common.files import parsed_toml

if TYPE_CHECKING:
    from jbeamshell.scene.scene import Scene


def add_scene(parser: argparse.ArgumentParser) -> None:
    """Add the scene as a positional argument."""
    parser.add_argument(
        "scene",
        nargs="?",
        metavar="NAME|SCENE.toml",
        help="a scene that ships (`jbeamshell scenes` lists them) or a TOML file; "
        "default: the standard strip",
    )


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Add ``--set``."""
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="override one key of the scene; repeat it for several "
        "(`jbeamshell keys` lists all keys)",
    )


def add_folder(parser: argparse.ArgumentParser) -> None:
    """Add ``--out`` for a folder."""
    parser.add_argument("--out", metavar="DIR", help="write tables and pictures to this folder")


def add_tolerance(parser: argparse.ArgumentParser) -> None:
    """Add ``--tol``."""
    text = "model.tolerance: error to plane elasticity for which the model is chosen"
    parser.add_argument("--tol", type=float, metavar="ERROR", help=text)


def add_json(parser: argparse.ArgumentParser) -> None:
    """Add ``--json``."""
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def add_columns(parser: argparse.ArgumentParser) -> None:
    """Add ``--column``, ``--unit`` and ``--decimal``, which tell how tables are read."""
    column = "name of the column that holds the force, ..., or its number in a file without header"
    unit = "unit of the force, the displacement, ...; a sensor's factor goes before it: 0.05mm"
    for option, word, text in (("column", "NAME", column), ("unit", "UNIT", unit)):
        parser.add_argument(
            f"--{option}", action="append", default=[], metavar=f"QUANTITY={word}", help=text
        )
    parser.add_argument(
        "--decimal",
        metavar="WORD",
        help="decimal sign, where the numbers alone do not show it",
    )


def scene_of(options: argparse.Namespace) -> Scene:
    """Scene of the options: the one named, with a specimen's dimensions and ``--set`` on top.

    What its file leaves unsaid is kept as ``options.unsaid``, to be said at the end.
    """
    from jbeamshell.cli.dimensions import (
        OWN,
        check_load,
        check_specimen,
        check_standard,
        specimen_of,
        with_units,
    )
    from jbeamshell.scene import library
    from jbeamshell.scene.dimensions import KEYS
    from jbeamshell.scene.toml import entry_note, overridden, scene_from_values
    from jbeamshell.scene.width import check_width

    below = {} if options.scene is None else library.values_from(options.scene)
    known = specimen_of(options)
    notes, own = known.notes, set(known.values) <= {KEYS[name] for name in OWN}
    both = overridden(below, known.values)
    assigned = assignments(options.set)
    wide = below.get("strip.width", known.width)
    assigned = with_units(assigned, both, wide)
    values = overridden(both, assigned)
    check_standard(below, known.values | assigned)
    check_width(str(options.scene), below, known.values | assigned)
    if not own:
        check_specimen(values)
    scene = scene_from_values(values)
    options.specimen_in_si, options.scatter, options.bolted = not own, known.scatter, known.bolts
    if not own:
        check_load(scene, values)
    if options.scene is not None and entry_note(values):
        notes = (*notes, f"{options.scene}: {entry_note(values)}")
    options.unsaid = "; ".join(notes)
    return scene


def assignments(texts: Sequence[str]) -> dict[str, Any]:
    """Values by key from texts KEY=VALUE."""
    return {key: _value(text) for key, text in pairs(texts, "contact.friction=0.2").items()}


def pairs(texts: Sequence[str], example: str) -> dict[str, str]:
    """Texts by key from texts KEY=TEXT."""
    found = {}
    for text in texts:
        key, separator, value = text.partition("=")
        if not separator:
            raise InputError(f"{text!r}: write KEY=VALUE, such as {example}")
        found[key.strip()] = value.strip()
    return found


def _value(text: str) -> Any:
    """A TOML value; else a number such as .5, a list of them, a word, or words between commas."""
    with contextlib.suppress(ValueError):
        tables = parsed_toml(f"value = {text}")
        if len(tables) == 1:  # more than one if the text has further lines
            return tables["value"]
    try:
        if text.startswith("["):
            return ast.literal_eval(text)
        number = float(text)
        return text if math.isinf(number) and "inf" not in text.lower() else number
    except (ValueError, SyntaxError, RecursionError, MemoryError):  # brackets nested too deeply
        return [word.strip() for word in text.split(",")] if "," in text else text

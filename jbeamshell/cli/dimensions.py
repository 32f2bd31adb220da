"""Options of a specimen's dimensions, with units."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from jbeamshell.scene.dimension_table import DIMENSIONS


def add_dimensions(parser: argparse.ArgumentParser) -> None:
    """Add the options to a parser."""
    group = parser.add_argument_group(
        "specimen", "dimensions with units, for data with units; the scene is then in SI"
    )
    for name, (_, example, text) in DIMENSIONS.items():
        group.add_argument(f"--{name}", metavar=example.upper(), help=text)
    group.add_argument(
        "--specimen", metavar="FILE.toml", help="file with such entries; options override them"
    )


def dimensions(options: argparse.Namespace) -> dict[str, Any]:
    """Entries ``dimensions`` and ``width`` of a specimen's table, as far as they are given."""
    from jbeamshell.common.files import read_toml

    given = {} if options.specimen is None else read_toml(Path(options.specimen))
    given |= {name: text for name in DIMENSIONS if (text := getattr(options, name)) is not None}
    if set(given) == {"width"}:
        return {"width": width(given["width"])}
    return {"dimensions": given} if given else {}


def width(text: str) -> float:
    """Width from an option: with a unit in metres, a number alone in the data's own unit."""
    from jbeamshell.scene.dimensions import quantity

    try:
        return float(text)
    except ValueError:
        return quantity("--width", text, *DIMENSIONS["width"][:2])

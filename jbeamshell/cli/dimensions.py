"""Options of a specimen's dimensions, with units."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jbeamshell.common.errors import InputError
from jbeamshell.common.summary import with_unit
from jbeamshell.scene.dimension_table import DIMENSIONS

if TYPE_CHECKING:
    from jbeamshell.scene.dimensions import Dimensions
    from jbeamshell.scene.scene import Scene

# Base units of the numbers of a scene in SI, by the table of keys; a force has its width too.
SI = {"length": "m", "stress": "Pa", "1/length": "1/m", "force/width": "N/m"}
NEEDED = {
    "strip.length": "length",
    "strip.height_ratio": "thickness",
    "strip.axial_stiffness": "modulus",
    "contact.pressure": "pressure",
}
PART = 0.5  # part of gross slip of an amplitude that is proposed


def add_dimensions(parser: argparse.ArgumentParser) -> None:
    """Add the options to a parser."""
    group = parser.add_argument_group(
        "specimen", "dimensions with units; the scene is then in SI, forces per metre of width"
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


def specimen_of(options: argparse.Namespace) -> Dimensions:
    """Dimensions in SI that the options give."""
    from jbeamshell.scene.dimensions import dimensions_of

    given = dimensions(options) if hasattr(options, "specimen") else {}  # some take none
    known = dimensions_of(given.get("dimensions", {}))
    return known._replace(width=given.get("width", known.width))


def with_units(
    values: Mapping[str, Any], below: Mapping[str, Any], width_of_all: float | None
) -> dict[str, Any]:
    """Values of which texts such as "4kN" are numbers in SI, forces per width.

    Parameters
    ----------
    values : values by dotted key, as the command line gives them
    below : values of the scene that they override, which tell what the amplitude is
    width_of_all : width [m] by which forces are divided; None if it is not known
    """
    return {
        key: _in_si(key, value, {**below, **values}, width_of_all)
        if isinstance(value, str)
        else value
        for key, value in values.items()
    }


def _in_si(key: str, text: str, values: Mapping[str, Any], width_of_all: float | None) -> Any:
    """Number in SI from a text with a unit; other texts and keys as they are."""
    from jbeamshell.measured.columns import factor_of
    from jbeamshell.scene.dimensions import QUANTITY
    from jbeamshell.scene.keys import LENGTHS, NUMBERS, TABLE

    found = QUANTITY.fullmatch(text)
    if key not in NUMBERS or found is None or found[2] is None:
        return text
    kind = TABLE[key].unit
    if key == "load.amplitude" and values.get("load.control") in LENGTHS:
        kind = "length"
    base = SI.get(kind)
    factor = None if base is None else factor_of(found[2], (base,))
    if factor is None and kind == "force/width" and (newtons := factor_of(found[2], ("N",))):
        if width_of_all is None:
            raise InputError(
                f"{key} = {text!r}: forces are per width: give --width too, such as --width 50mm, "
                "or write a force per width, such as 80kN/m"
            )
        factor = newtons / width_of_all
    if factor is None:
        fix = f"{found[2][:20]!r} is no unit of it: write {base}" if base else "takes no unit"
        raise InputError(f"{key} = {text!r}: {fix}")
    return float(found[1]) * factor


def check_specimen(scene: Scene, values: Mapping[str, Any], width_of_all: float | None) -> None:
    """Raise `InputError` for a specimen in SI that takes a number of the standard strip.

    Parameters
    ----------
    scene : scene of the specimen
    values : values by dotted key that were given
    width_of_all : width [m] by which forces are divided; None if it is not known
    """
    from jbeamshell.scene.keys import DERIVED
    from jbeamshell.scene.pressure import resultant

    said = {DERIVED.get(key, key) for key in values}
    said |= {"strip.axial_stiffness"} if "strip.layers" in said else set()
    for key, option in NEEDED.items():
        if key not in said:
            fix = f"give it, such as --{option} {DIMENSIONS[option].example}"
            raise InputError(f"{key}: the specimen is in SI, the standard strip is not: {fix}")
    if "load.amplitude" in values or scene.load.cycles == 0:
        return
    contact = scene.contact
    pressing, _ = resultant(
        contact.pressure, contact.bottom_pressure, scene.strip.length, scene.member.support
    )
    gross = float(contact.friction) * float(pressing)
    wide, unit = (1.0, "N/m") if width_of_all is None else (width_of_all, "N")
    half = with_unit(PART * wide * gross, unit, 3).replace(" ", "")
    raise InputError(
        "load.amplitude: is not given, and the specimen slides at mu F_N L = "
        f"{with_unit(wide * gross, unit)}: give a part of it, such as --set load.amplitude={half}"
    )

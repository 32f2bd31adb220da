"""Options of a specimen's dimensions, with units."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError
from jbeamshell.common.summary import with_unit
from jbeamshell.scene.dimension_table import ALL, DIMENSIONS

if TYPE_CHECKING:
    from jbeamshell.scene.dimensions import Dimensions
    from jbeamshell.scene.scene import Scene

# Base units of the numbers of a scene in SI, by the table of keys; of a force with a width, too.
SI = {"length": "m", "stress": "Pa", "1/length": "1/m", "force/width": "N/m"}
SI |= {"force/width/length": "Pa", "force": "N", "force/length": "N/m", "force length": "J"}
NEEDED = {
    "strip.length": "length",
    "strip.height_ratio": "thickness",
    "strip.axial_stiffness": "modulus",
    "contact.pressure": "pressure",
}
OWN = ("width", "force", "friction")  # which have the scene's own units where nothing else is given
PART = 0.5  # part of gross slip of an amplitude that is proposed


def add_dimensions(parser: argparse.ArgumentParser, *, lap: bool = False) -> None:
    """Add the options to a parser; ``lap`` adds those of a lap joint and its load."""
    words = "dimensions with units; the scene is then in SI, and forces are totals of the width"
    group = parser.add_argument_group("specimen", words)
    for name, (_, example, text) in (ALL if lap else DIMENSIONS).items():
        option = f"--{name.replace('_', '-')}"
        group.add_argument(option, metavar=example.upper(), help=text)
    group.add_argument(
        "--specimen", metavar="FILE.toml", help="file with such entries; options override them"
    )


def dimensions(options: argparse.Namespace) -> dict[str, Any]:
    """Entries of a specimen's table: its dimensions, or a width alone in the data's own unit."""
    from jbeamshell.scene.dimensions import KEYS

    given = _given(options, DIMENSIONS)
    if set(given) == {"width"}:
        return {"set": {KEYS["width"]: _own("--width", given["width"], "width")}}
    return {"dimensions": given} if given else {}


def _given(options: argparse.Namespace, names: Mapping[str, Any]) -> dict[str, Any]:
    """Texts of the file and the options by name."""
    from jbeamshell.common.files import read_toml

    given = {} if options.specimen is None else read_toml(Path(options.specimen))
    return given | {
        name: text for name in names if (text := getattr(options, name, None)) is not None
    }


def _own(name: str, text: str, dimension: str) -> float:
    """Number of an option in the scene's own unit, or with a unit in SI."""
    from jbeamshell.scene.quantities import quantity

    with contextlib.suppress(ValueError):
        return float(text)
    return quantity(name, text, *ALL[dimension][:2])


def specimen_of(options: argparse.Namespace) -> Dimensions:
    """Dimensions that the options give: in SI, or a width, force and friction in own units."""
    from jbeamshell.scene.dimensions import KEYS, Dimensions, dimensions_of

    given = _given(options, ALL) if hasattr(options, "specimen") else {}  # some take none
    if given and set(given) <= set(OWN):
        return Dimensions({KEYS[name]: _own(f"--{name}", t, name) for name, t in given.items()})
    return dimensions_of(given)


def with_units(
    values: Mapping[str, Any], below: Mapping[str, Any], width_of_all: float | None
) -> dict[str, Any]:
    """Values of which texts such as "4kN" are numbers in SI.

    Parameters
    ----------
    values : values by dotted key, as the command line gives them
    below : values of the scene that they override, which tell what the amplitude is
    width_of_all : width [m], of which forces are totals; None if it is not known
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
    from jbeamshell.scene.keys import LENGTHS, NUMBERS, TABLE
    from jbeamshell.scene.quantities import QUANTITY

    found = QUANTITY.fullmatch(text)
    if key not in NUMBERS or found is None or found[2] is None:
        return text
    kind = TABLE[key].unit
    if key == "load.amplitude" and values.get("load.control") in LENGTHS:
        kind = "length"
    base = SI.get(kind)
    factor = None if base is None else factor_of(found[2], (base,))
    if "/width" in kind:
        whole = SI[kind.replace("/width", "")]
        total = factor_of(found[2], (whole,))
        if width_of_all is not None:
            base = whole
            factor = total if factor is None or total is not None else factor * width_of_all
        elif factor is None and total is not None:
            raise InputError(
                f"{key} = {text!r}: forces are per width: give --width too, such as --width 50mm, "
                "or write a force per width, such as 80kN/m"
            )
    if factor is None:
        fix = f"{found[2][:20]!r} is no unit of it: write {base}" if base else "takes no unit"
        raise InputError(f"{key} = {text!r}: {fix}")
    return float(found[1]) * factor


def check_standard(below: Mapping[str, Any], given: Mapping[str, Any]) -> None:
    """Raise `InputError` for a width given to the standard strip, which is for one unit of width.

    Parameters
    ----------
    below : values by dotted key of the scene that was named
    given : values by dotted key that override them
    """
    if given.get("strip.width") is None:
        return
    fix = "the standard strip is for one unit of width: give a scene, or a specimen's dimensions, "
    fix += "such as --length 120mm"
    require("--width", given["strip.width"], bool(below) or len(given) > len(OWN), fix)


def check_specimen(values: Mapping[str, Any]) -> None:
    """Raise `InputError` for a specimen in SI that takes a number of the standard strip.

    Parameters
    ----------
    values : values by dotted key that were given
    """
    from jbeamshell.scene.keys import DERIVED

    said = {DERIVED.get(key, key) for key in values}
    said |= {"strip.axial_stiffness"} if "strip.layers" in said else set()
    for key, option in NEEDED.items():
        if key not in said:
            fix = f"give it, such as --{option} {ALL[option].example}"
            if option == "pressure":
                fix += f", or --bolts {ALL['bolts'].example} --torque {ALL['torque'].example}"
            raise InputError(f"{key}: the specimen is in SI, the standard strip is not: {fix}")


def check_load(scene: Scene, values: Mapping[str, Any]) -> None:
    """Raise `InputError` for a specimen in SI without a load, and propose one.

    Parameters
    ----------
    scene : scene of the specimen
    values : values by dotted key that were given
    """
    if "load.amplitude" in values or scene.load.cycles == 0:
        return
    gross = float(scene.gross_slip)
    unit = "N/m" if scene.strip.width is None else "N"
    half = with_unit(PART * gross, unit, 3).replace(" ", "")
    raise InputError(
        "load.amplitude: is not given, and the specimen slides at mu F_N L = "
        f"{with_unit(gross, unit)}: give a part of it, such as --set load.amplitude={half}"
    )

"""Columns of a table: which hold the force and the displacement, and in which units.

The only file that imports pint.
"""

from __future__ import annotations

import functools
import re
import shlex
import unicodedata
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jbeamshell.common.errors import InputError

# Base units; a force per width will do, as the model has unit width.
QUANTITIES = {"force": ("N", "N/m"), "displacement": ("m",)}
INSTEAD = {"acceleration": ("m/s^2",)}  # of the displacement
FURTHER = {"time": ("s",), "normal_force": ("N", "N/m")}
GROUPS = ("loop", "a", "amplitude")

# Words that count only where no column has the quantity's own: English, German, French, Italian;
# accents are left out.  A German compound counts by its last part: "Kolbenweg".
SYNONYMS = {
    "force": {"load", "kraft", "last", "effort", "charge", "forza", "carico"},
    "displacement": {
        *("disp", "displ", "slip", "position", "stroke", "extension", "deflection"),
        *("weg", "verschiebung", "auslenkung", "schlupf", "hub"),
        *("deplacement", "course", "glissement", "allongement"),
        *("spostamento", "corsa", "scorrimento", "allungamento"),
    },
    "time": {"zeit", "temps", "tempo"},
    "acceleration": {"acc", "accel", "beschleunigung", "accelerazione"},
}
COMPOUNDS = {"force": ("kraft",), "displacement": ("weg", "verschiebung"), "time": ("zeit",)}
COMPOUNDS["acceleration"] = ("beschleunigung",)
SHORT = {
    "force": {"f", "ft", "fx", "f_t", "f_x"},
    "displacement": {"u", "ux", "u_x"},
    "time": {"t"},
    "normal_force": {"fn", "normal"},
    "acceleration": set[str](),
}
NORMAL = (
    *("normal", "clamp", "preload", "pretension"),
    *("vorspann", "klemm", "schraubenkraft", "serrage", "precharge", "serraggio", "precarico"),
)
# A load step is no force, and a rate no displacement.
EXPONENT = re.compile(r"(?<=[\d.,])[eE](?=[+-]?\d)")  # of a number
COUNTERS = {"step", "number", "no", "case", "cycle", "cycles", "rate", "time", "speed", "velocity"}
COUNTERS |= {"nr", "nummer", "schritt", "zyklus", "zyklen", "numero", "ciclo", "cicli"}
COUNTERS |= {"rapporto", "vitesse", "velocita", "geschwindigkeit"}

# A unit: letters, powers of one digit, products and quotients; no sums, no nested powers.
TERM = r"[^\W\d_]+(?:(?:\^|\*\*)?-?[1-4]|[²³])?|[%°]"
UNIT = re.compile(rf"(?:{TERM})(?:(?: ?[/*·.] ?| )(?:{TERM}))*")
# A sensor's factor before its unit: "0.05mm", "2.5e-2 kN/V".
SCALED = re.compile(r"\s*(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+)\s*\*?\s*([^\d\s*.+-].*)")
# Units after a space or an underscore, which may be followed by other words too.
TAIL = re.compile(
    r"(?:[GMkcmuµμn]?N(?:/[cmuµμn]?m)?|[kdcmuµμnp]?m|[mkuµμn]?s|sec|%|rad|deg|in|inch|ft|mil|"
    r"thou|micron|k?lbf?|kip|[kg]?gf|dyn|"
    r"(?:giga|mega|kilo|centi|milli|micro|nano)?(?:newton|met(?:er|re)|second)s?)"
)
VOLT = "V"  # unit of a signal
OTHER_NAMES = {"mil": "thou"}  # in pint
LONGEST_TITLE = 1000  # characters; of a longer title only its beginning is read


class Conversion(NamedTuple):
    """Factor from the unit of a column to a base unit, which is empty for the Scene's own."""

    factor: float = 1.0
    unit: str = ""


def find_columns(
    titles: Sequence[str], chosen: Mapping[str, str], name: str, place: str
) -> dict[str, int]:
    """Find the columns of force and displacement, and those of time, normal force and group.

    A title with the name of the quantity counts first; a title with another word for it counts if
    there is no such title.  A column of a normal force or a preload is never the force.

    Parameters
    ----------
    titles : titles of the columns
    chosen : title by quantity, for columns that are not found by name
    name, place : name of the table and place of its titles, for messages; no place without titles

    Returns
    -------
    Index of the column by "force" and "displacement", or "acceleration" if there is no
    displacement; also by "time", "normal_force" and "group" if there is exactly one

    Raises
    ------
    InputError
        if there is no column for a quantity, or more than one
    """
    known = (*QUANTITIES, *FURTHER)
    for quantity in chosen:
        if quantity not in (*known, *INSTEAD):
            raise InputError(f"columns: {quantity!r} is no quantity: choose among {known}")
    held = _listed(titles)
    columns: dict[str, int] = {}
    for quantity in known:
        if quantity in chosen:
            columns[quantity] = _chosen(titles, quantity, chosen[quantity], name, held)
            continue
        found = _candidates(titles, quantity)
        if quantity == "displacement" and "acceleration" in chosen:
            found = []
        if len(found) == 1:
            columns[quantity] = found[0]
        elif quantity == "displacement" and (instead := _instead(titles, chosen, name, held)):
            columns |= instead
        elif quantity in QUANTITIES:
            if not place:
                raise InputError(f"{name}: {no_header(QUANTITIES)}")
            needed = f"{name}: needs one column named {quantity!r} {place}, which holds {held}: "
            if not found:
                raise InputError(
                    f"{needed}name it there, or choose it by {choice(quantity, 'NAME')}"
                )
            rivals = _listed([titles[i] for i in found])
            option = choice(quantity, titles[found[0]].strip()[:60])
            raise InputError(f"{needed}choose among {rivals[:90]} by {option}")
    if list(columns.values()).count(columns["force"]) > 1:
        whole = titles[columns["force"]].strip()[:60]
        raise InputError(
            f"{name}: has one column only {place}: separate columns by commas, semicolons, tabs "
            "or blanks"
            if len(titles) == 1
            else f"{name}: {whole!r} cannot be both force and displacement: name one of them"
        )
    plain = [bare(title).strip().lower() for title in titles]
    group = next((i for i, title in enumerate(plain) if title in GROUPS), None)
    if group is not None and group not in columns.values():
        columns["group"] = group
    return columns


def _instead(
    titles: Sequence[str], chosen: Mapping[str, str], name: str, held: str
) -> dict[str, int]:
    """Index of the column of an acceleration; empty unless there is one, and no displacement."""
    if "acceleration" in chosen:
        place = _chosen(titles, "acceleration", chosen["acceleration"], name, held)
        return {"acceleration": place}
    found = _candidates(titles, "acceleration")
    alone = len(found) == 1 and not _candidates(titles, "displacement")
    return {"acceleration": found[0]} if alone else {}


def is_header(titles: Sequence[str], chosen: Mapping[str, str]) -> bool:
    """True if a row of cells holds a title for the force and another for the displacement."""
    if not any(re.search(r"[^\W\d_]", EXPONENT.sub("", title)) for title in titles):
        return False  # numbers, of which tables have many rows
    try:
        find_columns(titles, chosen, "", "")
    except InputError:
        # With several columns for one quantity it is a header too, to be refused, not skipped.
        wanted = [q for q in QUANTITIES if q not in chosen]
        return len(titles) > 1 and all(_candidates(titles, q) for q in wanted) and bool(wanted)
    return True


def conversions(
    titles: Mapping[str, str],
    below: Mapping[str, str | None],
    given: Mapping[str, str],
    name: str,
) -> dict[str, Conversion | None]:
    """Conversions of each column to N (or N/m), m and s.

    Parameters
    ----------
    titles : title by quantity, which may end in a unit in brackets, or after an underscore or space
    below : unit by quantity in the row below the header
    given : unit by quantity that overrides titles and row
    name : name of the table, for messages

    Returns
    -------
    Conversion by quantity; None for a time or normal force whose unit does not suit the others

    Raises
    ------
    InputError
        if a unit does not suit its quantity, or if only one of force and displacement has one
    """
    units: dict[str, str | None] = {}
    for quantity, title in titles.items():
        own, row = unit_of(title), below.get(quantity)
        if own and row and own != row and quantity not in given:
            raise InputError(
                f"{name}: column {title!r} has the unit {row!r} in the row below the header: "
                "keep one of the two units"
            )
        units[quantity] = given.get(quantity) or own or row
    named = [bool(units[q]) for q in (*QUANTITIES, *INSTEAD) if q in units]
    all_bases = QUANTITIES | FURTHER | INSTEAD
    found: dict[str, Conversion | None] = {}
    for quantity, unit in units.items():
        title = titles[quantity][:60]
        bases = all_bases[quantity]
        unit = "gravity" if quantity == "acceleration" and unit == "g" else unit  # no gram
        converted = Conversion() if unit is None else conversion(unit, bases)
        if converted is None and quantity in given:  # of a signal: mm/V
            signals = (unit_of(titles[quantity]), below.get(quantity), VOLT)
            products = (conversion(f"{unit}*{signal}", bases) for signal in signals if signal)
            converted = next(filter(None, products), None)
        if quantity in FURTHER:
            mixed = quantity == "normal_force" and bool(unit) != named[0]
            found[quantity] = None if mixed else converted
        elif any(named) and unit is None:
            raise InputError(
                f"{name}: column {title!r} names no unit but the other one does: write "
                f"'{title} [{bases[0]}]', or give it by {choice(quantity, bases[0], 'unit')}"
            )
        elif converted is None and conversion(str(unit), (VOLT,)):
            factor = f"0.05{bases[0]}/{VOLT}"
            raise InputError(
                f"{name}: column {title!r} is a signal in {unit!r}: give each sensor's factor, "
                f"such as {choice(quantity, factor, 'unit')}"
            )
        elif converted is None:
            raise InputError(
                f"{name}: column {title!r}: {str(unit)[:40]!r} is no unit of {quantity}: write one "
                f"in brackets, such as '{quantity} [{bases[0]}]', or give it by "
                f"{choice(quantity, bases[0], 'unit')}{_of_factor(str(unit), quantity, bases[0])}"
            )
        else:
            found[quantity] = converted
    return found


def _of_factor(unit: str, quantity: str, base: str) -> str:
    """Words on a sensor's factor, if a text that is no unit begins with a number."""
    told = f"; a sensor's factor goes before its unit, as in 0.05{base}"
    turned = f", and a sign is turned by --reverse {quantity}" * unit.startswith("-")
    return told + turned if re.match(r"[-+.\d]", unit) else ""


def unit_of(title: str) -> str | None:
    """Unit in a title, in brackets or at its end; None if there is none."""
    title = title[:LONGEST_TITLE]
    bracket = re.findall(r"\[([^\]]*)\]", title) or re.findall(r"\(([^)]*)\)", title)
    if bracket:
        unit = bracket[-1].strip()
        return None if unit in ("", "-", "1") else unit
    tail = re.fullmatch(r".*[^\W_].*?[ _]+(\S+?)\s*", title)
    return tail.group(1) if tail and TAIL.fullmatch(tail.group(1)) else None


def _candidates(titles: Sequence[str], quantity: str) -> list[int]:
    own = [i for i, title in enumerate(titles) if _named(title, quantity)]
    if own:
        return own
    return [i for i, title in enumerate(titles) if _meant(title, quantity)]


def _named(title: str, quantity: str) -> bool:
    lower = _plain(title)
    if quantity == "time":
        return "time" in _words(title)
    if quantity == "normal_force":
        return _is_normal(title) and "force" in lower
    return quantity in lower and not (quantity == "force" and _is_normal(title))


def _meant(title: str, quantity: str) -> bool:
    words = _words(title)
    if bare(title).strip().lower() in SHORT[quantity]:
        return True
    if quantity == "time":
        return _has_word(words, "time") and len(words) == 1
    if quantity == "normal_force":
        return _is_normal(title) and _has_word(words, "force")
    others = [q for q in QUANTITIES if q != quantity]
    if any(_named(title, other) for other in others) or _is_normal(title) or COUNTERS & words:
        return False
    return _has_word(words, quantity)


def _has_word(words: set[str], quantity: str) -> bool:
    """True if a word for the quantity is among some words, by itself or as a compound's end."""
    return bool(SYNONYMS[quantity] & words) or any(
        word.endswith(COMPOUNDS[quantity]) for word in words
    )


def _is_normal(title: str) -> bool:
    """True if a title names a force that presses the surfaces together."""
    return any(word in _plain(title) for word in NORMAL)


def _words(title: str) -> set[str]:
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", bare(title))
    return set(re.findall(r"[a-z]+", _plain(spaced)))


def _plain(title: str) -> str:
    """Small letters without accents."""
    apart = unicodedata.normalize("NFKD", title[:LONGEST_TITLE].lower())
    return "".join(letter for letter in apart if not unicodedata.combining(letter))


def bare(title: str) -> str:
    """Title without its unit in brackets."""
    return re.sub(r"\[[^\]]*\]?|\([^)]*\)?", " ", title[:LONGEST_TITLE])


def _chosen(titles: Sequence[str], quantity: str, title: str, name: str, held: str) -> int:
    if title.strip().isdigit() and f"column {title.strip()}" in titles:
        return titles.index(f"column {title.strip()}")
    keys: list[Any] = [str.strip, lambda t: t.strip().lower(), lambda t: bare(t).strip().lower()]
    found: list[int] = []
    for key in keys:
        found = [i for i, t in enumerate(titles) if key(t) == key(str(title))]
        if len(found) == 1:
            return found[0]
    fix = "rename columns of the same name" if found else "choose one of these"
    raise InputError(
        f"{name}: columns has {quantity!r}: {str(title)[:60]!r}, but the table holds {held}: {fix}"
    )


def choice(quantity: str, value: str, option: str = "column") -> str:
    """Option that sets the column or the unit of a quantity, as the shell and Python have it."""
    shell = f"--{option} {quantity}={shlex.quote(value)}"
    return f"{shell} (in Python {option}s={{{quantity!r}: {value!r}}})"


def no_header(quantities: Mapping[str, Sequence[str]]) -> str:
    """Sentence on a table of numbers alone: how to say what its columns hold."""
    columns = " ".join(f"--column {name}={i}" for i, name in enumerate(quantities, 1))
    units = " ".join(f"--unit {name}={bases[0]}" for name, bases in quantities.items() if bases)
    return (
        f"has no header: say which columns hold what, by their numbers, such as {columns} {units} "
        "(in Python columns={...}, units={...}), or write a header"
    )


def _listed(titles: Sequence[str]) -> str:
    return ", ".join(repr(title.strip()) for title in titles)[:200]


def factor_of(unit: str, bases: Sequence[str]) -> float | None:
    """Factor that converts a unit to the first base unit that suits it; None if none does."""
    found = conversion(unit, bases)
    return None if found is None else found.factor


def conversion(unit: str, bases: Sequence[str]) -> Conversion | None:
    """Conversion of a unit to the first base unit that suits it; None if none does.

    A number before the unit is a sensor's factor: "0.05mm" is one twentieth of a millimetre.
    """
    if unit in bases:
        return Conversion(1.0, unit)
    if scaled := SCALED.fullmatch(unit):
        found, number = conversion(scaled[2], bases), float(scaled[1])
        usable = found is not None and 0.0 < number < np.inf
        return Conversion(number * found.factor, found.unit) if found and usable else None
    if len(unit) > 32 or not UNIT.fullmatch(unit):
        return None
    registry, unit = _registry(), OTHER_NAMES.get(unit, unit)
    for base in bases:
        try:
            factor = float(registry.Quantity(1.0, unit).to(base).magnitude)
        except Exception:  # pint's parser may raise anything for what is no unit
            continue
        if np.isfinite(factor) and factor > 0.0:
            return Conversion(factor, base)
    return None


@functools.cache
def _registry() -> Any:
    import pint  # slow to import

    return pint.UnitRegistry()

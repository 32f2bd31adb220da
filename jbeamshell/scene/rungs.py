"""Rungs of the ladder of models by name, from a bar to plane elasticity.

| name | model |
|---|---|
| ``bar`` | Goodman's one-dimensional bar, in closed form |
| ``shell`` | fields v and beta |
| ``squeeze`` | fields v, beta and psi |
| ``p1``, ``p2``, ``p3``, ... | sections of order p, see `jbeamshell.mechanics.hierarchic` |
| ``stepwise-bar`` | field v by Newton's method, for bars without a closed form |
| ``condensed-squeeze``, ``condensed-p2``, ... | linear section on its contact line, exact in time |
| ``plane`` | plane elasticity on its contact line, exact in time, see `jbeamshell.condensed` |

All rungs but the bars have the field w if the scene has it; those on the contact line always have
it, and have linear kinematics.  A section's own name (``squeeze``, ``p2``) leaves open how it is
solved, see `jbeamshell.scene.choice`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from jbeamshell.common.errors import InputError
from jbeamshell.scene.rows import AUTO

LARGEST_ORDER = 12
FIELDS_OF = {"bar": ("v",), "shell": ("v", "beta"), "squeeze": ("v", "beta", "psi")}
SETS = ("model.fields", "model.order", "model.solution")  # keys that a rung's name sets
CONDENSED = ("condensed", "plane")  # solutions on the contact line, exact in time
PLANE_NODES = 129  # of the rung ``plane``, for a tolerance of .5 %
_NAME = re.compile(r"(?P<prefix>(stepwise|condensed)-)?(?P<section>[a-z]+|p\d+)")
_OLD = re.compile(r"masing(-pull)?(-(?P<section>bar|shell|squeeze|p\d+))?")


def values_of(rung: Any, lift: bool = False) -> dict[str, Any]:
    """Values by dotted key that make a model a rung; raises `InputError` for an unknown name.

    Parameters
    ----------
    rung : name of the rung
    lift : True if the strip may lift off

    Examples
    --------
    >>> values_of("p2")["model.order"]
    2
    """
    text = rung if isinstance(rung, str) else repr(rung)
    if text == AUTO:
        return dict(zip(SETS, (AUTO, 0, AUTO), strict=True))
    _refuse_old(text)
    match = _NAME.fullmatch(text)
    prefix = (match["prefix"] or "").rstrip("-") if match else ""
    section = match["section"] if match else ""
    order = int(section[1:]) if re.fullmatch(r"p\d+", section) else 0
    ordered = section not in FIELDS_OF and 1 <= order <= LARGEST_ORDER
    plane = text == "plane"
    bar = {"stepwise": section == "bar", "condensed": section != "bar"}  # the rest by no prefix
    if not match or not bar.get(prefix, True) or not (ordered or plane or section in FIELDS_OF):
        raise InputError(
            f"model.rung = {rung!r}: choose 'auto', 'bar', 'shell', 'squeeze', "
            f"'p1' to 'p{LARGEST_ORDER}', 'plane', or 'condensed-' and one of these"
        )
    fields = FIELDS_OF.get(section, FIELDS_OF["squeeze"])
    closed = section == "bar" and not prefix
    solution = "closed-form" if closed else "plane" if plane else prefix or AUTO
    condensed = solution in CONDENSED
    if (lift or condensed) and section != "bar":
        fields = ("v", "w", *fields[1:])
    values = dict(zip(SETS, (fields, order, solution), strict=True))
    return values | ({"model.kinematics": "linear"} if condensed else {})


def _refuse_old(rung: str) -> None:
    """Raise `InputError` with the name to use for a rung by Masing's rule, which there was once."""
    if old := _OLD.fullmatch(rung):
        section = old["section"] or "squeeze"
        raise InputError(f"model.rung = {rung!r}: is no model any more: take {section!r}")


def general_rung(rung: str) -> str:
    """Name of the rung that walks in load steps what a rung on the contact line cannot."""
    return "p6" if rung == "plane" else rung.removeprefix("condensed-")


def name_of(fields: Sequence[str], order: int, solution: str) -> str:
    """Name of a model's rung."""
    if solution == "plane":
        return solution
    if order > 0:
        section = f"p{order}"
    else:
        section = {1: "bar", 2: "shell", 3: "squeeze"}[len(set(fields) - {"w"})]
    if solution == "closed-form":
        return section
    if solution in ("stepwise", AUTO):
        return "stepwise-bar" if section == "bar" else section
    return f"{solution}-{section}"


def spelled_out(
    values: dict[str, Any], fields: Sequence[str] = (), solution: str = AUTO
) -> dict[str, Any]:
    """Values by dotted key, with ``model.rung`` replaced by the keys that it sets.

    Parameters
    ----------
    values : values by dotted key
    fields : fields of the model that is changed; with w among them, the rung has w too
    solution : its solution; if it is "stepwise", a section's own name keeps it

    Raises
    ------
    InputError
        if the rung is unknown or a former one, or if the values disagree with it
    """
    if values.get("model.solution") in ("masing", "masing-pull"):
        fix = "is no solution any more: leave it out, which solves whole cycles"
        raise InputError(f"model.solution = {values['model.solution']!r}: {fix}")
    if "model.rung" not in values:
        return values
    rung, given = values["model.rung"], values.get("model.fields", fields)
    lift = isinstance(given, list | tuple) and "w" in given
    meant = values_of(rung, lift)
    for key, value in meant.items():
        other = values.get(key, value)
        same = tuple(other) == value if isinstance(other, list | tuple) else other == value
        if value == AUTO:
            meant[key] = other if key in values or solution != "stepwise" else solution
        elif not same:
            rotates = f", or take {general_rung(rung)}, which rotates"
            fix = "give one" + (rotates if key == "model.kinematics" else "")
            raise InputError(f"model.rung = {rung!r} and {key} = {other!r} disagree: {fix}")
    if rung == "plane":
        meant["model.nodes"] = values.get("model.nodes", AUTO)
    return {key: value for key, value in values.items() if key != "model.rung"} | meant

"""Quantities with units, from texts such as "120 mm"."""

from __future__ import annotations

import math
import re
from typing import Any

from jbeamshell.common.checks import require, shown
from jbeamshell.common.errors import InputError
from jbeamshell.measured.columns import factor_of

NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
QUANTITY = re.compile(rf"\s*({NUMBER})\s*([^\d\s.+-].*?)?\s*")
TORQUE = re.compile(r"([GMk]?N)m")  # as people write newton metres


def quantity(name: str, text: Any, unit: str, example: str) -> float:
    """Positive number in a base unit from a text such as "120 mm".

    Parameters
    ----------
    name : name for messages
    text : number and unit
    unit : base unit, "m", "N", "N m" or "Pa"
    example : text that would do

    Raises
    ------
    InputError
        if it is no positive number, or if its unit is missing or of another kind
    """
    match = QUANTITY.fullmatch(text) if isinstance(text, str) else None
    if match is None or match[2] is None:
        number = match is not None or (isinstance(text, int | float) and not isinstance(text, bool))
        fix = "names no unit" if number else "is no number with a unit"
        raise InputError(f"{name} = {shown(text)}: {fix}: write one, such as {example}")
    factor = factor_of(TORQUE.sub(r"\1 m", match[2]), (unit,))
    if factor is None:
        fix = f"{match[2][:20]!r} is no unit that {unit} measures: write {example}"
        raise InputError(f"{name} = {text!r}: {fix}")
    value = float(match[1]) * factor
    require(name, text, 0.0 < value < math.inf, "must be positive")
    return value

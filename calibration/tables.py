"""Tables of the finite elements in calibration/data."""

import csv
import functools
from typing import Any

from jbeamshell.measured.example import data_folder

Row = dict[str, Any]


def rows(name: str) -> list[Row]:
    """Rows of a table by column, as numbers where they are; None is an empty cell."""
    with (data_folder() / name).open(newline="", encoding="utf-8") as file:
        return [{key: _value(text) for key, text in row.items()} for row in csv.DictReader(file)]


def _value(text: str) -> Any:
    if not text:
        return None
    try:
        return float(text)
    except ValueError:
        return text


@functools.cache
def energies() -> dict[tuple[float, float], Row]:
    """Energies of cycles of the standard strip by (eta, A)."""
    return {(row["eta"], row["A"]): row for row in rows("energy.csv")}

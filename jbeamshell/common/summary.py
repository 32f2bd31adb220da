"""Summary of a result: a title, a short table and remarks, as text and as HTML; its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import NamedTuple

import numpy as np


class Summary(NamedTuple):
    """Summary of a result.

    Attributes
    ----------
    title : lines above the table; empty if there are none
    rows : names and values
    notes : remarks below the table
    """

    title: str
    rows: Sequence[tuple[str, str]]
    notes: Sequence[str] = ()

    def as_text(self, width: int = 20) -> str:
        """Lines of text; names take the given number of characters."""
        rows = (f"  {name:{width}s} {value}" for name, value in self.rows)
        title = [self.title] if self.title else []
        return "\n".join([*title, *rows, *(f"  {note}" for note in self.notes)])

    def as_html(self, picture: str = "") -> str:
        """HTML for a notebook, with a picture that is HTML itself beside the table."""
        rows = "".join(
            f"<tr><td>{escape(name)}</td><td>{escape(value)}</td></tr>" for name, value in self.rows
        )
        notes = "".join(f"<div>{escape(note)}</div>" for note in self.notes)
        title = escape(self.title).replace("\n", "<br>")
        beside = f'<div style="display:flex;gap:1em"><table>{rows}</table>{picture}</div>'
        return f"<div>{title}{beside}{notes}</div>"


def in_words(value: object) -> str:
    """Value of a table: a number to six digits, other values as they are."""
    if isinstance(value, float):
        return f"{value:.6g}"
    return "undefined" if value is None else str(value)


PREFIXES = {"M": 1e6, "k": 1e3, "": 1.0, "m": 1e-3, "u": 1e-6, "n": 1e-9}


def with_unit(value: float, unit: str = "", digits: int = 4) -> str:
    """Number with its unit, such as "23 um" for 2.3e-5 m; a number alone if the unit is empty."""
    return f"{value:.{digits}g}" if not unit else _prefixed([value], unit, digits)


def ranged(values: np.ndarray, unit: str = "", digits: int = 4) -> str:
    """Smallest and largest of some values with their unit, such as "-12 to 12 kN"."""
    ends = [float(np.nanmin(values)), float(np.nanmax(values))]
    if ends[0] == ends[1]:
        return with_unit(ends[0], unit, digits)
    if not unit:
        return f"{ends[0]:.{digits}g} to {ends[1]:.{digits}g}"
    return _prefixed(ends, unit, digits)


def _prefixed(values: Sequence[float], unit: str, digits: int) -> str:
    largest = max(map(abs, values))
    fits = [(name, size) for name, size in PREFIXES.items() if largest >= size]
    name, size = fits[0] if fits and unit != "s" else ("", 1.0)
    return " to ".join(f"{value / size:.{digits}g}" for value in values) + f" {name}{unit}"

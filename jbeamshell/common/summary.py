"""Summary of a result: a title, a short table and remarks, as text and as HTML."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import NamedTuple


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

"""Line breaks of a page, and tables and pictures that are too wide for a phone.

A number stays with its exponent and unit, and an option with its hyphens.  Long names in code break
behind a dot or a slash.  Wide tables and pictures get a class, by which `static/site.css` lets them
scroll in their own box.
"""

import re
import struct
from pathlib import Path
from typing import Any

from docutils import nodes

NUMBER = re.compile(r"-?\d[\d.,]*(?:e-?\d+| (?:%|s|ms|µs|mm|µm|Hz|N|kN|MPa)(?![\w/]))")
OPTION = re.compile(r"(?<![\w-])--?[a-z][\w-]*")
SHELL = re.compile(r'(?<=<div class="highlight-sh notranslate">).*?(?=</div>)', re.DOTALL)
CODE = re.compile(r'(<code class="[^"]*literal.*?</code>)', re.DOTALL)
WORD = re.compile(r'(?<=<span class="pre">)[^<]+(?=</span>)')
BEHIND = re.compile(r"(?<=\w[./_=,(@-])(?=\w)")
LONG = 22  # characters of a word of code, which fits half a phone
CELL, TABLE = 22, 56  # characters of a column, at most, and of a table that fits a phone
WIDE, PIXELS = 1.5, 560  # width of a picture over its height, and width from which it is too wide
PNG_SIZE = slice(16, 24)


def mark(app: Any, doctree: nodes.document, _: str) -> None:
    """Mark numbers, wide tables and wide pictures."""
    for text in list(doctree.findall(nodes.Text)):
        if isinstance(text.parent, (nodes.paragraph, nodes.emphasis, nodes.strong)):
            text.parent.replace(text, list(_whole_numbers(text)))
    for table in doctree.findall(nodes.table):
        if _characters(table) > TABLE:
            table["classes"].append("wide")
    for image in doctree.findall(nodes.image):
        if _is_wide(Path(app.srcdir, image["uri"])):
            image["classes"].append("wide")


def break_code(_: Any, __: str, ___: str, context: dict[str, Any], ____: Any) -> None:
    """Let long names of code break, and keep options whole."""
    if "body" in context:
        body = SHELL.sub(lambda found: OPTION.sub(_whole, found[0]), context["body"])
        context["body"] = CODE.sub(lambda found: WORD.sub(_breakable, found[0]), body)


def _whole_numbers(text: nodes.Text) -> Any:
    """Parts of a text, with its numbers in elements of a class."""
    end = 0
    for found in NUMBER.finditer(text):
        yield nodes.Text(text[end : found.start()])
        yield nodes.inline("", found[0], classes=["whole"])
        end = found.end()
    yield nodes.Text(text[end:])


def _characters(table: nodes.table) -> int:
    """Characters of a row of the longest cells, without the header, whose words wrap."""
    rows = [[cell.astext() for cell in row.children] for row in _body(table)]
    columns = zip(*rows, strict=False)
    return sum(min(max(map(len, column)), CELL) for column in columns)


def _body(table: nodes.table) -> Any:
    """Rows below the header."""
    return (row for body in table.findall(nodes.tbody) for row in body.findall(nodes.row))


def _is_wide(path: Path) -> bool:
    """True of a PNG file whose text would be too small on a phone."""
    if path.suffix != ".png" or not path.is_file():
        return False
    with path.open("rb") as file:
        width, height = struct.unpack(">II", file.read(PNG_SIZE.stop)[PNG_SIZE])
    return bool(width > PIXELS and width > WIDE * height)


def _whole(found: re.Match[str]) -> str:
    return f'<span class="whole">{found[0]}</span>'


def _breakable(found: re.Match[str]) -> str:
    return BEHIND.sub("<wbr>", found[0]) if len(found[0]) > LONG else found[0]

"""Tables of text in any common dialect.

The delimiter is a comma, a semicolon, a tab or blanks, the decimal mark a point or a comma, the
encoding UTF-8, UTF-16 or Latin-1.  Comments, lines above the header and a row of units are
understood.  Content with two possible meanings is refused, never guessed.
"""

from __future__ import annotations

import codecs
import csv
import io
import os
import re
from array import array
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.measured.tables import Table, read_bytes

DELIMITERS = "\t;, "  # most trusted first: commas also are decimal marks
PREAMBLE = 100  # most lines above the header
SAMPLE = 50  # rows by which a delimiter is judged
LONGEST_LINE = 1_000_000  # characters
BLANKS = re.compile(r"\s+(?![\[(])")  # a unit in brackets belongs to its title
MISSING = {"", "-", "--", "na", "n/a", "#n/a", "null", "none"}
MISSING |= {"1.#qnan", "-1.#ind", "-nan", "nan(ind)", "-nan(ind)"}

CONTROL = re.compile("[\x00-\x08\x0b\x0e-\x1f\x7f-\x9f]")
COMMENT = re.compile(r"\s*[#%](?!n/a)", re.IGNORECASE)
WORD = re.compile(r"[\[(\s]*[^\W\d_]|%")  # beginning of a unit, not of a number
GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")  # 1,234: decimal comma, or thousands?
ONE_MARK = "write all numbers with one decimal mark and without thousands separators"
DIGITS = re.compile(r"[+-]?[\d.,]+([eE][+-]?\d+)?")


class TextTable(Table):
    """Table in a text file.

    Parameters
    ----------
    path : text file
    recognised : function that is True for the titles of a header; if no row is one, the first row
        with as many cells as the numbers below it is taken
    decimal : decimal mark, "." or ","; None infers it from the numbers
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        recognised: Callable[[Sequence[str]], bool],
        decimal: str | None = None,
    ) -> None:
        self.name = Path(path).name
        text = decoded(read_bytes(path), self.name)
        self._lines = list(io.StringIO(text, newline=None))
        longest = max(map(len, self._lines), default=0)
        if longest > LONGEST_LINE:
            raise InputError(
                f"{self.name}: has a line of {longest:,} characters: keep the columns of "
                "force, displacement and time only"
            )
        self._decimal = decimal
        self._first = 0  # number of lines before those that may hold numbers
        content = list(islice(self._content(), PREAMBLE + SAMPLE))
        if not content:
            raise InputError(
                f"{self.name}: is empty: give a header and rows of force and displacement"
            )
        self._delimiter = max(",;\t", key=content[0][1].count)
        number, line = self._header(content, recognised)
        self.titles = _filled(self._cells(number, line))
        self.place, self._first = f"in line {number}", number
        if _are_numbers(self.titles):
            self.titles = [f"column {place}" for place in range(1, len(self.titles) + 1)]
            self.place, self._first = "", number - 1

    def _header(
        self, content: list[tuple[int, str]], recognised: Callable[[Sequence[str]], bool]
    ) -> tuple[int, str]:
        """Number and text of the header's line; sets the delimiter."""
        above = enumerate(self._lines[: content[0][0] - 1], 1)
        remarks = [(n, re.sub(r"^[\s#%]+", "", line)) for n, line in above if line.strip()]
        # NumPy's savetxt writes the header as a comment: search those if no row is a header.
        for lines, fewest in ((content[:PREAMBLE], 0), (remarks[: -PREAMBLE - 1 : -1], 1)):
            found = []
            for delimiter in DELIMITERS:
                for number, line in lines:
                    titles = _split(line, delimiter) or []
                    if recognised(titles):
                        rows = [_split(row, delimiter) or [] for n, row in content if n > number]
                        alike = sum(_alike(row, titles, delimiter) for row in rows)
                        if alike or delimiter != " ":
                            found.append((alike, delimiter, number, line))
            alike, delimiter, number, line = max(found, key=lambda f: f[0], default=(-1, "", 0, ""))
            if alike >= fewest:
                self._delimiter = delimiter
                return number, line
        return self._above_numbers(content)

    def _above_numbers(self, content: list[tuple[int, str]]) -> tuple[int, str]:
        """First line with as many cells as the numbers below it, which may be numbers itself.

        Sets the delimiter; the first line of all is taken if there are no rows of numbers.  Between
        blanks any words would do, so that the first numbers are taken.
        """
        first, delimiter = len(content), self._delimiter
        for mark in DELIMITERS:
            rows = (_filled(_split(line, mark) or []) for _, line in content[:first])
            found = next((i for i, row in enumerate(rows) if _are_numbers(row)), first)
            if found < first:
                first, delimiter = found, mark
        if first == len(content):
            return content[0]
        self._delimiter = delimiter
        if delimiter == " ":
            return content[first]
        cells = [len(_filled(_split(line, delimiter) or [])) for _, line in content[: first + 1]]
        return content[cells.index(cells[-1])]

    def _content(self) -> Iterator[tuple[int, str]]:
        """Lines that are neither blank nor comments, with their numbers, counted from 1."""
        for number, line in enumerate(islice(self._lines, self._first, None), self._first + 1):
            if not line.isspace() and not COMMENT.match(line):
                yield number, line

    def _cells(self, number: int, line: str) -> list[str]:
        cells = _split(line, self._delimiter)
        if cells is None:
            raise InputError(
                f"{self.name}: line {number} is no row of a table: close the quotes in it"
            )
        return cells

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        """Rows of cells with their line numbers, without the empty rows at the end."""
        empty: list[tuple[int, list[str]]] = []
        for number, line in self._content():
            cells = self._cells(number, line)
            if not any(cell.strip() for cell in cells):
                empty.append((number, cells))
                continue
            yield from empty
            empty = []
            if any(cell.strip() for cell in cells[len(self.titles) :]):
                held = f"{len(cells)} cells, the header {len(self.titles)}"
                commas = self._delimiter == ","
                fix = "if its commas are decimal, separate columns by semicolons or tabs"
                raise InputError(
                    f"{self.name}: line {number} has {held}: "
                    + (fix if commas else "give every row as many cells as there are titles")
                )
            yield number, cells

    def units(self, wanted: Sequence[int]) -> list[str | None]:
        number, cells = next(self._rows(), (0, []))
        units: list[str | None] = []
        for i in wanted:
            cell = cells[i].strip() if i < len(cells) else ""
            units.append(re.sub(r"^[\[(\s]+|[\])\s]+$", "", cell) if WORD.match(cell) else None)
        worded = all(unit and unit.lower() not in {*MISSING, "nan", "inf"} for unit in units[:2])
        if not worded:  # force and displacement, at least
            return [None] * len(units)
        self._first = number
        return units

    def numbers(self, wanted: Sequence[int], optional: Sequence[int] = ()) -> NDArray[np.float64]:
        both = [*wanted, *optional]
        columns = [array("d") for _ in both]
        read = _Reader(self._decimal)
        for number, cells in self._rows():
            for j, i in enumerate(both):
                cell = cells[i].strip() if i < len(cells) else ""
                try:
                    value = read(cell)
                except ValueError as error:
                    if j < len(wanted):
                        place = f"line {number}, column {self.titles[i]!r}"
                        raise InputError(
                            f"{self.name}: {place} holds {cell[:40]!r}: "
                            f"{self._fix(cells, i, str(error))}"
                        ) from None
                    value = np.nan
                columns[j].append(value)
        if not columns[0]:
            raise InputError(
                f"{self.name}: holds a header only: give rows of force and displacement"
            )
        if read.doubtful:
            raise InputError(
                f"{self.name}: {read.doubtful!r} may have a decimal comma or a thousands "
                "separator: give --decimal , (in Python decimal=','), or write decimal points"
            )
        return np.column_stack([np.frombuffer(column) for column in columns])

    def _fix(self, cells: list[str], column: int, reason: str) -> str:
        if reason == ONE_MARK:
            return reason
        cell = cells[column].strip()
        numbers = any(DIGITS.fullmatch(other.strip()) for other in cells)
        if numbers or not WORD.match(cell) or next(self._rows())[1] != cells:
            return "give a finite number, or leave the cell empty"
        unit = f"'{self.titles[column]} [{cell.strip('[()]')[:40]}]'"
        return f"if it is a row of units, put them into the header: {unit}"

    def where(self, row: int) -> str:
        return f"line {next(islice(self._rows(), row, None))[0]}"


class _Reader:
    """Reader of numbers that all have one decimal mark.

    Attributes
    ----------
    doubtful : number whose comma may separate thousands; None once a number proves it decimal
    """

    def __init__(self, decimal: str | None) -> None:
        self.doubtful: str | None = None
        self._mark = decimal
        self._proven = decimal is not None

    def __call__(self, cell: str) -> float:
        """Number in a cell, NaN if it is missing; raises ValueError with the reason otherwise."""
        plain = cell
        if "," in cell or ("." in cell and cell.lower() not in MISSING):
            mark = "," if "," in cell else "."
            # With both marks in a number, one of them separates thousands.
            both = "," in cell and "." in cell
            if (self._mark or mark) != mark or both or cell.count(mark) > 1:
                raise ValueError(ONE_MARK if DIGITS.fullmatch(cell) else "")
            plain = cell.replace(",", ".")
        try:
            value = float(plain)
        except ValueError:
            if cell.lower() in MISSING:
                return np.nan
            raise ValueError from None
        if np.isinf(value) or "_" in cell:
            raise ValueError
        if plain is not cell or "." in cell:
            self._mark = "." if "." in cell else ","
        if not self._proven and "," in cell:
            self._proven = not GROUPED.fullmatch(cell)
            self.doubtful = None if self._proven else self.doubtful or cell
        return value


def decoded(data: bytes, name: str) -> str:
    """Text in UTF-8, UTF-16 or Windows-1252; raises `InputError` if it is none of them."""
    text = "\0"
    marked = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    for encoding in ("utf-16",) if marked else ("utf-8-sig", "cp1252"):
        try:
            text = data.decode(encoding)
            break
        except UnicodeDecodeError:
            continue
    if CONTROL.search(text):
        raise InputError(
            f"{name}: is not text in UTF-8 or Latin-1: save it as a CSV table in UTF-8"
        )
    return text


def _filled(cells: Sequence[str]) -> list[str]:
    """Cells without blanks, and without the empty ones after the last delimiters of a line."""
    filled = [cell.strip() for cell in cells]
    while filled and not filled[-1]:
        filled.pop()
    return filled


def _are_numbers(cells: Sequence[str]) -> bool:
    """True for several cells of which all hold numbers, or are missing ones."""
    numbers = [bool(DIGITS.fullmatch(cell)) for cell in cells]
    whole = all(
        number or cell.lower() in {*MISSING, "nan"}
        for number, cell in zip(numbers, cells, strict=True)
    )
    return len(cells) > 1 and any(numbers) and whole


def _alike(row: Sequence[str], titles: Sequence[str], delimiter: str) -> bool:
    """True if a row has as many cells as there are titles; between blanks, cells of numbers."""
    numbers = delimiter != " " or all(DIGITS.fullmatch(cell) for cell in row)
    return numbers and len(row) == len(titles)


def _split(line: str, delimiter: str) -> list[str] | None:
    """Cells of a line; None if its quotes do not pair."""
    if delimiter == " ":
        return BLANKS.split(line.strip())
    if '"' not in line:
        return line.rstrip("\n").split(delimiter)
    try:
        return next(csv.reader([line], delimiter=delimiter, strict=True, skipinitialspace=True))
    except csv.Error:
        return None

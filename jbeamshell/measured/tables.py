"""Tables of text as labs write them: any common dialect, read to columns of numbers.

Comma, semicolon or tab; decimal point or comma; comments, a preamble, a row of units; UTF-8 or
Latin-1.  What could mean two things is refused, never guessed.
"""

from __future__ import annotations

import abc
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

LARGEST = 200_000_000  # bytes
DELIMITERS = "\t;,"  # in the order of trust: the comma has other duties
PREAMBLE = 100  # lines before the header at most
SAMPLE = 50  # rows that a delimiter is judged by
MISSING = {"", "-", "--", "na", "n/a", "#n/a", "null", "none"}
MISSING |= {"1.#qnan", "-1.#ind", "-nan", "nan(ind)", "-nan(ind)"}

CONTROL = re.compile("[\x00-\x08\x0b\x0e-\x1f\x7f-\x9f]")
COMMENT = re.compile(r"\s*[#%](?!n/a)", re.IGNORECASE)
WORD = re.compile(r"[\[(\s]*[^\W\d_]|%")  # what a unit starts with and a number does not
GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")  # 1,234: a decimal comma, or thousands?
ONE_MARK = "write all numbers with one decimal mark and without thousands separators"
DIGITS = re.compile(r"[+-]?[\d.,]+([eE][+-]?\d+)?")


class Table(abc.ABC):
    """Titled columns of numbers.

    Attributes
    ----------
    name : of the file, for messages
    titles : of the columns
    place : where the titles stand, for messages
    """

    name: str
    titles: list[str]
    place: str

    @abc.abstractmethod
    def units(self, wanted: Sequence[int]) -> list[str | None]:
        """What a row of units says about the wanted columns; None where there is no such row.

        To be asked for before the numbers, which start below such a row.
        """

    @abc.abstractmethod
    def numbers(self, wanted: Sequence[int], optional: Sequence[int] = ()) -> NDArray[np.float64]:
        """The wanted and the optional columns, (rows, columns); what is missing is NaN.

        Raises
        ------
        InputError
            for a cell of a wanted column that is neither a finite number nor missing
        """

    @abc.abstractmethod
    def where(self, row: int) -> str:
        """The place of a row of ``numbers``, for messages."""


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """The content of a file of at most 200 MB; raises `InputError`."""
    try:
        with Path(path).open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            data = b"" if size > LARGEST else file.read(LARGEST + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except ValueError as error:  # a NUL in the name
        raise InputError(f"{path!r}: is no file name ({error})") from None
    if max(size, len(data)) > LARGEST:
        raise InputError(
            f"{path}: holds more than {LARGEST // 10**6} MB: keep fewer points or columns of it"
        )
    return data


class TextTable(Table):
    """A table in a text file.

    Parameters
    ----------
    path : the file
    recognised : whether a row of titles is the header; if none is, the first row is taken
    decimal : "." or ","; None finds out
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        recognised: Callable[[Sequence[str]], bool],
        decimal: str | None = None,
    ) -> None:
        self.name = Path(path).name
        self.place = "in its first row"
        text = decoded(read_bytes(path), self.name)
        self._lines = list(io.StringIO(text, newline=None))
        self._decimal = decimal
        self._first = 0  # of the lines that may hold numbers
        content = list(islice(self._content(), PREAMBLE + SAMPLE))
        if not content:
            raise InputError(
                f"{self.name}: is empty: give a header and rows of force and displacement"
            )
        self._delimiter = max(",;\t", key=content[0][1].count)
        number, line = self._header(content, recognised)
        self.titles = [title.strip() for title in self._cells(number, line)]
        while self.titles and not self.titles[-1]:  # a delimiter that ends every line
            self.titles.pop()
        self._first = number

    def _header(
        self, content: list[tuple[int, str]], recognised: Callable[[Sequence[str]], bool]
    ) -> tuple[int, str]:
        """Number and text of the header's line; settles the delimiter."""
        above = enumerate(self._lines[: content[0][0] - 1], 1)
        remarks = [(n, re.sub(r"^[\s#%]+", "", line)) for n, line in above if line.strip()]
        # NumPy's savetxt writes the header as a comment: looked at where no row is a header.
        for lines, fewest in ((content[:PREAMBLE], 0), (remarks[: -PREAMBLE - 1 : -1], 1)):
            found = []
            for delimiter in DELIMITERS:
                for number, line in lines:
                    titles = _split(line, delimiter) or []
                    if recognised(titles):
                        rows = [_split(row, delimiter) or [] for n, row in content if n > number]
                        alike = sum(len(row) == len(titles) for row in rows)
                        found.append((alike, delimiter, number, line))
                        break
            alike, delimiter, number, line = max(found, key=lambda f: f[0], default=(-1, "", 0, ""))
            if alike >= fewest:
                self._delimiter = delimiter
                return number, line
        return content[0]

    def _content(self) -> Iterator[tuple[int, str]]:
        """Lines that are neither blank nor comments, with their numbers, counted from 1."""
        for number, line in enumerate(islice(self._lines, self._first, None), self._first + 1):
            if not line.isspace() and not COMMENT.match(line):
                yield number, line

    def _cells(self, number: int, line: str) -> list[str]:
        cells = _split(line, self._delimiter)
        if cells is None:
            raise InputError(f"{self.name}: line {number} is no row of a table: mend its quotes")
        return cells

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        """Rows of cells with their line numbers; rows of empty cells count only before others."""
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
                f"{self.name}: {read.doubtful!r} may be a decimal comma or thousands: say "
                "decimal=',', or write numbers with points and without thousands separators"
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
    """Numbers from cells, with the one decimal mark that all of them have.

    Attributes
    ----------
    doubtful : a number whose comma may separate thousands, until another proves it decimal
    """

    def __init__(self, decimal: str | None) -> None:
        self.doubtful: str | None = None
        self._mark = decimal
        self._proven = decimal is not None

    def __call__(self, cell: str) -> float:
        """The number; NaN for a missing one; raises ValueError with the reason."""
        plain = cell
        if "," in cell or ("." in cell and cell.lower() not in MISSING):
            mark = "," if "," in cell else "."
            # A comma beside a point would separate thousands, or the point would.
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
    """Text in UTF-8, or in Latin-1 with Windows' additions; raises `InputError`."""
    text = "\0"
    for encoding in ("utf-8-sig", "cp1252"):
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


def _split(line: str, delimiter: str) -> list[str] | None:
    """The cells of a line; None where its quotes do not pair."""
    if '"' not in line:
        return line.rstrip("\n").split(delimiter)
    try:
        return next(csv.reader([line], delimiter=delimiter, strict=True, skipinitialspace=True))
    except csv.Error:
        return None

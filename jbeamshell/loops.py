"""Measured or computed loops of force over displacement, read from tables."""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jbeamshell.errors import InputError

# What they are measured in; a force per width is as good, as the model is of unit width.
QUANTITIES = {"force": ("N", "N/m"), "displacement": ("m",)}
GROUP_COLUMNS = ("loop", "a", "amplitude")
FEWEST_POINTS = 8
CLOSED = 0.05  # of the range: a loop whose ends lie closer than this is taken as closed


class Loop(NamedTuple):
    """One loop, or one pull.

    Attributes
    ----------
    force : (points,) per unit width
    displacement : (points,) of the loaded end
    label : for pictures and messages
    """

    force: NDArray[np.float64]
    displacement: NDArray[np.float64]
    label: str

    @property
    def closed(self) -> bool:
        """Whether it ends where it starts: a steady loop, not a first loading."""
        columns = (self.force, self.displacement)
        return all(abs(c[-1] - c[0]) <= CLOSED * np.ptp(c) for c in columns)

    def thinned(self, points: int, driver: str) -> Loop:
        """About ``points`` of the loop's points, even along the driving column; turns are kept."""
        if self.force.size <= points:
            return self
        drive = getattr(self, driver)
        travel = np.append(0.0, np.cumsum(np.abs(np.diff(drive))))
        even = np.searchsorted(travel, np.linspace(0.0, travel[-1], points))
        keep = np.unique([0, *even, np.argmax(drive), np.argmin(drive), drive.size - 1])
        return Loop(self.force[keep], self.displacement[keep], self.label)


def make_loop(force: ArrayLike, displacement: ArrayLike, label: str = "loop") -> Loop:
    """A checked loop from two arrays (points,)."""
    columns = {}
    for name, values in (("force", force), ("displacement", displacement)):
        column = np.asarray(values, dtype=float)
        if column.ndim != 1 or column.size < FEWEST_POINTS:
            raise InputError(
                f"{label}: {name} has shape {column.shape}: give {FEWEST_POINTS} points or more"
            )
        bad = np.flatnonzero(~np.isfinite(column))
        if bad.size:
            raise InputError(
                f"{label}: {name} is not finite at {bad.size} of {column.size} points "
                f"(first at point {bad[0] + 1}): remove or repair them"
            )
        if np.ptp(column) == 0.0:
            raise InputError(f"{label}: {name} is constant ({column[0]:g}): no loop to fit")
        columns[name] = column
    if columns["force"].size != columns["displacement"].size:
        raise InputError(f"{label}: force and displacement differ in length: give pairs of points")
    return Loop(columns["force"], columns["displacement"], label)


def read_loops(path: str | os.PathLike[str]) -> list[Loop]:
    """Loops of a table with a header row.

    One column's name must contain "force", another's "displacement".  A unit in brackets or after
    an underscore ("force [kN]", "displacement_mm") converts the column to N and m; without units
    the numbers are in the Scene's own.  A column "loop", "A" or "amplitude" separates several
    loops; it holds numbers.  Lines that start with "#" are comments.

    Parameters
    ----------
    path : CSV file; commas, semicolons or tabs

    Raises
    ------
    InputError
        naming the file, the line or column, and the fix
    """
    name = Path(path).name
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: is not text in UTF-8: save it as a CSV table in UTF-8") from None
    header, rows = _rows(text, name)
    columns = {quantity: _find_column(header, quantity, name) for quantity in QUANTITIES}
    if len(set(columns.values())) < len(columns):
        raise InputError(
            f"{name}: its first row is one column: separate columns by commas, semicolons or tabs"
        )
    if not rows:
        raise InputError(f"{name}: holds a header only: give rows of force and displacement")
    names = [re.sub(r"[\[(].*", "", title).strip().lower() for title in header]
    group = next((i for i, title in enumerate(names) if title in GROUP_COLUMNS), None)
    wanted = [columns[q] for q in QUANTITIES] + ([] if group is None else [group])
    table = _numbers(rows, header, wanted, name)
    factors = _unit_factors({q: header[columns[q]] for q in QUANTITIES}, name)
    force, displacement = table[:, 0] * factors[0], table[:, 1] * factors[1]
    if group is None:
        return [make_loop(force, displacement, name)]
    marks = table[:, 2]
    found = []
    for mark in dict.fromkeys(marks.tolist()):
        label, own = f"{header[group].strip()} = {mark:g}", marks == mark
        try:
            found.append(make_loop(force[own], displacement[own], label))
        except InputError as error:
            raise InputError(f"{name}: {error}") from None
    return found


def _rows(text: str, name: str) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The header, and every further row with its line number."""
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise InputError(f"{name}: is empty: give a header and rows of force and displacement")
    delimiter = max(",;\t", key=lines[0][1].count)
    reader = csv.reader([line for _, line in lines], delimiter=delimiter)
    try:
        (_, header), *rows = [(lines[reader.line_num - 1][0], row) for row in reader]
    except csv.Error as error:
        line = lines[reader.line_num - 1][0]
        raise InputError(f"{name}: line {line} is no row of a table ({error})") from None
    return header, rows


def _find_column(header: Sequence[str], quantity: str, name: str) -> int:
    found = [i for i, title in enumerate(header) if quantity in title.lower()]
    tangential = [i for i in found if "normal" not in header[i].lower()]
    if len(tangential) != 1:
        held = ", ".join(repr(h.strip()) for h in header)[:200]
        fix = "rename the others" if tangential else "name it there"
        raise InputError(
            f"{name}: needs one column named {quantity!r} in its first row, which holds {held}: "
            f"{fix}"
        )
    return tangential[0]


def _numbers(
    rows: list[tuple[int, list[str]]], header: Sequence[str], wanted: list[int], name: str
) -> NDArray[np.float64]:
    table = np.empty((len(rows), len(wanted)))
    for i, (line, row) in enumerate(rows):
        for j, column in enumerate(wanted):
            cell, title = row[column].strip() if column < len(row) else "", header[column].strip()
            fix = "give a finite number, with a decimal point"
            try:
                table[i, j] = float(cell)
            except ValueError:
                table[i, j] = np.nan
                if i == 0 and j < len(QUANTITIES) and cell[:1] not in "+-.0123456789":
                    unit = f"'{title} [{cell.strip('[()]')}]'"
                    fix = f"if it is a row of units, put them into the header: {unit}"
            if not np.isfinite(table[i, j]):
                raise InputError(f"{name}: line {line}, column {title!r} holds {cell!r}: {fix}")
    return table


def _unit_factors(titles: Mapping[str, str], name: str) -> list[float]:
    units = {quantity: _unit(title) for quantity, title in titles.items()}
    if not any(units.values()):
        return [1.0] * len(units)
    import pint  # only files with units pay for it

    registry: pint.UnitRegistry = pint.UnitRegistry()

    def factor(unit: str, base: str) -> float | None:
        try:
            return float(registry.Quantity(1.0, unit).to(base).magnitude)
        except Exception:  # whatever pint's parser stumbles over, it is no unit
            return None

    factors = []
    for quantity, unit in units.items():
        title, bases = titles[quantity].strip(), QUANTITIES[quantity]
        if unit is None:
            fix = f"write '{title} [{bases[0]}]'"
            raise InputError(
                f"{name}: column {title!r} names no unit but the other one does: {fix}"
            )
        found = next((f for f in (factor(unit, base) for base in bases) if f), None)
        if found is None:
            raise InputError(
                f"{name}: column {title!r}: {unit!r} is no unit of {quantity}: write one in "
                f"brackets, such as '{quantity} [{bases[0]}]'"
            )
        factors.append(found)
    return factors


def _unit(title: str) -> str | None:
    bracket = re.search(r"[\[(]([^\])]*)[\])]", title)
    if bracket:
        return bracket.group(1).strip() or None
    tail = re.fullmatch(r".*(?:force|displacement)[ _]+(\S+)", title.strip(), re.IGNORECASE)
    return tail.group(1) if tail else None

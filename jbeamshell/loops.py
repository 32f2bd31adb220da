"""Measured or computed loops of force over displacement, read from tables."""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jbeamshell.errors import InputError

QUANTITIES = {"force": "N", "displacement": "m"}
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
    an underscore ("force [kN]", "displacement_mm") converts the column to N and m; without units the
    numbers are in the Scene's own.  A column "loop", "A" or "amplitude" separates several loops.

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
        raise InputError(f"{path}: is not a text file: give a CSV table") from None
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if not lines:
        raise InputError(f"{path}: is empty: give a header and rows of force and displacement")
    delimiter = max(",;\t", key=lines[0].count)
    header, *rows = list(csv.reader(lines, delimiter=delimiter))
    columns = {quantity: _find_column(header, quantity, name) for quantity in QUANTITIES}
    group = next((i for i, h in enumerate(header) if h.strip().lower() in GROUP_COLUMNS), None)
    wanted = [columns[q] for q in QUANTITIES] + ([] if group is None else [group])
    table = _numbers(rows, header, wanted, name)
    factors = _unit_factors([header[columns[q]] for q in QUANTITIES], name)
    force, displacement = table[:, 0] * factors[0], table[:, 1] * factors[1]
    if group is None:
        return [make_loop(force, displacement, name)]
    marks = table[:, 2]
    return [
        make_loop(force[marks == m], displacement[marks == m], f"{header[group].strip()} = {m:g}")
        for m in dict.fromkeys(marks.tolist())
    ]


def _find_column(header: Sequence[str], quantity: str, name: str) -> int:
    found = [i for i, title in enumerate(header) if quantity in title.lower()]
    tangential = [i for i in found if "normal" not in header[i].lower()]
    if len(tangential) != 1:
        held = ", ".join(repr(h.strip()) for h in header)
        raise InputError(
            f"{name}: needs one column named {quantity!r} in its first row, which holds {held}"
        )
    return tangential[0]


def _numbers(
    rows: list[list[str]], header: Sequence[str], wanted: list[int], name: str
) -> NDArray[np.float64]:
    table = np.empty((len(rows), len(wanted)))
    for i, row in enumerate(rows):
        for j, column in enumerate(wanted):
            cell = row[column].strip() if column < len(row) else ""
            try:
                table[i, j] = float(cell)
            except ValueError:
                title = header[column].strip()
                fix = "write numbers with a decimal point"
                if i == 0:
                    fix = f"if it is a row of units, put them into the header: '{title} [{cell}]'"
                raise InputError(
                    f"{name}: row {i + 2}, column {header[column]!r} holds {cell!r}: {fix}"
                ) from None
    return table


def _unit_factors(titles: Sequence[str], name: str) -> list[float]:
    units = [_unit(title) for title in titles]
    if not any(units):
        return [1.0] * len(units)
    import pint  # only files with units pay for it

    registry: pint.UnitRegistry = pint.UnitRegistry()
    factors = []
    for title, unit, base in zip(titles, units, QUANTITIES.values(), strict=True):
        if unit is None:
            raise InputError(
                f"{name}: column {title!r} names no unit but another does: write '{title} [{base}]'"
            )
        try:
            factors.append(float(registry.Quantity(1.0, unit).to(base).magnitude))
        except (pint.errors.PintError, AttributeError, ValueError):
            # A force per width is as good: the model is of unit width.
            try:
                factors.append(float(registry.Quantity(1.0, unit).to(f"{base}/m").magnitude))
            except (pint.errors.PintError, AttributeError, ValueError):
                raise InputError(
                    f"{name}: column {title!r}: unit {unit!r} does not convert to {base}"
                ) from None
    return factors


def _unit(title: str) -> str | None:
    bracket = re.search(r"[\[(]([^\])]*)[\])]", title)
    if bracket:
        return bracket.group(1).strip() or None
    tail = re.fullmatch(r".*(?:force|displacement)[ _]+(\S+)", title.strip(), re.IGNORECASE)
    return tail.group(1) if tail else None

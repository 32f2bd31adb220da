"""Recordings of a test: force and displacement in the order they were measured."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.common.files import as_path
from jbeamshell.common.summary import Summary, ranged
from jbeamshell.measured.accelerations import displacement_of
from jbeamshell.measured.columns import (
    FURTHER,
    INSTEAD,
    QUANTITIES,
    Conversion,
    conversions,
    find_columns,
    is_header,
)
from jbeamshell.measured.form import HUGE
from jbeamshell.measured.read_table import read_table

FEWEST_POINTS = 8
NO_UNITS = "without units: the numbers are taken in the scene's own"

FilePath = str | os.PathLike[str]


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """Force and displacement of a test in the order of time.

    Attributes
    ----------
    force : (points,) force [N or N/m, or the Scene's own unit]
    displacement : (points,) displacement [m, or the Scene's own unit]
    label : name in pictures and messages
    time : (points,) time [s], or None
    normal_force : (points,) normal force [N or N/m], or None
    dropped : number of rows that were left out because a number was missing
    notes : sentences on what was done to the data
    titles : title of the file's column by quantity; None without a file
    units : unit by quantity, "N", "N/m", "m" or "s"; None if they are the Scene's own
    """

    force: NDArray[np.float64]
    displacement: NDArray[np.float64]
    label: str
    time: NDArray[np.float64] | None = None
    normal_force: NDArray[np.float64] | None = None
    dropped: int = 0
    notes: tuple[str, ...] = ()
    titles: Mapping[str, str] | None = None
    units: Mapping[str, str] | None = None

    def __repr__(self) -> str:
        return self.summary().as_text()

    def but(self, **values: Any) -> Recording:
        """Copy with other values of some fields."""
        return dataclasses.replace(self, **values)

    def unit(self, quantity: str) -> str:
        """Unit of a quantity; empty if it is the Scene's own."""
        return (self.units or {}).get(quantity, "")

    def summary(self) -> Summary:
        """Columns with their ranges and units, for texts and notebooks."""
        rows = []
        for name in (*QUANTITIES, *FURTHER):
            column = getattr(self, name)
            if column is not None:
                told = ranged(column, self.unit(name))
                if name == "time" and (rate := self.rate) is not None:
                    told += f", {rate:.4g} {'Hz' if self.unit('time') else 'per unit of time'}"
                title = (self.titles or {}).get(name, name)
                rows.append((name, told if title == name else f"{told}, column {title!r}"))
        notes = self.notes if self.units else (*self.notes, NO_UNITS)
        return Summary(f"{self.label}: {self.force.size} points", rows, notes)

    @property
    def rate(self) -> float | None:
        """Points per time; None if there is no time, or if it does not rise."""
        step = 0.0 if self.time is None else float(np.median(np.diff(self.time)))
        return 1.0 / step if step > 0.0 else None

    def mean_normal_force(self, first: int = 0, last: int | None = None) -> float | None:
        """Mean normal force between two points; None if it was not recorded there."""
        if self.normal_force is None:
            return None
        mean = float(np.mean(self.normal_force[first:last]))
        return mean if np.isfinite(mean) else None

    def per_width(self, width: float) -> Recording:
        """Recording of forces per unit width; those that are so by their unit stay as they are."""
        if width == 1.0:
            return self
        units, columns, notes = dict(self.units or {}), dict[str, Any](), self.notes
        for name in ("force", "normal_force"):
            column = getattr(self, name)
            if column is None:
                continue
            if units.get(name) == "N/m":
                notes = (
                    *notes,
                    f"the {name} is per width already, so the width does not divide it",
                )
                continue
            columns[name] = column / width
            units |= {name: "N/m"} if name in units else {}
        return self.but(**columns, notes=notes, units=self.units and units)


def recording_from_arrays(
    force: ArrayLike,
    displacement: ArrayLike,
    label: str = "recording",
    *,
    time: ArrayLike | None = None,
    normal_force: ArrayLike | None = None,
) -> Recording:
    """Make a recording of arrays; points without force or displacement are left out and counted.

    Parameters
    ----------
    force, displacement : (points,) numbers in one system of units; NaN marks a missing one
    label : name in pictures and messages
    time, normal_force : (points,) numbers, if they were recorded

    Raises
    ------
    InputError
        if the arrays differ in length, hold fewer than 8 points or an infinite one, or are constant
    """
    given = {"force": force, "displacement": displacement}
    given |= {"time": time} if time is not None else {}
    given |= {"normal_force": normal_force} if normal_force is not None else {}
    columns = {}
    for name, values in given.items():
        columns[name] = as_column(values, name, label)
        if columns[name].ndim != 1 or columns[name].size < FEWEST_POINTS:
            raise InputError(
                f"{label}: {name} has shape {columns[name].shape}: give {FEWEST_POINTS} points or "
                "more"
            )
        if columns[name].size != columns["force"].size:
            raise InputError(f"{label}: force and {name} differ in length: give pairs of points")
        infinite = np.flatnonzero(np.abs(columns[name]) > HUGE)
        if infinite.size:
            raise InputError(
                f"{label}: {name} is infinite or above {HUGE:g} at {infinite.size} of "
                f"{columns[name].size} points (first at point {infinite[0] + 1}): correct them"
            )
    whole = ~(np.isnan(columns["force"]) | np.isnan(columns["displacement"]))
    dropped = int(whole.size - np.count_nonzero(whole))
    if 2 * dropped > whole.size:
        raise InputError(
            f"{label}: {dropped} of {whole.size} rows lack a number for force or displacement: "
            "record or export them again"
        )
    columns = {name: column[whole] for name, column in columns.items()}
    for name in QUANTITIES:
        column = columns[name]
        if column.size < FEWEST_POINTS:
            raise InputError(
                f"{label}: {column.size} rows are left without the {dropped} that lack a number: "
                f"give {FEWEST_POINTS} or more"
            )
        if np.ptp(column) < 1.0 / HUGE:
            fix = "no loop to fit; give a column that varies"
            raise InputError(f"{label}: {name} is constant ({column[0]:g}): {fix}")
    notes = () if not dropped else (f"{dropped} of {whole.size} rows lack a number: left out",)
    return Recording(
        columns["force"],
        columns["displacement"],
        label,
        columns.get("time"),
        columns.get("normal_force"),
        dropped,
        notes,
    )


def as_column(values: ArrayLike, name: str, label: str) -> NDArray[np.float64]:
    """Array of floats from real numbers, NaN for None and masked ones; raises `InputError` else."""
    try:
        if isinstance(values, np.ma.MaskedArray):
            values = np.ma.filled(values.astype(float), np.nan)
        given = np.asarray(values)
        if given.dtype.kind in "iufO":
            return given.astype(float)
    except (TypeError, ValueError, OverflowError):
        pass
    raise InputError(f"{label}: {name} is no array of numbers: give a list of numbers")


def read_recordings(
    paths: FilePath | Sequence[FilePath],
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    decimal: str | None = None,
) -> list[Recording]:
    """Read recordings from one file or several.

    Text files: columns separated by commas, semicolons, tabs or blanks, numbers with decimal points
    or commas, and a header, which other lines may precede.  Lines that start with "#" or "%" are
    comments; the row below the header may hold units.  MATLAB files (.mat): vectors, columns of
    matrices and fields of structs.  NumPy files: .npz and .npy.  With the extra ``formats`` also
    MATLAB 7.3, HDF5 (.h5, .hdf5), TDMS (.tdms) and universal files 58 and 58b (.uff, .unv).

    The name of one column contains "force" (a normal force does not count) and that of another
    "displacement"; otherwise "load", "slip", "stroke", "position" and similar words count, also in
    German, French and Italian ("Kraft", "Weg", "déplacement", "forza", "spostamento").  A unit
    in brackets or after an underscore ("force [kN]", "displacement_mm") converts the column to N
    and m; without units the numbers are in the Scene's own.  A column "loop", "A" or "amplitude" of
    numbers separates several recordings.  Rows without force or displacement are left out and
    counted.  An acceleration and an even time will do in place of the displacement: it is
    integrated twice, without what is slower than the cycles.

    Parameters
    ----------
    paths : one file or several; the files' names are the labels
    columns : name of a column by "force", "displacement", "time" or "normal_force", for columns
        that cannot be found by name; its number, from 1, in a file without a header
    units : unit by the same quantities, such as {"force": "kN"}, which overrides the header; a
        sensor's factor goes before it, such as "0.05mm", or "0.05mm/V" of a signal
    decimal : decimal mark, "," or "."; None infers it from the numbers

    Returns
    -------
    Recordings in the order of the files; columns are (points,) in N and m, or the Scene's own units

    Raises
    ------
    InputError
        if a file cannot be read or a column cannot be found, naming the file, the place and the fix

    Examples
    --------
    ::

        recordings = jb.measured.read_recordings(
            "rig.csv", columns={"force": "load cell 1"}, units={"displacement": "um"}
        )
    """
    check_words_of(columns=columns, units=units)
    if not (decimal is None or (isinstance(decimal, str) and decimal in (",", "."))):
        raise InputError(f"decimal = {decimal!r}: give ',' or '.'")
    for quantity in units or {}:
        if quantity not in (*QUANTITIES, *FURTHER, *INSTEAD):
            known = (*QUANTITIES, *FURTHER)
            raise InputError(f"units: {quantity!r} is no quantity: choose among {known}")
    if isinstance(paths, str | os.PathLike):
        return _read(paths, None, columns or {}, units or {}, decimal)
    if not (isinstance(paths, list | tuple) and paths):
        raise InputError("paths: no file given: name at least one")
    found = []
    for path, label in zip(paths, labels_of(paths), strict=True):
        found += _read(path, label, columns or {}, units or {}, decimal)
    return found


def check_words_of(**given: Any) -> None:
    """Raise `InputError` unless options are dictionaries of words."""
    for name, words in given.items():
        if words is not None and not (
            isinstance(words, Mapping)
            and all(isinstance(w, str) for w in (*words, *words.values()))
        ):
            raise InputError(f"{name} = {words!r}: give a dictionary of words by quantity")


def labels_of(paths: Sequence[FilePath]) -> list[str]:
    """Names of the files, with their folders below the common one if two names are equal."""
    whole = [as_path(path).absolute() for path in paths]
    for i, path in enumerate(whole):
        if path in whole[:i]:
            raise InputError(f"{paths[i]}: is given twice: it would count double")
    names = [path.name for path in whole]
    if len(set(names)) == len(names):
        return names
    common = os.path.commonpath([path.parent for path in whole])
    return [path.relative_to(common).as_posix() for path in whole]


def _read(
    path: FilePath,
    label: str | None,
    chosen: Mapping[str, str],
    given: Mapping[str, str],
    decimal: str | None,
) -> list[Recording]:
    table = read_table(path, lambda titles: is_header(titles, chosen), decimal)
    columns = find_columns(table.titles, chosen, table.name, table.place)
    below = dict(zip(columns, table.units(list(columns.values())), strict=True))
    titles = {q: table.titles[i] for q, i in columns.items() if q != "group"}
    moved = "displacement" if "displacement" in columns else "acceleration"
    must = ["force", moved, *(["group"] if "group" in columns else [])]
    may = [q for q in columns if q not in must]
    rows = table.numbers([columns[q] for q in must], [columns[q] for q in may])
    found_units = conversions(titles, below, given, table.name)
    arrays: dict[str, NDArray[np.float64] | None] = {}
    for quantity, column in zip((*must, *may), rows.T, strict=True):
        own_unit = found_units.get(quantity, Conversion())
        empty = quantity in may and bool(np.all(np.isnan(column)))
        with np.errstate(over="ignore"):  # infinite numbers are refused below, with their place
            arrays[quantity] = None if own_unit is None or empty else column * own_unit.factor
    named = {q: own_unit.unit for q, own_unit in found_units.items() if own_unit is not None}
    if named.pop("acceleration", ""):
        named["displacement"] = "m"
    told: dict[str, Any] = {
        "titles": {q: title.strip() for q, title in titles.items()},
        "units": named if named["force"] else None,
    }
    if "group" not in columns:
        everything = np.full(rows.shape[0], True)
        return [_recording(arrays, everything, label or table.name).but(**told)]
    marks, title = rows[:, 2], table.titles[columns["group"]].strip()
    unmarked = np.flatnonzero(np.isnan(marks))
    if unmarked.size:
        raise InputError(
            f"{table.name}: {table.where(int(unmarked[0]))}, column {title!r} holds no number: "
            "every row needs one, as this column separates the loops"
        )
    found = []
    for mark in dict.fromkeys(marks.tolist()):
        own = f"{title} = {mark:g}"
        try:
            one = _recording(arrays, marks == mark, f"{label}: {own}" if label else own)
            found.append(one.but(**told))
        except InputError as error:
            raise InputError(str(error) if label else f"{table.name}: {error}") from None
    return found


def _recording(
    arrays: Mapping[str, NDArray[np.float64] | None], own: NDArray[np.bool_], label: str
) -> Recording:
    columns: dict[str, Any] = {
        quantity: None if column is None else column[own]
        for quantity, column in arrays.items()
        if quantity != "group"
    }
    acceleration = columns.pop("acceleration", None)
    if acceleration is None:
        return recording_from_arrays(label=label, **columns)
    columns["displacement"], known = displacement_of(acceleration, columns.get("time"), label)
    kept: dict[str, Any] = {
        name: None if column is None else column[known] for name, column in columns.items()
    }
    recording = recording_from_arrays(label=label, **kept)
    note = "the displacement is the acceleration, integrated twice: its zero is not known"
    return recording.but(notes=(*recording.notes, note))

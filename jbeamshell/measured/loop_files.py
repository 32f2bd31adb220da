"""Readers of loops: force and displacement of a test in the order they were measured."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.common.files import as_path
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
from jbeamshell.measured.loops import Loop, make_loop
from jbeamshell.measured.read_table import read_table

FilePath = str | os.PathLike[str]


def read_loops(
    paths: FilePath | Sequence[FilePath],
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    decimal: str | None = None,
) -> list[Loop]:
    """Loops of one file or several, as recorded.

    A recording of many noisy cycles makes one long loop; `steady_loops` makes one mean loop per
    amplitude of it.

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
    numbers separates several loops.  Rows without force or displacement are left out and
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
    Loops in the order of the files; columns are (points,) in N and m, or the Scene's own units

    Raises
    ------
    InputError
        if a file cannot be read or a column cannot be found, naming the file, the place and the fix

    Examples
    --------
    ::

        loops = jb.measured.read_loops(
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
) -> list[Loop]:
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
        return [_loop(arrays, everything, label or table.name).but(**told)]
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
            one = _loop(arrays, marks == mark, f"{label}: {own}" if label else own)
            found.append(one.but(**told))
        except InputError as error:
            raise InputError(str(error) if label else f"{table.name}: {error}") from None
    return found


def _loop(
    arrays: Mapping[str, NDArray[np.float64] | None], own: NDArray[np.bool_], label: str
) -> Loop:
    columns: dict[str, Any] = {
        quantity: None if column is None else column[own]
        for quantity, column in arrays.items()
        if quantity != "group"
    }
    acceleration = columns.pop("acceleration", None)
    if acceleration is None:
        return make_loop(label=label, **columns)
    columns["displacement"], known = displacement_of(acceleration, columns.get("time"), label)
    kept: dict[str, Any] = {
        name: None if column is None else column[known] for name, column in columns.items()
    }
    loop = make_loop(label=label, **kept)
    note = "the displacement is the acceleration, integrated twice: its zero is not known"
    return loop.but(notes=(*loop.notes, note))

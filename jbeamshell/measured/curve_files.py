"""Readers of curves: a figure over the amplitude, or squeeze stress along a strip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jbeamshell.common.errors import InputError
from jbeamshell.measured.columns import bare, choice, factor_of, no_header, unit_of
from jbeamshell.measured.curves import CURVES, Curve
from jbeamshell.measured.form import NUMBER
from jbeamshell.measured.loop_files import FilePath, check_words_of, labels_of
from jbeamshell.measured.read_table import read_table


def read_curves(
    paths: FilePath | Sequence[FilePath],
    kind: str,
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    decimal: str | None = None,
    width: float | None = None,
) -> list[tuple[Curve, tuple[str, ...]]]:
    """Read curves of one kind from files of the formats that `read_loops` reads.

    Columns are found by their names, with units or without: "amplitude" and the kind, such as
    "dissipation"; "x" and "stress"; or "frequency", "force" and "amplitude".  Forces and works
    are per unit of width, or totals where a width is given; the force of a forced response is a
    total.  A column "noise" holds the standard deviation of the second
    column, in its unit.

    Parameters
    ----------
    paths : one file or several; the files' names are the labels
    kind : "dissipation", "stiffness", "squeeze", "frequency", "damping" or "forced"
    columns : name of a column by quantity, such as {"stress": "sigma_y"}
    units : unit by quantity, such as {"x": "mm"}, which overrides the header
    decimal : decimal mark, "," or "."; None infers it from the numbers
    width : width [m] of the specimen, of which forces and works are totals; what is per width by
        its unit is taken times it

    Returns
    -------
    Curve and notes on what was done to the data, for each file

    Raises
    ------
    InputError
        if a file cannot be read or a column cannot be found, naming the file, the place and the fix
    """
    check_words_of(columns=columns, units=units)
    if not (isinstance(kind, str) and kind in CURVES):
        raise InputError(f"kind = {kind!r}: choose among {', '.join(map(repr, CURVES))}")
    known = (*CURVES[kind].form.columns, "noise")
    for name, given in (("columns", columns or {}), ("units", units or {})):
        for quantity in given:
            if quantity not in known:
                raise InputError(f"{name}: {quantity!r} is no quantity: choose among {known}")
    files: list[Any] = list(paths) if isinstance(paths, list | tuple) else [paths]
    return [
        _read(path, label, kind, columns or {}, units or {}, decimal, width)
        for path, label in zip(files, labels_of(files), strict=True)
    ]


def _read(
    path: FilePath,
    label: str,
    kind: str,
    chosen: Mapping[str, str],
    given: Mapping[str, str],
    decimal: str | None,
    width: float | None,
) -> tuple[Curve, tuple[str, ...]]:
    curve: Any = CURVES[kind]
    wanted = {name: column.units for name, column in curve.form.columns.items()}
    measured = {name: () if units == NUMBER else units for name, units in wanted.items()}

    def places(titles: Sequence[str]) -> dict[str, int]:
        names = [bare(title).strip().lower() for title in titles]
        asked = {quantity: chosen.get(quantity, quantity) for quantity in (*wanted, "noise")}
        asked = {quantity: bare(title).strip().lower() for quantity, title in asked.items()}
        asked |= {q: f"column {t}" for q, t in asked.items() if t.isdigit() and t not in names}
        return {quantity: names.index(t) for quantity, t in asked.items() if t in names}

    table = read_table(path, lambda titles: set(wanted) <= set(places(titles)), decimal)
    found = places(table.titles)
    held = ", ".join(repr(title.strip()) for title in table.titles)[:200]
    for quantity in (*wanted, *chosen):
        if quantity not in found:
            name = chosen.get(quantity, quantity)
            if not table.place:
                raise InputError(f"{table.name}: {no_header(measured)}")
            raise InputError(
                f"{table.name}: needs a column {name!r} {table.place}, which holds {held}: name it "
                f"there, or choose it by {choice(quantity, 'NAME')}"
            )
    below = dict(zip(found, table.units(list(found.values())), strict=True))
    rows = table.numbers(
        [found[quantity] for quantity in wanted], [found[q] for q in found if q == "noise"]
    )
    titles = {quantity: table.titles[place] for quantity, place in found.items()}
    totals = {} if width is None else {q: c.totals for q, c in curve.form.columns.items()}
    factors = _factors(wanted, totals, width or 1.0, titles, below, given, table.name)
    whole = ~np.isnan(rows).any(axis=1)
    rows = rows[whole] * factors
    notes: tuple[str, ...] = ()
    if not whole.all():
        notes = (f"{np.count_nonzero(~whole)} of {whole.size} rows lack a number: left out",)
    columns, noise = rows[:, : len(wanted)], rows[:, len(wanted) :]
    return curve(*columns.T, label=label, noise=noise[:, 0] if noise.size else None), notes


def _factors(
    wanted: Mapping[str, tuple[str, ...]],
    totals: Mapping[str, tuple[str, ...]],
    width: float,
    titles: Mapping[str, str],
    below: Mapping[str, Any],
    given: Mapping[str, str],
    name: str,
) -> list[float]:
    """Factors of the columns; noise without a unit has that of the second column."""
    units = {q: given.get(q) or unit_of(title) or below[q] for q, title in titles.items()}
    second = list(wanted)[1]
    measured = [quantity for quantity in wanted if wanted[quantity] != NUMBER]
    without = [quantity for quantity in measured if not units[quantity]]
    if without and len(without) < len(measured):
        raise InputError(
            f"{name}: column {titles[without[0]]!r} names no unit but the other one does: write "
            f"'{without[0]} [{wanted[without[0]][0]}]'"
        )
    factors = {}
    for quantity, unit in units.items():
        base = second if quantity == "noise" else quantity
        bases, whole = wanted[base], totals.get(base, ())
        unit = unit or (units[second] if quantity == "noise" else None)
        factor = 1.0 if unit is None else factor_of(unit, whole or bases)
        if factor is None and whole:
            assert unit is not None
            one = factor_of(unit, bases)
            factor = None if one is None else one * width
        if factor is None:
            raise InputError(
                f"{name}: column {titles[quantity]!r}: {str(unit)[:40]!r} is no unit of "
                f"{quantity}: write one in brackets, such as '{quantity} [{bases[0]}]', or give it "
                f"by {choice(quantity, bases[0], 'unit')}"
            )
        factors[quantity] = factor
    return [factors[quantity] for quantity in (*wanted, "noise") if quantity in factors]

"""Loops of force over displacement, as recorded, as means of cycles, or computed."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jbeamshell.common.errors import InputError
from jbeamshell.common.summary import Summary, ranged, with_unit
from jbeamshell.measured.columns import FURTHER, QUANTITIES
from jbeamshell.measured.form import (
    FEWEST_POINTS,
    HUGE,
    LOOP,
    Floats,
    Measurement,
    as_column,
    checked_noise,
)
from jbeamshell.measured.reversals import find_driver, find_turns

WORK: dict[str | None, str] = {"N": "J", "N/m": "J/m"}  # unit by that of the force
CLOSED = 0.05  # part of the range within which the ends of a closed loop lie
ROUNDING = 1e-6  # of a column's range, below which cycles are the same numbers
NO_UNITS = "without units: the numbers are taken in the scene's own"


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Loop(Measurement):
    """Force over displacement in the order of time: a recording, a mean cycle of it, or one pull.

    Attributes
    ----------
    force : (points,) end force, a total or per unit of width as the scene has it [N, N/m, or the
        scene's own unit]
    displacement : (points,) displacement of the loaded end [m, or the Scene's own unit]
    label, weight : see `Measurement`
    time : (points,) time [s], or None
    normal_force : (points,) normal force [N or N/m], or None; of a mean loop its mean
    noise : standard deviation of a single sample of the responding column, from the scatter of
        repeated cycles; None without repeated cycles
    drive_noise : standard deviation of a single sample of the driving column, where that is noisy:
        both columns are then means over the same samples, and turns are the first, the middle and
        the last point
    drive_error : (points,) standard error of the driving column then
    guessed : True if the noise of both columns is a guess by the roughness of a single cycle
    cycles : number of cycles of which this loop is the mean
    dropped : number of rows that lacked a number and were left out
    scatter : (points,) standard deviation over the cycles of the responding column, at each point;
        None without repeated cycles
    notes : one line on each change made to the data
    driver : column that drove the test, "force" or "displacement"; None if unknown
    free_zero : True if the zero of the responding column is unknown, as after removing a drift
    units : unit by quantity, "N", "N/m", "m" or "s"; None if they are the Scene's own
    titles : title of the file's column by quantity; None without a file
    """

    kind = "loop"
    form = LOOP

    force: Floats
    displacement: Floats
    _: dataclasses.KW_ONLY
    time: Floats | None = None
    normal_force: Floats | None = None
    noise: float | None = None
    drive_noise: float | None = None
    drive_error: Floats | None = None
    guessed: bool = False
    cycles: int = 1
    dropped: int = 0
    scatter: Floats | None = None
    notes: tuple[str, ...] = ()
    driver: str | None = None
    free_zero: bool = False
    units: Mapping[str, str] | None = None
    titles: Mapping[str, str] | None = None

    def __repr__(self) -> str:
        return self.summary().as_text()

    def unit(self, quantity: str) -> str:
        """Unit of a quantity; empty if it is the Scene's own."""
        return (self.units or {}).get(quantity, "")

    def summary(self) -> Summary:
        """Columns with their ranges and units, and work of a cycle, for texts and notebooks."""
        rows = []
        for name in (*QUANTITIES, *FURTHER):
            column = getattr(self, name)
            if column is not None:
                told = ranged(column, self.unit(name))
                if name == "time" and (rate := self.rate) is not None:
                    told += f", {rate:.4g} {'Hz' if self.unit('time') else 'per unit of time'}"
                title = (self.titles or {}).get(name, name)
                rows.append((name, told if title == name else f"{told}, column {title!r}"))
        if self.titles is None and self.closed and len(find_turns(self.displacement)) <= 2:
            work = with_unit(self.work, WORK.get(self.unit("force"), ""))
            rows.append(("work of a cycle", work))
        if self.driver is not None:
            answer = LOOP.response(self.driver)
            both = ((self.noise, answer), (self.drive_noise, self.driver))
            own = [
                f"{with_unit(n, self.unit(name))} of {name}" for n, name in both if n is not None
            ]
            rows += [("noise", ", ".join(own))] if own else []
            rows.append(("driven by", self.driver))
        notes = self.notes if self.units else (*self.notes, NO_UNITS)
        return Summary(f"{self.label}: {self.force.size} points", rows, notes)

    @property
    def as_recorded(self) -> bool:
        """True if nobody has averaged, centred or named a drive of it."""
        untouched = self.noise is None and self.scatter is None and self.cycles == 1
        return untouched and self.driver is None and not self.free_zero

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

    def of_width(self, width: float) -> Loop:
        """Loop of the forces of a whole width [m]; those that are so by their unit stay."""
        units, columns, notes = dict(self.units or {}), dict[str, Any](), list(self.notes)
        for name in ("force", "normal_force"):
            if units.get(name) != "N/m" or getattr(self, name) is None:
                continue
            notes.append(f"the {name} is per width, and is taken times the width of {width:g} m")
            own_noise = (
                ["drive_noise", "drive_error"] if self.driver == "force" else ["noise", "scatter"]
            )
            of_force = own_noise if name == "force" else []
            for own in (name, *of_force):
                if (value := getattr(self, own)) is not None:
                    columns[own] = value * width
            units[name] = "N"
        return self.but(**columns, notes=tuple(notes), units=self.units and units)

    @property
    def work(self) -> float:
        """Work of the force along the displacement, positive where the strip dissipates."""
        return float(np.sum(0.5 * (self.force[1:] + self.force[:-1]) * np.diff(self.displacement)))

    @property
    def closed(self) -> bool:
        """True if the loop ends where it starts; a first loading does not."""
        near = all(abs(c[-1] - c[0]) <= CLOSED * np.ptp(c) for c in self.columns)
        return near or self.drive_noise is not None

    @property
    def standard_error(self) -> float | None:
        """Standard error of a point of the responding column; None without repeated cycles.

        It is the scatter, or the noise, of the cycles over the root of their number: a mean has
        less noise than one cycle.
        """
        noise = self.noise if self.scatter is None else np.sqrt(np.mean(self.scatter**2))
        return None if noise is None else float(noise / np.sqrt(self.cycles))

    @property
    def deviations(self) -> Floats | None:
        """Standard errors (points,) of the responding column; None without repeated cycles."""
        if self.drive_noise is not None:
            assert self.driver is not None
            return None if self.guessed else self.errors_of(LOOP.response(self.driver))
        error = self.standard_error
        if error is not None and self.scatter is not None and self.driver is not None:
            answer = getattr(self, LOOP.response(self.driver))
            if error <= ROUNDING * np.ptp(answer):
                return None  # copies of one cycle tell no noise
        return checked_noise(error, self.force.size, self.label)

    def errors_of(self, column: str) -> Floats:
        """Standard errors (points,) of a column, where both are noisy."""
        assert self.scatter is not None
        assert self.drive_error is not None
        return self.drive_error if column == self.driver else self.scatter / np.sqrt(self.cycles)

    @property
    def without_turns(self) -> Loop:
        """Points that are compared: all, but for turns that are known by points beside them."""
        if self.drive_noise is None:
            return self
        inside = np.ones(self.force.size, bool)
        inside[[0, self.middle, -1]] = False
        return self.part(inside)

    @property
    def middle(self) -> int:
        """Place of the low turn of a loop whose columns are both noisy."""
        return self.force.size // 2

    def zeros(self) -> dict[str, float]:
        """Numbers about which the columns swing, which are zero unless sensors have offsets.

        Of the driving column it is the middle of its range, of the responding one its mean along
        the path.  A path that is not closed starts unloaded: they are those of its first point.
        """
        driver = self.driver or find_driver(self.force, self.displacement)
        answer = LOOP.response(driver)
        drive, column = getattr(self, driver), getattr(self, answer)
        if not self.closed:
            return {driver: float(drive[0]), answer: float(column[0])}
        middle = 0.5 * float(np.max(drive) + np.min(drive))
        way = np.abs(np.diff(drive))
        return {
            driver: middle,
            answer: float(np.sum(0.5 * (column[1:] + column[:-1]) * way) / np.sum(way)),
        }

    def centred(self) -> Loop:
        """Loop without the offsets of its sensors, see `zeros`.

        A model's loop may have another mean, so ``free_zero`` is set: a fit then ignores the offset
        of the responding column.
        """
        zeros = self.zeros()
        told = " and ".join(f"{name} {zero:.3g}" for name, zero in zeros.items())
        shifted = {name: getattr(self, name) - zero for name, zero in zeros.items()}
        note = f"removed, zeros of the sensors: {told}"
        return self.but(**shifted, notes=(*self.notes, note), free_zero=True)

    def thinned(self, points: int, driver: str) -> Loop:
        """Loop with fewer points, spaced evenly along the driving column; turning points are kept.

        Parameters
        ----------
        points : number of points to keep, about
        driver : driving column, "force" or "displacement"
        """
        if self.force.size <= points or self.drive_noise is not None:
            return self
        drive = getattr(self, driver)
        travel = np.append(0.0, np.cumsum(np.abs(np.diff(drive))))
        even = np.searchsorted(travel, np.linspace(0.0, travel[-1], points))
        ends = [0, np.argmax(drive), np.argmin(drive), drive.size - 1]
        keep = np.unique([*ends, *even, *find_turns(drive)])
        return self.part(keep)

    def part(self, points: Any) -> Loop:
        """Loop of some of its points, by a mask, indices or a slice."""
        names = ("force", "displacement", "time", "normal_force", "scatter", "drive_error")
        columns = {name: getattr(self, name) for name in names}
        kept = {name: column[points] for name, column in columns.items() if column is not None}
        return self.but(**kept)


def make_loop(
    force: ArrayLike,
    displacement: ArrayLike,
    label: str = "loop",
    *,
    time: ArrayLike | None = None,
    normal_force: ArrayLike | None = None,
) -> Loop:
    """Loop of arrays, checked; points without force or displacement are left out and counted.

    Parameters
    ----------
    force, displacement : (points,) numbers in one system of units; NaN marks a missing one
    label : name in pictures and messages
    time, normal_force : (points,) numbers, if they were recorded

    Raises
    ------
    InputError
        if the arrays differ in length, hold fewer than 8 points or an infinite one, or are constant

    Examples
    --------
    >>> phase = np.linspace(0.0, 2.0 * np.pi, 65)
    >>> make_loop(np.cos(phase), 1e-5 * np.cos(phase - 0.2)).closed
    True
    """
    given = {"force": force, "displacement": displacement}
    given |= {"time": time} if time is not None else {}
    given |= {"normal_force": normal_force} if normal_force is not None else {}
    columns: dict[str, Any] = {}
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
    return Loop(**columns, label=label, dropped=dropped, notes=notes)


def driver_of(loops: Sequence[Loop]) -> str:
    """Column that drove most of the loops, "force" or "displacement"."""
    drivers = [loop.driver or find_driver(loop.force, loop.displacement) for loop in loops]
    return "displacement" if 2 * drivers.count("displacement") > len(drivers) else "force"

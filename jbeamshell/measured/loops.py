"""Loops of force over displacement, measured or computed."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jbeamshell.common.errors import InputError
from jbeamshell.common.summary import Summary, ranged, with_unit
from jbeamshell.measured.form import LOOP, Floats, Measurement
from jbeamshell.measured.recordings import FEWEST_POINTS as FEWEST_POINTS
from jbeamshell.measured.recordings import (
    NO_UNITS,
    FilePath,
    Recording,
    as_column,
    read_recordings,
    recording_from_arrays,
)
from jbeamshell.measured.reversals import find_driver, find_turns

WORK: dict[str | None, str] = {"N": "J", "N/m": "J/m"}  # unit by that of the force
CLOSED = 0.05  # part of the range within which the ends of a closed loop lie
ROUNDING = 1e-6  # of a column's range, below which cycles are the same numbers


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Loop(Measurement):
    """One loop of force over displacement, or one pull.

    Attributes
    ----------
    force : (points,) end force per unit width
    displacement : (points,) displacement of the loaded end
    label, weight : see `Measurement`
    noise : standard deviation of a single sample of the responding column, from the scatter of
        repeated cycles; None without repeated cycles
    cycles : number of cycles of which this loop is the mean
    dropped : number of rows that lacked a number and were left out
    scatter : (points,) standard deviation over the cycles of the responding column, at each point;
        None without repeated cycles
    notes : one line on each change made to the data
    driver : column that drove the test, "force" or "displacement"; None if unknown
    free_zero : True if the zero of the responding column is unknown, as after removing a drift
    units : unit by quantity, "N", "N/m" or "m"; None if they are the Scene's own
    normal_force : mean normal force, if it was recorded
    """

    kind = "loop"
    form = LOOP

    force: Floats
    displacement: Floats
    _: dataclasses.KW_ONLY
    noise: float | None = None
    cycles: int = 1
    dropped: int = 0
    scatter: Floats | None = None
    notes: tuple[str, ...] = ()
    driver: str | None = None
    free_zero: bool = False
    units: Mapping[str, str] | None = None
    normal_force: float | None = None

    def __repr__(self) -> str:
        return self.summary().as_text()

    def summary(self) -> Summary:
        """Ranges of the columns, and work of a cycle, for texts and notebooks."""
        units = self.units or {}
        rows = [(name, ranged(getattr(self, name), units.get(name, ""))) for name in LOOP.columns]
        if self.closed:
            rows.append(("work of a cycle", with_unit(self.work, WORK.get(units.get("force"), ""))))
        if self.noise is not None and self.driver is not None:
            answer = LOOP.response(self.driver)
            rows.append(("noise", with_unit(self.noise, units.get(answer, "")) + f" of {answer}"))
        if self.driver is not None:
            rows.append(("driven by", self.driver))
        kind = "closed loop" if self.closed else "open path"
        notes = self.notes if self.units else (*self.notes, NO_UNITS)
        return Summary(f"{self.label}: {kind} of {self.force.size} points", rows, notes)

    @property
    def work(self) -> float:
        """Work of the force along the displacement, positive where the strip dissipates."""
        return float(np.sum(0.5 * (self.force[1:] + self.force[:-1]) * np.diff(self.displacement)))

    @property
    def closed(self) -> bool:
        """True if the loop ends where it starts; a first loading does not."""
        return all(abs(c[-1] - c[0]) <= CLOSED * np.ptp(c) for c in self.columns)

    @property
    def standard_error(self) -> float | None:
        """Standard error of a point of the responding column; None without repeated cycles.

        It is the scatter of the cycles over the root of their number.
        """
        if self.scatter is None:
            return None
        return float(np.sqrt(np.mean(self.scatter**2) / self.cycles))

    @property
    def deviations(self) -> Floats | None:
        """Standard deviations (points,) of the responding column; None if unknown.

        A loop that is the mean of several cycles has less noise than one cycle.
        """
        error = self.standard_error
        if error is None and self.noise is not None:
            error = self.noise / np.sqrt(self.cycles)
        if error is not None and self.scatter is not None and self.driver is not None:
            answer = getattr(self, LOOP.response(self.driver))
            if error <= ROUNDING * np.ptp(answer):
                error = None  # copies of one cycle tell no noise
        return checked_noise(error, self.force.size, self.label)

    def as_recording(self) -> Recording:
        """Its points as a recording; those with NaN are left out."""
        made = recording_from_arrays(self.force, self.displacement, self.label)
        dropped, notes = self.dropped + made.dropped, (*self.notes, *made.notes)
        return made.but(dropped=dropped, notes=notes, units=self.units)

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
        if self.force.size <= points:
            return self
        drive = getattr(self, driver)
        travel = np.append(0.0, np.cumsum(np.abs(np.diff(drive))))
        even = np.searchsorted(travel, np.linspace(0.0, travel[-1], points))
        ends = [0, np.argmax(drive), np.argmin(drive), drive.size - 1]
        keep = np.unique([*ends, *even, *find_turns(drive)])
        return self.but(
            force=self.force[keep],
            displacement=self.displacement[keep],
            scatter=None if self.scatter is None else self.scatter[keep],
        )


def make_loop(force: ArrayLike, displacement: ArrayLike, label: str = "loop") -> Loop:
    """Loop of two arrays, checked; points with NaN are left out and counted.

    Parameters
    ----------
    force : (points,) end force per unit width
    displacement : (points,) displacement of the loaded end
    label : name in pictures and messages

    Raises
    ------
    InputError
        for arrays that are no columns of one length, hold too few points or an infinite one, or are
        constant

    Examples
    --------
    >>> phase = np.linspace(0.0, 2.0 * np.pi, 65)
    >>> make_loop(np.cos(phase), 1e-5 * np.cos(phase - 0.2)).closed
    True
    """
    return loop_of(recording_from_arrays(force, displacement, label))


def read_loops(
    paths: FilePath | Sequence[FilePath],
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    decimal: str | None = None,
) -> list[Loop]:
    """Loops of one file or several, as recorded; see `read_recordings` for the formats.

    A recording of many noisy cycles makes one long loop; `steady_loops` makes one mean loop per
    amplitude instead.

    Parameters
    ----------
    paths : file, or several
    columns : titles of the columns by "force" and "displacement", if the titles alone do not tell
    units : units by "force" and "displacement", such as {"force": "kN"}; they override the header
    decimal : decimal sign, "," or ".", if the numbers alone do not tell

    Raises
    ------
    InputError
        naming the file, the line or column, and the fix
    """
    recordings = read_recordings(paths, columns=columns, units=units, decimal=decimal)
    return [loop_of(recording) for recording in recordings]


def loop_of(recording: Recording) -> Loop:
    """Loop of all points of a recording, as they stand."""
    return Loop(
        recording.force,
        recording.displacement,
        label=recording.label,
        dropped=recording.dropped,
        notes=recording.notes,
        units=recording.units,
        normal_force=recording.mean_normal_force(),
    )


def driver_of(loops: Sequence[Loop]) -> str:
    """Column that drove most of the loops, "force" or "displacement"."""
    drivers = [loop.driver or find_driver(loop.force, loop.displacement) for loop in loops]
    return "displacement" if 2 * drivers.count("displacement") > len(drivers) else "force"


def checked_noise(noise: Any, points: int, label: str) -> Floats | None:
    """Standard deviations (points,) of one number or one for each point; None stays None.

    Raises
    ------
    InputError
        unless all are positive
    """
    if noise is None:
        return None
    values = as_column(noise, "noise", label)
    values = np.full(points, float(values)) if values.ndim == 0 else values
    if values.shape != (points,):
        fix = f"give one number, or one for each of the {points} points"
        raise InputError(f"{label}: noise has shape {values.shape}: {fix}")
    bad = np.flatnonzero(~(np.isfinite(values) & (values > 0.0)))
    if bad.size:
        raise InputError(
            f"{label}: noise is {values[bad[0]]:g} at point {bad[0] + 1}: give a positive standard "
            "deviation, or none at all"
        )
    return values

"""Measured or computed loops of force over displacement."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.measured.form import LOOP, Form
from jbeamshell.measured.recordings import FEWEST_POINTS as FEWEST_POINTS
from jbeamshell.measured.recordings import FilePath, read_recordings, recording_from_arrays
from jbeamshell.measured.reversals import find_driver, find_turns

CLOSED = 0.05  # of the range: a loop whose ends lie closer than this is taken as closed


class Loop(NamedTuple):
    """One loop, or one pull.

    Attributes
    ----------
    force : (points,) per unit width
    displacement : (points,) of the loaded end
    label : for pictures and messages
    noise : standard deviation of a single sample of the column that answers, estimated from the
        scatter of repeated cycles; None if there were none
    cycles : how many cycles this loop is the mean of
    dropped : rows of the data that lacked a number and were left out
    scatter : (points,) standard deviation over the cycles of the column that answers, at each
        point; None if there were no repeated cycles
    notes : one line on each thing that was done to the data
    driver : "force" or "displacement", whichever drove the test; None where nobody looked
    free_zero : whether the zero of the column that answers is unknown, as after taking away a drift
    """

    force: NDArray[np.float64]
    displacement: NDArray[np.float64]
    label: str
    noise: float | None = None
    cycles: int = 1
    dropped: int = 0
    scatter: NDArray[np.float64] | None = None
    notes: tuple[str, ...] = ()
    driver: str | None = None
    free_zero: bool = False

    @property
    def form(self) -> Form:
        """Names, labels and units of its columns."""
        return LOOP

    @property
    def closed(self) -> bool:
        """Whether it ends where it starts: a steady loop, not a first loading."""
        columns = (self.force, self.displacement)
        return all(abs(c[-1] - c[0]) <= CLOSED * np.ptp(c) for c in columns)

    @property
    def standard_error(self) -> float | None:
        """Of a point of the answering column: the cycles' scatter over the root of their number.

        None where there were no repeated cycles.
        """
        if self.scatter is None:
            return None
        return float(np.sqrt(np.mean(self.scatter**2) / self.cycles))

    def centred(self) -> Loop:
        """The loop without the zeros of its sensors.

        What drives is shifted to the middle of its range, and the answer by its mean along the way;
        as a model's loop need not have its mean there, a fit is told by ``free_zero`` not to mind.

        Raises
        ------
        InputError
            for a loop that is not closed, whose zeros mean something
        """
        if not self.closed:
            raise InputError(f"{self.label}: is not closed: its zeros are where it started")
        driver = self.driver or find_driver(self.force, self.displacement)
        answer = "displacement" if driver == "force" else "force"
        drive, column = getattr(self, driver), getattr(self, answer)
        middle = 0.5 * float(np.max(drive) + np.min(drive))
        way = np.abs(np.diff(drive))
        mean = float(np.sum(0.5 * (column[1:] + column[:-1]) * way) / np.sum(way))
        note = f"taken away as zeros of the sensors: {driver} {middle:.3g} and {answer} {mean:.3g}"
        shifted = {driver: drive - middle, answer: column - mean}
        return self._replace(**shifted, notes=(*self.notes, note), free_zero=True)

    def thinned(self, points: int, driver: str) -> Loop:
        """About ``points`` of the loop's points, even along the driving column; turns are kept."""
        if self.force.size <= points:
            return self
        drive = getattr(self, driver)
        travel = np.append(0.0, np.cumsum(np.abs(np.diff(drive))))
        even = np.searchsorted(travel, np.linspace(0.0, travel[-1], points))
        ends = [0, np.argmax(drive), np.argmin(drive), drive.size - 1]
        keep = np.unique([*ends, *even, *find_turns(drive)])
        return self._replace(
            force=self.force[keep],
            displacement=self.displacement[keep],
            scatter=None if self.scatter is None else self.scatter[keep],
        )


def make_loop(force: ArrayLike, displacement: ArrayLike, label: str = "loop") -> Loop:
    """A checked loop from two arrays (points,); points with NaN are dropped and counted."""
    recording = recording_from_arrays(force, displacement, label)
    return Loop(
        recording.force,
        recording.displacement,
        label,
        dropped=recording.dropped,
        notes=recording.notes,
    )


def read_loops(
    paths: FilePath | Sequence[FilePath],
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    decimal: str | None = None,
) -> list[Loop]:
    """Loops of one file or several, as they stand there: `read_recordings` says what it reads.

    A recording of many noisy cycles makes one long loop; `steady_loops` makes of it one mean loop
    per amplitude.

    Parameters
    ----------
    paths : the file, or several
    columns : name of a column by "force" or "displacement", where names alone do not tell
    units : unit by the same, such as {"force": "kN"}, whatever the header says
    decimal : "," or ".", where the numbers alone do not tell

    Raises
    ------
    InputError
        naming the file, the line or column, and the fix
    """
    recordings = read_recordings(paths, columns=columns, units=units, decimal=decimal)
    return [
        Loop(r.force, r.displacement, r.label, dropped=r.dropped, notes=r.notes) for r in recordings
    ]


def driver_of(loops: Sequence[Loop]) -> str:
    """Which column drove a test, "force" or "displacement", by most of its loops."""
    drivers = [loop.driver or find_driver(loop.force, loop.displacement) for loop in loops]
    return "displacement" if 2 * drivers.count("displacement") > len(drivers) else "force"

"""Files of one specimen: what kind of measurement they hold, and how it is prepared."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jbeamshell.common.checks import require, shown
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import read_toml
from jbeamshell.identify.parameters import is_number
from jbeamshell.measured.columns import QUANTITIES
from jbeamshell.measured.curve_files import CURVES, read_curves
from jbeamshell.measured.curves import Backbone, Measurement
from jbeamshell.measured.drift import DRIFTS
from jbeamshell.measured.findings import DRIFT, OFF_CENTRE, OFF_ZERO
from jbeamshell.measured.inspection import inspect
from jbeamshell.measured.loops import Loop, loop_of
from jbeamshell.measured.recordings import Recording, read_recordings
from jbeamshell.measured.splitting import split_cycles
from jbeamshell.measured.steady import steady_loops
from jbeamshell.scene.dimensions import Dimensions, dimensions_of
from jbeamshell.scene.keys import CONTROLS

KINDS = ("loop", "backbone", *CURVES)
CYCLES = ("auto", "steady", "recorded")
WRONG_DRIVE = (
    "the displacement goes from turn to turn as a machine drives it, the force does not: if it "
    "drives, give --set load.control=displacement"
)
QUIET = 1e-3  # noise of the driving column, over its range, above which cycles are averaged


@dataclasses.dataclass(frozen=True)
class Source:
    """Files of one kind that belong to one specimen.

    Attributes
    ----------
    data : names of the files
    kind : kind of measurement in them, one of `KINDS`
    cycles : treatment of recordings: "steady" averages the steady cycles of every amplitude;
        "recorded" takes the recording as one loop; "auto" averages if cycles repeat or if the
        driving column is noisy
    driver, drift : arguments of `steady_loops`
    centre : True to take the zeros of the sensors from the loops, see `Loop.centred`; None to do so
        where they can only be offsets
    reverse : "force" or "displacement" to turn the sign of that column
    width : width of the specimen, by which forces are divided
    columns, units, decimal : arguments of `read_recordings`
    dimensions : dimensions of the specimen with units, see `jbeamshell.scene.dimension_table`; or
        the name of a TOML file that holds them
    label : label of the specimen
    set : values of its scene by dotted key

    Raises
    ------
    InputError
        if an entry is of the wrong kind, naming the entry, the value and the fix
    """

    data: Sequence[str]
    kind: str = "loop"
    cycles: str = "auto"
    driver: str | None = None
    drift: str = "keep"
    centre: bool | None = None
    reverse: str | None = None
    width: float = 1.0
    columns: Mapping[str, str] = dataclasses.field(default_factory=dict)
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)
    decimal: str | None = None
    dimensions: Mapping[str, Any] | str = dataclasses.field(default_factory=dict)
    label: str = ""
    set: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        files = isinstance(self.data, list | tuple) and all(isinstance(f, str) for f in self.data)
        if not (files and self.data):
            raise InputError(f"specimen {self.label!r}: data = {self.data!r}: list its files")
        words = {"kind": KINDS, "cycles": CYCLES, "drift": DRIFTS, "driver": (None, *CONTROLS)}
        words["reverse"] = (None, *QUANTITIES)
        for name, known in words.items():
            value = getattr(self, name)
            if not (value is None or isinstance(value, str)) or value not in known:
                names = ", ".join(repr(word) for word in known if word)
                raise InputError(f"{name} = {shown(value)}: choose among {names}")
        if self.centre not in (None, True, False):
            raise InputError(f"centre = {self.centre!r}: give true or false")
        if not (is_number(self.width) and self.width > 0.0):
            raise InputError(f"width = {shown(self.width)}: give a positive number")

    def known(self, folder: Path) -> Dimensions:
        """Dimensions of the specimen in SI; a file is looked for in a folder."""
        given = self.dimensions
        read = read_toml(folder / given) if isinstance(given, str) else given
        try:
            known = dimensions_of(read)
        except InputError as error:
            raise InputError(
                f"{given}: {error}" if isinstance(given, str) else str(error)
            ) from None
        fix = "is given twice, as one of the dimensions too: leave it out here"
        require("width", self.width, known.width is None or self.width == 1.0, fix)
        return known

    def measurements(
        self, folder: Path, unchecked: bool = False
    ) -> Iterator[tuple[Measurement, Sequence[str]]]:
        """Measurements in the files of a folder, each with notes on what was done to the data.

        Raises `InputError` for a recording that an inspection refuses, unless it is unchecked.
        """
        files, known = [folder / name for name in self.data], self.known(folder)
        width = self.width if known.width is None else known.width
        if self.kind not in ("loop", "backbone"):
            fix = f"a {self.kind} curve is per unit width; leave width out"
            require("width", width, width == 1.0, fix)
            yield from read_curves(
                files, self.kind, columns=self.columns, units=self.units, decimal=self.decimal
            )
            return
        for recording in read_recordings(
            files, columns=self.columns, units=self.units, decimal=self.decimal
        ):
            if known.values and recording.units is None:
                raise InputError(
                    f"{recording.label}: its columns name no units, but the specimen's dimensions "
                    "do: give --unit force=N --unit displacement=mm, or what they are"
                )
            per_width = self._turned(recording.per_width(width))
            seen = inspect(per_width)
            if not unchecked:
                seen.check()
            if self.drift == "keep":  # which the mean loops do not show
                drifts = [f.text for view in seen.views for f in view.findings if f.name == DRIFT]
                per_width = per_width._replace(notes=(*per_width.notes, *drifts))
            if self.driver == "force" and any(v.driver == "displacement" for v in seen.views):
                per_width = per_width._replace(notes=(*per_width.notes, WRONG_DRIVE))
            if self.kind == "backbone":
                columns = per_width.force, per_width.displacement
                yield Backbone(*columns, per_width.label), per_width.notes
            else:
                loops = self._loops(per_width)
                for loop in loops:
                    wanted = _forgets_zero(loop) if self.centre is None else self.centre
                    taken = loop.centred() if wanted else loop
                    yield taken, taken.notes

    def _turned(self, recording: Recording) -> Recording:
        """Recording with the sign of one column turned, if that was asked for."""
        if self.reverse is None:
            return recording
        note = f"the sign of the {self.reverse} is turned"
        column = {self.reverse: -getattr(recording, self.reverse)}
        return recording._replace(**column, notes=(*recording.notes, note))

    def _loops(self, recording: Recording) -> list[Loop]:
        whole = loop_of(recording)
        if self.cycles == "recorded" and self.drift == "keep":
            return [whole]
        if self.cycles == "auto" and self.drift == "keep":
            try:
                found = split_cycles(recording, self.driver)
            except InputError:  # a first loading, or an unsteady path
                return [whole]
            noise = found.noise / np.ptp(found.path)
            if len(found.cycles) == 1 and noise < QUIET:
                return [whole]
        return steady_loops(recording, self.driver, self.drift)


def _forgets_zero(loop: Loop) -> bool:
    """True for a loop whose response has an offset that no joint makes.

    A joint that is driven to and fro alike answers about zero.  A contact that slides as a whole
    has no place of its own, so the zero of its displacement was never that of the strip.  A path
    that is not closed starts unloaded, unless its driving column has an offset too.
    """
    zeros = loop.zeros()
    off = {n: abs(zero) > OFF_CENTRE * np.ptp(getattr(loop, n)) for n, zero in zeros.items()}
    driver, answer = zeros
    if not loop.closed:
        return off[answer] and abs(zeros[driver]) < OFF_ZERO * np.ptp(getattr(loop, driver))
    levels = inspect(loop).views[0].levels
    if not levels or not any(off.values()):
        return False
    shape = levels[-1].shape
    slides = off["displacement"] and shape.kind == "gross slip"
    return slides or (off[answer] and not off[driver] and not shape.asymmetric)

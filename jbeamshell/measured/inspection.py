"""Inspection of measured data: what a recording holds, and whether a fit of it can be right.

A fit refuses data with a grave finding; other findings are doubts, which it reports.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jbeamshell.common.errors import InputError
from jbeamshell.common.frames import frame
from jbeamshell.common.summary import with_unit
from jbeamshell.measured.findings import Finding, Level, of_columns, of_levels, of_loading
from jbeamshell.measured.loop_files import FilePath, read_loops
from jbeamshell.measured.loop_shape import KINDS, shape_of
from jbeamshell.measured.loops import WORK, Loop
from jbeamshell.measured.splitting import split_cycles
from jbeamshell.measured.steady import mean_loops

UNDO = "--unchecked (in Python unchecked=True) fits all the same"


@dataclasses.dataclass(frozen=True, eq=False)
class View:
    """Content of one recording.

    Attributes
    ----------
    recording : force and displacement in the order of time
    driver : column that drives the cycles; None if there is no cycle
    levels : cycles of each amplitude, by increasing amplitude
    findings : what is wrong or doubtful
    told : why there are no cycles; empty if there are
    """

    recording: Loop
    driver: str | None
    levels: tuple[Level, ...]
    findings: tuple[Finding, ...]
    told: str = ""

    def text(self) -> str:
        """Columns, cycles and findings, in lines."""
        recording = self.recording
        lines = [recording.summary().as_text(14)]
        if self.driver is None:
            lines.append(f"  {'cycles':14s} none: {self.told}")
        else:
            lines.append(f"  {'driven by':14s} {self.driver}")
        lines += [f"  {'cycles':14s} {self._of(level)}" for level in self.levels]
        for finding in self.findings:
            lines.append(f"  {'REFUSED' if finding.grave else 'doubt':14s} {finding.text}")
        if self.levels and not self.findings:
            lines.append(f"  {'verdict':14s} nothing speaks against a fit")
        return "\n".join(lines)

    def figures(self) -> dict[str, Any]:
        """Figures of the recording, for JSON."""
        recording = self.recording
        return {
            "label": recording.label,
            "points": recording.force.size,
            "columns": recording.titles,
            "units": recording.units,
            "rate": recording.rate,
            "driver": self.driver,
            "levels": [
                {
                    "cycles": level.cycles,
                    "force": [float(f(level.loop.force)) for f in (np.min, np.max)],
                    "displacement": [float(f(level.loop.displacement)) for f in (np.min, np.max)],
                    "work": level.work,
                    "stiffness": level.stiffness,
                    "kind": level.shape.kind,
                }
                for level in self.levels
            ],
            "findings": [dataclasses.asdict(finding) for finding in self.findings],
        }

    def _of(self, level: Level) -> str:
        unit, force = self.recording.unit, self.recording.unit("force")
        drive = getattr(level.loop, str(self.driver))
        amplitude = with_unit(0.5 * float(np.ptp(drive)), unit(str(self.driver)))
        stiff = with_unit(level.stiffness, f"{force}/m" if force == "N" else "N/m^2" * bool(force))
        work = with_unit(level.work, WORK.get(force, ""))
        return (
            f"{level.cycles} of amplitude {amplitude}: work {work}, stiffness {stiff}, "
            f"{KINDS[level.shape.kind]}"
        )


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Inspection:
    """Content of some files or arrays, one view for each recording; print it."""

    views: tuple[View, ...]

    def __repr__(self) -> str:
        return "\n\n".join(view.text() for view in self.views)

    @property
    def findings(self) -> list[Finding]:
        """Findings about all recordings."""
        return [finding for view in self.views for finding in view.findings]

    @property
    def sound(self) -> bool:
        """True if no finding is grave."""
        return not any(finding.grave for finding in self.findings)

    def check(self) -> None:
        """Raise `InputError` with the first grave finding, if there is one."""
        for view in self.views:
            for finding in view.findings:
                if finding.grave:
                    raise InputError(f"{view.recording.label}: {finding.text}; {UNDO}")

    def to_dataframe(self) -> Any:
        """Cycles as a `pandas.DataFrame`, a row for every amplitude of every recording.

        Columns are the recording's label and number of cycles, the ends of force and displacement,
        the work and the secant stiffness of a cycle, and the kind of its shape.

        Examples
        --------
        ::

            jb.inspect("rig.csv").to_dataframe()
        """
        pairs = [(view, level) for view in self.views for level in view.levels]
        ends: dict[str, Any] = {
            f"{name}_{word}": [float(of(getattr(level.loop, name))) for _, level in pairs]
            for name in ("force", "displacement")
            for word, of in (("low", np.min), ("high", np.max))
        }
        columns = {
            "recording": [view.recording.label for view, _ in pairs],
            "driver": [view.driver for view, _ in pairs],
            "cycles": [level.cycles for _, level in pairs],
            **ends,
            "work": [level.work for _, level in pairs],
            "stiffness": [level.stiffness for _, level in pairs],
            "kind": [level.shape.kind for _, level in pairs],
        }
        return frame(columns)

    def figures(self) -> dict[str, Any]:
        """Figures of all recordings, for JSON."""
        return {"sound": self.sound, "recordings": [view.figures() for view in self.views]}

    def doubts(self) -> list[str]:
        """Sentences of all findings, each with the label of its recording."""
        return [
            f"{view.recording.label}: {one.text}" for view in self.views for one in view.findings
        ]


def inspect(
    data: Loop | FilePath | Sequence[Loop] | Sequence[FilePath],
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    decimal: str | None = None,
    stiffness: tuple[float, float] | None = None,
) -> Inspection:
    """Inspect measured data before a fit: what they hold, and what speaks against them.

    The cycles of every amplitude are averaged. The work of a joint is positive, and its branches
    soften from turn to turn; noise is told from a finding by the scatter of the cycles.

    Parameters
    ----------
    data : a loop, one file or several, or a list
    columns, units, decimal : how files are read, see `jbeamshell.measured.read_loops`
    stiffness : least and largest plausible force over displacement, if known

    Returns
    -------
    Inspection
        print it, draw it by `jbeamshell.plotting.inspection`, or read its ``views``

    Raises
    ------
    InputError
        if a file cannot be read

    Examples
    --------
    ::

        seen = jb.inspect("rig.csv")
        print(seen)
        seen.sound
    """
    items: list[Loop]
    if isinstance(data, Loop):
        items = [data]
    elif isinstance(data, list | tuple) and all(isinstance(i, Loop) for i in data):
        items = list(data)
    else:
        paths: FilePath | Sequence[FilePath] = data  # type: ignore[assignment]
        items = list(read_loops(paths, columns=columns, units=units, decimal=decimal))
    return Inspection(tuple(_view(item, stiffness) for item in items))


def _view(recording: Loop, stiffness: tuple[float, float] | None) -> View:
    findings = of_columns(recording)
    try:
        found = split_cycles(recording)
    except InputError as error:
        reason = str(error).removeprefix(f"{recording.label}: ")
        return View(recording, None, (), (*findings, *of_loading(recording)), reason)
    levels = tuple(
        Level(loop, len(found.group(number)), shape_of(found, number, recording.cycles))
        for number, loop in enumerate(mean_loops(found))
    )
    findings += of_levels(levels, found, findings, stiffness)
    return View(recording, found.driver, levels, tuple(findings))

"""Inspection of measured data: what a recording holds, and whether a fit of it can be right.

A finding is grave if no joint of this model answers so: the work is negative, a branch stiffens
towards its turn, a sensor is at the end of its range. A fit refuses such data. Other findings are
doubts, which a fit reports.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jbeamshell.common.errors import InputError
from jbeamshell.common.summary import with_unit
from jbeamshell.measured.clipping import clipped
from jbeamshell.measured.columns import QUANTITIES, choice
from jbeamshell.measured.loop_shape import KINDS, LoopShape, shape_of
from jbeamshell.measured.loops import WORK, Loop
from jbeamshell.measured.recordings import FilePath, Recording, read_recordings
from jbeamshell.measured.reversals import noise_of
from jbeamshell.measured.splitting import Cycles, split_cycles
from jbeamshell.measured.steady import steady_loops

DRIFTING = 0.03  # drift over the response's range that is told
OFF_CENTRE = 0.1  # middle of a cycle over its range that is told
UNIT_ERROR = 10.0  # factor beyond a plausible stiffness that only a wrong unit explains
FALLS = -0.5  # correlation of force and displacement of a first loading that leans backward
UNDO = "--unchecked (in Python unchecked=True) fits all the same"


class Finding(NamedTuple):
    """Finding about a recording.

    Attributes
    ----------
    name : one or two words
    text : sentence with the reason and the fix
    grave : True if a fit of these data cannot be right
    """

    name: str
    text: str
    grave: bool = False


class Level(NamedTuple):
    """Cycles of one amplitude.

    Attributes
    ----------
    loop : mean of the steady cycles
    cycles : number of cycles found
    shape : figures of the mean cycle
    """

    loop: Loop
    cycles: int
    shape: LoopShape

    @property
    def stiffness(self) -> float:
        """Range of the force over that of the displacement."""
        return float(np.ptp(self.loop.force) / np.ptp(self.loop.displacement))

    @property
    def work(self) -> float:
        """Work of a cycle, positive where the joint dissipates."""
        ranges = np.ptp(self.loop.force) * np.ptp(self.loop.displacement)
        return float(self.shape.work * ranges)


class View(NamedTuple):
    """Content of one recording.

    Attributes
    ----------
    recording : force and displacement in the order of time
    driver : column that drives the cycles; None if there is no cycle
    levels : cycles of each amplitude, by increasing amplitude
    findings : what is wrong or doubtful
    told : why there are no cycles; empty if there are
    """

    recording: Recording
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
            "findings": [finding._asdict() for finding in self.findings],
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


class Inspection(NamedTuple):
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

    def figures(self) -> dict[str, Any]:
        """Figures of all recordings, for JSON."""
        return {"sound": self.sound, "recordings": [view.figures() for view in self.views]}

    def doubts(self) -> list[str]:
        """Sentences of all findings, each with the label of its recording."""
        return [
            f"{view.recording.label}: {one.text}" for view in self.views for one in view.findings
        ]


def inspect(
    data: Recording | Loop | FilePath | Sequence[Recording | Loop] | Sequence[FilePath],
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    decimal: str | None = None,
    width: float = 1.0,
    stiffness: tuple[float, float] | None = None,
) -> Inspection:
    """Inspect measured data before a fit: what they hold, and what speaks against them.

    The cycles of every amplitude are averaged. The work of a joint is positive, and its branches
    soften from turn to turn; noise is told from a finding by the scatter of the cycles.

    Parameters
    ----------
    data : a recording or a loop, one file or several, or a list
    columns, units, decimal : how files are read, see `jbeamshell.measured.read_recordings`
    width : width of the specimen, by which forces are divided
    stiffness : least and largest plausible force per width over displacement, if known

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
    items: list[Recording | Loop]
    if isinstance(data, Recording | Loop):
        items = [data]
    elif isinstance(data, list | tuple) and all(isinstance(i, Recording | Loop) for i in data):
        items = list(data)
    else:
        paths: FilePath | Sequence[FilePath] = data  # type: ignore[assignment]
        items = list(read_recordings(paths, columns=columns, units=units, decimal=decimal))
    recordings = [_recording(item).per_width(width) for item in items]
    return Inspection(tuple(_view(recording, stiffness) for recording in recordings))


def _recording(item: Recording | Loop) -> Recording:
    if isinstance(item, Recording):
        return item
    return Recording(item.force, item.displacement, item.label, notes=item.notes, units=item.units)


def _view(recording: Recording, stiffness: tuple[float, float] | None) -> View:
    clipping = [_clipping(recording, name) for name in QUANTITIES]
    findings = list(clipping)
    try:
        found = split_cycles(recording)
    except InputError as error:
        findings.append(_of_loading(recording))
        reason = str(error).removeprefix(f"{recording.label}: ")
        return View(recording, None, (), tuple(f for f in findings if f), reason)
    loops = steady_loops(recording, found.driver)
    levels = tuple(
        Level(loop, len(found.group(number)), shape_of(found, number))
        for number, loop in enumerate(loops)
    )
    several = len(levels) > 1
    for level in reversed(levels):  # what the largest cycles tell is not said again
        where = f"cycles to {found.driver} = {_top(level, found, recording)}: " * several
        said = {finding.name for finding in findings if finding}
        findings += [
            finding._replace(text=where + finding.text)
            for finding in (
                _of_work(level, recording),
                None if any(clipping) else _of_shape(level),  # a clipped turn looks like one
                _of_stiffness(level, stiffness),
                _of_drift(level, found, recording),
                _of_centre(level, found, recording),
            )
            if finding and finding.name not in said
        ]
    return View(recording, found.driver, levels, tuple(f for f in findings if f))


def _top(level: Level, found: Cycles, recording: Recording) -> str:
    return with_unit(float(np.max(getattr(level.loop, found.driver))), recording.unit(found.driver))


def _clipping(recording: Recording, name: str) -> Finding | None:
    other = "displacement" if name == "force" else "force"
    limit = clipped(getattr(recording, name), getattr(recording, other))
    if limit is None:
        return None
    at = with_unit(limit, recording.unit(name))
    return Finding(
        "clipped",
        f"the {name} is clipped at {at}, while the {other} goes on: record it with a larger "
        "range, or keep smaller amplitudes only",
        True,
    )


def _of_loading(recording: Recording) -> Finding | None:
    """Finding about a recording without cycles."""
    noisy = noise_of(recording.force) > 0.2 * np.ptp(recording.force)
    rising = float(np.corrcoef(recording.force, recording.displacement)[0, 1])
    return None if noisy or rising > FALLS else _wrong_sign("")


def _wrong_sign(further: str) -> Finding:
    return Finding(
        "wrong sign",
        "the force falls as the displacement rises: one of them has the wrong sign: turn it by "
        f"--reverse force (in a plan reverse = 'force'){further}",
        True,
    )


def _of_work(level: Level, recording: Recording) -> Finding | None:
    shape, kind = level.shape, level.shape.kind
    if kind == "backward":
        swapped = shape.work > 0.0 and shape.work > 4.0 * shape.work_error
        return _wrong_sign("; then force and displacement are swapped too" * swapped)
    if kind != "negative work":
        return None
    work = with_unit(level.work, WORK.get(recording.unit("force"), ""))
    titles = recording.titles or {}
    swap = "make the force the displacement and the displacement the force"
    if set(QUANTITIES) <= set(titles):
        swap = " ".join(
            choice(name, titles[other])
            for name, other in (("force", "displacement"), ("displacement", "force"))
        )
    return Finding(
        "negative work",
        f"the work of a cycle is negative, {work}: are the columns swapped ({swap}), does the "
        "force have the wrong sign (--reverse force), or does one channel lag the other",
        True,
    )


def _of_shape(level: Level) -> Finding | None:
    shape, kind = level.shape, level.shape.kind
    if kind in ("pinched", "bearing"):
        return Finding(
            "clearance",
            f"a branch stiffens towards its turn by {100.0 * shape.convexity:.0f} % of the range: "
            "a bolt that bears on its hole, or another clearance, which this model does not have: "
            "keep amplitudes within the clearance only",
            True,
        )
    if kind == "elastic":
        return Finding(
            "elastic",
            "the work of a cycle is not told from noise: these cycles determine a stiffness, but "
            "no friction",
        )
    if kind == "viscous":
        return Finding(
            "viscous",
            "the loop is an ellipse: viscous damping, or one channel lags the other; the work of "
            "friction would not depend on the rate: repeat it at another rate",
        )
    if shape.asymmetric:
        return Finding(
            "asymmetric",
            f"the branches differ by {100.0 * shape.asymmetry:.0f} % of the range: the joint "
            "answers pull and push differently, which this model hardly does",
        )
    return None


def _of_stiffness(level: Level, band: tuple[float, float] | None) -> Finding | None:
    if band is None or band[0] <= level.stiffness <= band[1]:
        return None
    low, high = band
    soft = level.stiffness < low
    factor = low / level.stiffness if soft else level.stiffness / high
    taken = "millimetres taken for metres" if soft else "metres taken for millimetres"
    fix = f"are {taken}, or other units wrong (--unit displacement=mm, --width, --modulus)"
    return Finding(
        "stiffness",
        f"force over displacement, {level.stiffness:.3g} per width, is {factor:.3g} times "
        f"{'below' if soft else 'above'} what the strip can have, {low:.3g} to {high:.3g}: {fix}",
        factor > UNIT_ERROR,
    )


def _of_drift(level: Level, found: Cycles, recording: Recording) -> Finding | None:
    drift = level.shape.drift
    if level.cycles < 3 or abs(drift) < max(DRIFTING, 4.0 * level.shape.error):
        return None
    size = with_unit(
        drift * float(np.ptp(getattr(level.loop, found.responding))),
        recording.unit(found.responding),
    )
    return Finding(
        "drift",
        f"the {found.responding} drifts by {size} over these cycles: remove it by --drift linear "
        "(in Python drift='linear')",
    )


def _of_centre(level: Level, found: Cycles, recording: Recording) -> Finding | None:
    drive = getattr(level.loop, found.driver)
    middle = 0.5 * float(np.max(drive) + np.min(drive))
    if abs(middle) < OFF_CENTRE * np.ptp(drive):
        return None
    return Finding(
        "off centre",
        f"the {found.driver} swings about {with_unit(middle, recording.unit(found.driver))}, not "
        "about zero: if this is the sensor's offset, remove it by --centre",
    )

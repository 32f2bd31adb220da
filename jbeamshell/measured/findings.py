"""Findings about a recording: what no joint of this model can answer, and what is doubtful.

A finding is grave if no joint of this model answers so: the work is negative, a branch stiffens
towards its turn, a sensor is at the end of its range.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from jbeamshell.common.summary import with_unit
from jbeamshell.measured.clipping import clipped
from jbeamshell.measured.columns import QUANTITIES, choice
from jbeamshell.measured.loop_shape import LoopShape
from jbeamshell.measured.loops import WORK, Loop
from jbeamshell.measured.reversals import noise_of
from jbeamshell.measured.splitting import Cycles

DRIFTING = 0.03  # drift over the response's range that is told
OFF_CENTRE = 0.1  # middle of a driving cycle over its range that is told
OUTERMOST = 0.9  # range of a cycle's drive over that of the recording
OFF_ZERO = 0.03  # mean of a response over its range that is told
UNIT_ERROR = 10.0  # factor beyond a plausible stiffness that only a wrong unit explains
TOO_SOFT = (  # wrong units, and how to set them right
    "are kilonewtons taken for newtons (--unit force=kN), millimetres for metres (--unit "
    "displacement=mm), micrometres for millimetres (--unit displacement=um)"
)
TOO_STIFF = (
    "are newtons taken for kilonewtons (--unit force=N), metres for millimetres (--unit "
    "displacement=m), millimetres for micrometres (--unit displacement=mm)"
)
TOO_LARGE = (  # of forces, where their quotient by the displacement may be right
    "are newtons taken for kilonewtons (--unit force=N), and with them micrometres for "
    "millimetres (--unit displacement=um)"
)
TOO_SMALL = (
    "are kilonewtons taken for newtons (--unit force=kN), and with them millimetres for "
    "micrometres (--unit displacement=mm)"
)
CLIPPED, DRIFT = "clipped", "drift"
FALLS = -0.5  # correlation of force and displacement of a first loading that leans backward


@dataclasses.dataclass(frozen=True)
class Finding:
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


@dataclasses.dataclass(frozen=True, eq=False)
class Level:
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


def of_columns(recording: Loop) -> list[Finding]:
    """Findings about the columns of a recording, each by itself."""
    clipping = [_clipping(recording, name) for name in QUANTITIES]
    return [finding for finding in clipping if finding]


def of_loading(recording: Loop) -> list[Finding]:
    """Findings about a recording without cycles."""
    noisy = noise_of(recording.force) > 0.2 * np.ptp(recording.force)
    rising = float(np.corrcoef(recording.force, recording.displacement)[0, 1])
    return [] if noisy or rising > FALLS else [_wrong_sign("")]


def of_levels(
    levels: Sequence[Level],
    found: Cycles,
    before: Sequence[Finding],
    stiffness: tuple[float, float] | None,
) -> list[Finding]:
    """Findings about the cycles of every amplitude.

    Parameters
    ----------
    levels : cycles of each amplitude, by increasing amplitude
    found : all cycles of the recording
    before : findings about its columns
    stiffness : least and largest plausible force over displacement, if known
    """
    recording, findings = found.recording, list[Finding]()
    several, whole = len(levels) > 1, not any(finding.name == CLIPPED for finding in before)
    for number, level in reversed(
        [*enumerate(levels)]
    ):  # what the largest cycles tell is not said again
        where = f"cycles to {found.driver} = {_top(level, found, recording)}: " * several
        said = {finding.name for finding in (*before, *findings)}
        findings += [
            dataclasses.replace(finding, text=where + finding.text)
            for finding in (
                _of_work(level, recording),
                _of_shape(level) if whole else None,  # a clipped turn looks like a clearance
                _of_stiffness(level, stiffness),
                _of_drift(level, number, found),
                _of_centre(level, found, recording),
            )
            if finding and finding.name not in said
        ]
    return findings


def _top(level: Level, found: Cycles, recording: Loop) -> str:
    return with_unit(float(np.max(getattr(level.loop, found.driver))), recording.unit(found.driver))


def _clipping(recording: Loop, name: str) -> Finding | None:
    other = "displacement" if name == "force" else "force"
    limit = clipped(getattr(recording, name), getattr(recording, other))
    if limit is None:
        return None
    at = with_unit(limit, recording.unit(name))
    return Finding(
        CLIPPED,
        f"the {name} is clipped at {at}, while the {other} goes on: record it with a larger "
        "range, or keep smaller amplitudes only",
        True,
    )


def _wrong_sign(further: str) -> Finding:
    return Finding(
        "wrong sign",
        "the force falls as the displacement rises: one of them has the wrong sign: turn it by "
        f"--reverse force (in a plan reverse = 'force'){further}",
        True,
    )


def _of_work(level: Level, recording: Loop) -> Finding | None:
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
    fix = f"{TOO_SOFT if soft else TOO_STIFF}, or are --width or --modulus wrong"
    return Finding(
        "stiffness",
        f"force over displacement, {level.stiffness:.3g}, is {factor:.3g} times "
        f"{'below' if soft else 'above'} what the strip can have, {low:.3g} to {high:.3g}: {fix}",
        factor > UNIT_ERROR,
    )


def _of_drift(level: Level, number: int, found: Cycles) -> Finding | None:
    """Finding about a slow change of either column over the cycles of a group."""
    if level.cycles < 3:
        return None
    middles = np.array([0.5 * (cycle.low + cycle.high) for cycle in found.group(number)])
    wander = float(np.median(np.diff(middles))) * (middles.size - 1)
    ranges = {name: float(np.ptp(getattr(level.loop, name))) for name in QUANTITIES}
    for name, drift, noise in (
        (found.responding, level.shape.drift * ranges[found.responding], level.shape.error),
        (found.driver, wander, found.noise / ranges[found.driver]),
    ):
        if abs(drift) >= max(DRIFTING, 4.0 * noise) * ranges[name]:
            return Finding(
                DRIFT,
                f"the {name} drifts by {with_unit(drift, found.recording.unit(name))} over these "
                "cycles: remove it by --drift linear (in Python drift='linear')",
            )
    return None


def _of_centre(level: Level, found: Cycles, recording: Loop) -> Finding | None:
    """Finding about a column that does not swing about zero, the driving one first."""
    loop, driver = level.loop, found.driver
    zeros = loop.zeros()
    # Within larger ones, cycles answer about where those left them.
    outermost = np.ptp(getattr(loop, driver)) > OUTERMOST * np.ptp(getattr(recording, driver))
    for name, least in ((driver, OFF_CENTRE), (found.responding, OFF_ZERO)):
        unlike = level.shape.asymmetric or abs(level.shape.drift) >= DRIFTING or not outermost
        if name == found.responding and unlike:
            return None
        noise = 4.0 * level.shape.error * (name == found.responding)
        if abs(zeros[name]) >= max(least, noise) * np.ptp(getattr(loop, name)):
            return Finding(
                "off centre",
                f"the {name} swings about {with_unit(zeros[name], recording.unit(name))}, not "
                "about zero: if this is the sensor's offset, remove it by --centre (in a plan "
                "centre = true)",
            )
    return None

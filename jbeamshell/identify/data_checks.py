"""Checks of data before a fit: findings about loops, and measurements that are copies.

A law is odd: it answers a push as a pull.  Laws without Masing's memory let minor loops drift.
Loops that show otherwise are told as doubts, as no numbers of the law can follow them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from jbeamshell.identify.models import LawModel, Model
from jbeamshell.identify.specimens import Case, plausible_stiffness
from jbeamshell.laws import MasingLaw
from jbeamshell.measured.closed_curve import PARTS
from jbeamshell.measured.form import FEWEST_POINTS, Measurement
from jbeamshell.measured.inspection import View, inspect
from jbeamshell.measured.loops import ROUNDING, Loop
from jbeamshell.measured.reversals import find_turns, noise_of

ASYMMETRY = 0.035  # of the range, by which the branches of a law, being odd, do not differ
SURE = 2.0  # standard errors by which noise may make them differ
DISSIPATES = 1e-3  # work over that of the rectangle about a loop, below which the loop is a line


def inspected(cases: Sequence[Case], free: Sequence[str], unchecked: bool = False) -> list[str]:
    """Doubts about the loops of cases, see `jbeamshell.inspect`.

    Raises
    ------
    InputError
        for a grave finding, such as negative work
    """
    doubts = []
    for case in cases:
        loops = [item for item in case.measurements if isinstance(item, Loop)]
        if loops:
            seen = inspect(loops, stiffness=plausible_stiffness(case.model, [*free, *case.rig]))
            if not unchecked:
                seen.check()
            doubts += [*seen.doubts(), *feature_doubts(case.model, seen.views)]
    return doubts


def feature_doubts(model: Model, views: Sequence[View]) -> list[str]:
    """Sentences on what inspected loops show and a law cannot follow; none for other models."""
    if not isinstance(model, LawModel):
        return []
    name, doubts = model.law.heading, []
    for recording, levels in ((view.recording, view.levels) for view in views):
        nested = len(find_turns(recording.displacement)) > 2
        own = noise_of(recording.force) / np.ptp(recording.force)
        chance = SURE * own * np.sqrt(PARTS / recording.force.size)
        missed = levels[-1].shape.asymmetry if levels and not nested else 0.0
        if missed > np.hypot(ASYMMETRY, chance):
            doubts.append(
                f"{recording.label}: pull and push differ by {100.0 * missed:.2g} % of the range, "
                f"and {name} answers both alike: it cannot follow that; take a strip"
            )
        if not isinstance(model.law, MasingLaw) and nested:
            doubts.append(
                f"{recording.label}: turns within a larger cycle, and {name} forgets where: its "
                "minor loops do not close; take a law with memory, such as iwan4"
            )
    return doubts


def counted_once(cases: Sequence[Case]) -> tuple[list[Case], list[str]]:
    """Cases without copies among their measurements, and a sentence on each copy.

    A copy holds the points of another measurement, all or some of them, or the columns of another
    loop times factors of other units.  A loop that repeats one cycle point by point keeps one.  A
    copy of a measurement of another specimen stays, as that may be what its own numbers rest on.
    """
    kept: list[Case] = []
    said: list[str] = []
    others: list[Any] = []
    for case in cases:
        if not all(isinstance(item, Measurement) for item in case.measurements):
            kept.append(case)  # no measurement, which the fit refuses
            continue
        single = [_one_cycle(item) for item in case.measurements]
        for item, repeats in single:
            if repeats > 1:
                said.append(
                    f"{item.label} repeats one cycle {repeats} times, point by point: it counts "
                    "once"
                )
        own = [item for item, _ in single]
        fullest = sorted(range(len(own)), key=lambda place: -own[place].columns[0].size)
        places: list[int] = []
        for place in fullest:
            copied = [(own[i].label, told) for i in places if (told := _copy(own[place], own[i]))]
            if copied:
                said.append(f"{own[place].label} is {copied[0][0]} {copied[0][1]}: it counts once")
            else:
                places.append(place)
        for item, other in ((own[i], other) for i in places for other in others):
            if told := _copy(item, other) or _copy(other, item):
                said.append(
                    f"{item.label} of {case.label} and {other.label} of another specimen are "
                    f"copies ({told}): errors of numbers that both share are too small"
                )
        others += own
        chosen = sorted(places)
        data, weights = [own[i] for i in chosen], case.weights[chosen]
        kept.append(case._replace(measurements=data, weights=weights))
    return kept, said


def _copy(item: Any, other: Any) -> str:
    """Words on how a measurement copies another of as many points or more; empty if it does not."""
    if type(item) is not type(other) or not isinstance(item, Loop):
        same = type(item) is type(other) and all(map(np.array_equal, item.columns, other.columns))
        return "once more" if same else ""
    points, all_points = (one.force + 1j * one.displacement for one in (item, other))
    if bool(np.all(np.isin(points, all_points))):
        return "once more" if points.size == all_points.size else "with fewer points"
    if points.size != all_points.size:
        return ""
    factors = []
    for column, base in zip(item.columns, other.columns, strict=True):
        factor = float(column @ base / (base @ base))
        if np.max(np.abs(column - factor * base)) > ROUNDING * np.ptp(column):
            return ""
        factors.append(factor)
    force, displacement = factors
    tens = [abs(np.log10(abs(factor))) for factor in factors]
    units = all(abs(power - round(power)) < ROUNDING for power in tens)
    one_column = min(tens) < ROUNDING
    alike = abs(force / displacement - 1.0) < ROUNDING and _dissipates(item)
    if not (units or one_column or alike):
        return ""  # such as loops of Goodman's bar, whose displacement goes with the force squared
    return f"with force times {force:.6g} and displacement times {displacement:.6g}"


def _dissipates(loop: Loop) -> bool:
    around = float(np.ptp(loop.force) * np.ptp(loop.displacement))
    return abs(loop.work) > DISSIPATES * around


def _one_cycle(item: Any) -> tuple[Any, int]:
    """Measurement with one cycle of a loop that repeats it point by point, and their number."""
    if not isinstance(item, Loop):
        return item, 1
    slack = [ROUNDING * float(np.ptp(column)) for column in item.columns]

    def repeats(period: int) -> bool:
        return all(
            bool(np.all(np.abs(column[period:] - column[:-period]) <= allowed))
            for column, allowed in zip(item.columns, slack, strict=True)
        )

    size = item.force.size
    back = np.all([np.abs(c - c[0]) <= a for c, a in zip(item.columns, slack, strict=True)], axis=0)
    for period in np.flatnonzero(back).tolist():
        if FEWEST_POINTS <= period <= size // 2 and repeats(period):
            return item.part(slice(period + 1)), round((size - 1) / period)
    return item, 1

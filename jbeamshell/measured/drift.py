"""Drift of a recording: removal of the slow change of its cycles' means."""

from __future__ import annotations

import numpy as np

from jbeamshell.measured.closed_curve import FEWEST_KNOTS, ClosedCurve, phases_of
from jbeamshell.measured.reversals import Floats, median_slope
from jbeamshell.measured.splitting import Cycle, Cycles, split_cycles

DRIFTS = ("keep", "linear", "cycle")


def without_drift(found: Cycles, drift: str, smallest: float) -> Cycles:
    """Cycles of the recording without its drift, "linear" or by "cycle"; see `steady_loops`."""
    recording = found.recording
    clock = recording.time
    if clock is None or not np.all(np.diff(clock) >= 0.0) or clock[0] == clock[-1]:
        clock = np.arange(found.path.size, dtype=float)
    middles = np.array([0.5 * (clock[c.start] + clock[c.end]) for c in found.cycles])
    levels = {
        found.driver: np.array([0.5 * (c.low + c.high) for c in found.cycles]),
        found.responding: np.array([_level(found, c) for c in found.cycles]),
    }
    groups = np.array([c.group for c in found.cycles])
    straight, told = {}, []
    for name, level in levels.items():
        column = getattr(recording, name)
        if drift == "cycle":
            middle = [np.median(level[groups == g]) for g in range(found.groups)]
            wander = _through(clock, middles, level - np.array(middle)[groups])
        else:
            wander = _common_slope(found, groups, middles, level, clock, column) * (
                clock - clock[0]
            )
        straight[name] = column - wander
        told.append(f"{name} {float(np.ptp(wander)):.3g}")
    note = f"removed from the recording: a {drift} drift of {' and '.join(told)} in all"
    recording = recording.but(**straight, notes=(*recording.notes, note))
    return split_cycles(recording, found.driver, smallest=smallest)


def _level(found: Cycles, cycle: Cycle) -> float:
    """Mean of the response over the phase of a cycle, for any spacing of its points."""
    points, phase = phases_of(found, cycle)
    curve = ClosedCurve(phase, FEWEST_KNOTS)
    return float(curve.parts(curve.through(phase, found.response[points])).mean())


def _common_slope(
    found: Cycles, groups: np.ndarray, middles: Floats, level: Floats, clock: Floats, column: Floats
) -> float:
    """Slope in time of the cycles' levels; if no amplitude repeats, that of the cycles' gaps."""
    slopes = []
    for number in range(found.groups):
        own = groups == number
        if np.count_nonzero(own) > 1:
            slopes.append((median_slope(middles[own], level[own]), np.count_nonzero(own)))
    if slopes:
        values, counts = np.array(slopes).T
        return float(np.average(values, weights=counts))
    gaps = [
        (column[c.end] - column[c.start]) / (clock[c.end] - clock[c.start]) for c in found.cycles
    ]
    return float(np.median(gaps))


def _through(clock: Floats, middles: Floats, offsets: Floats) -> Floats:
    """Straight lines through the offsets, continued to both ends of the clock."""
    if offsets.size == 1:
        return np.full(clock.shape, offsets[0])
    slopes = np.diff(offsets) / np.diff(middles)
    before = np.minimum(clock - middles[0], 0.0) * slopes[0]
    after = np.maximum(clock - middles[-1], 0.0) * slopes[-1]
    return np.interp(clock, middles, offsets) + before + after

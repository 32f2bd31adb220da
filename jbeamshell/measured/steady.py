"""Steady loops: the mean of the cycles that repeat, and their scatter about it."""

from __future__ import annotations

from typing import Any

import numpy as np

from jbeamshell.common.errors import InputError
from jbeamshell.measured.closed_curve import FEWEST_KNOTS, PARTS, ClosedCurve, phases_of
from jbeamshell.measured.drift import DRIFTS, without_drift
from jbeamshell.measured.loops import Loop
from jbeamshell.measured.noisy_drive import noises_of, paired_means
from jbeamshell.measured.reversals import SMALLEST, Floats, median_slope, noise_of
from jbeamshell.measured.splitting import Cycles, split_cycles

STEADY = 0.01  # distance over the response's range, below which cycles repeat
POINTS = 200  # most points of a mean loop


def steady_loops(
    recording: Loop,
    driver: str | None = None,
    drift: str = "keep",
    *,
    smallest: float = SMALLEST,
    steady: float = STEADY,
    points: int = POINTS,
) -> list[Loop]:
    """Average the steady cycles of every amplitude in a recording to one closed loop each.

    The response of a cycle is averaged over 16 parts of the loop and compared with the median of
    the later half of the cycles.  A cycle is steady if the distance (root mean square over the
    parts) is at most ``steady`` of the response's range, three times the median distance of those
    cycles, or what noise explains.

    Parameters
    ----------
    recording : recording of one test
    driver : "force" or "displacement"; None finds it, see `split_cycles`
    drift : "keep"; "linear" to remove from both columns the straight line in time (in points if
        there is no time) that the cycles' means follow; "cycle" to remove the means themselves
    smallest : range of the smallest cycle to be found, over the whole range
    steady : distance over the response's range within which cycles repeat
    points : most points of each loop

    Returns
    -------
    One loop per amplitude, by increasing amplitude, from turn to turn to turn, with ``noise``,
    ``scatter`` and ``cycles``; its notes say what was left out or removed

    Raises
    ------
    InputError
        if there is no reversal or no whole cycle, or if an argument is out of range

    Examples
    --------
    ::

        (recording,) = jb.measured.read_loops("rig.csv")
        loops = jb.measured.steady_loops(recording, drift="linear")
        loops[0].noise, loops[0].notes
    """
    if drift not in DRIFTS:
        raise InputError(f"drift = {drift!r}: choose among {DRIFTS}")
    if not 0.0 <= steady < np.inf:
        raise InputError(f"steady = {steady}: give a part of the range, such as {STEADY}")
    if not 2 * FEWEST_KNOTS < points < np.inf:
        raise InputError(f"points = {points}: give more than {2 * FEWEST_KNOTS}")
    found = split_cycles(recording, driver, smallest=smallest)
    if drift != "keep":
        found = without_drift(found, drift, smallest)
    # Removing a drift also removes the zeros of the columns.
    return [loop.but(free_zero=drift != "keep") for loop in mean_loops(found, steady, points)]


def mean_loops(found: Cycles, steady: float = STEADY, points: int = POINTS) -> list[Loop]:
    """Closed loops of cycles that were found, one per amplitude; see `steady_loops`."""
    return [_mean_loop(found, number, steady, points) for number in range(found.groups)]


def _mean_loop(found: Cycles, number: int, steady: float, points: int) -> Loop:
    cycles = found.group(number)
    samples = [phases_of(found, cycle) for cycle in cycles]
    response = found.response
    per_cycle = float(np.median([phase.size for _, phase in samples]))
    knots = int(np.clip(per_cycle // 2, FEWEST_KNOTS, (points - 1) // 2))
    curve = ClosedCurve(np.concatenate([phase for _, phase in samples]), knots)
    heights = np.array([curve.through(phase, response[i]) for i, phase in samples])
    drive = getattr(found.recording, found.driver)
    rises = np.diff([curve.parts(own) for own in heights]) * (PARTS // 2) / np.ptp(drive)
    slope = float(np.sqrt(np.mean(rises**2)))
    noise = float(np.hypot(noise_of(response), slope * noise_of(drive)))
    repeats, limit = _repeating(curve, heights, steady, noise, per_cycle)
    own = np.flatnonzero(repeats)
    steady_ones = [cycles[i] for i in own]
    recording = found.recording
    fields: dict[str, Any] = {"cycles": int(own.size)}
    if (rough := noises_of(found, steady_ones)) is not None:
        means = paired_means(found, steady_ones, rough)
        drive, mean = means.columns
        low, high = float(drive[drive.size // 2]), float(drive[0])
        fields["drive_noise"], fields["noise"] = rough
        fields["guessed"] = own.size == 1
        fields["drive_error"] = rough.drive * means.errors[0]
        error = np.hypot(rough.response * means.errors[1], means.bent)
        fields["scatter"] = np.sqrt(own.size) * error
    else:
        where = np.concatenate([samples[i][0] for i in own])
        phase = np.concatenate([samples[i][1] for i in own])
        heights_of_all = curve.through(phase, response[where])
        if own.size > 1:
            left = response[where] - curve.at(phase, heights_of_all)
            fields["noise"] = float(np.sqrt(np.sum(left**2) / max(phase.size - curve.size, 1)))
            spread = np.std(heights[own], axis=0, ddof=1)
            fields["scatter"] = np.append(spread, spread[0])
        low = float(np.mean([cycle.low for cycle in steady_ones]))
        high = float(np.mean([cycle.high for cycle in steady_ones]))
        drive = low + (high - low) * np.abs(curve.knots - 1.0)
        mean = np.append(heights_of_all, heights_of_all[0])
    columns = {found.driver: drive, found.responding: mean}
    label = recording.label
    pressing = recording.mean_normal_force(steady_ones[0].start, steady_ones[-1].end)
    if found.groups > 1:
        label = f"{label}: {found.driver} {low:.4g} to {high:.4g}"
    return Loop(
        label=label,
        dropped=recording.dropped,
        notes=(*recording.notes, *_notes(found, number, curve, heights, repeats, limit)),
        driver=found.driver,
        units=recording.units,
        normal_force=None if pressing is None else np.full(drive.size, pressing),
        force=columns["force"],
        displacement=columns["displacement"],
        **fields,
    )


def _repeating(
    curve: ClosedCurve, heights: Floats, steady: float, noise: float, per_cycle: float
) -> tuple[np.ndarray, float]:
    """Mask (cycles,) of those that repeat the later half's median, and the distance allowed."""
    parts = np.array([curve.parts(own) for own in heights])
    later = slice(len(heights) // 2, None)
    distance = np.sqrt(np.mean((parts - np.median(parts[later], axis=0)) ** 2, axis=1))
    usual = 3.0 * float(np.median(distance[later]))
    noisy = 3.0 * noise * float(np.sqrt(PARTS / per_cycle))
    limit = max(steady * float(np.ptp(np.median(heights, axis=0))), usual, noisy)
    return distance <= limit, limit


def _notes(
    found: Cycles,
    number: int,
    curve: ClosedCurve,
    heights: Floats,
    repeats: np.ndarray,
    limit: float,
) -> list[str]:
    """Notes on what was averaged, what was left out, and whether the mean hides a drift."""
    count, own = len(repeats), f"{found.driver}-driven cycle"
    if count == 1:
        (only,) = found.group(number)
        gap = abs(found.response[only.end] - found.response[only.start])
        return [
            f"one {own} only, whose {found.responding} returns to within {gap:.2g}: its noise is "
            "unknown, and so is whether it is steady"
        ]
    notes = [f"mean of {np.count_nonzero(repeats)} of {count} {own}s"]
    left = ", ".join(str(i + 1) for i in np.flatnonzero(~repeats))
    if left:
        notes[0] += (
            f"; left out, as their {found.responding} is off by more than {limit:.2g}: {left[:60]}"
        )
    levels = np.array([curve.parts(own).mean() for own in heights[repeats]])
    turn = np.arange(levels.size, dtype=float)
    slope = median_slope(turn, levels)
    drift, error = slope * levels.size, np.std(levels - slope * turn) * np.sqrt(12.0 / levels.size)
    if levels.size > 3 and abs(drift) > max(STEADY * float(np.ptp(heights)), 3.0 * error):
        notes.append(
            f"the {found.responding} drifts by {drift:.2g} over these cycles: remove it by --drift "
            "linear (in Python drift='linear')"
        )
    return notes

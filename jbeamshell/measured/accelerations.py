"""Displacement from a recorded acceleration, of which only vibration about a mean is known."""

from __future__ import annotations

import numpy as np

from jbeamshell.common.errors import InputError
from jbeamshell.measured.reversals import Floats

PERIODS = 8  # fewest that are integrated
ENDS = 2  # periods at either end that filters disturb
PASSES = 2  # subtractions of running means after each integration
JITTER = 0.01  # of a time step


def displacement_of(acceleration: Floats, time: Floats | None, label: str) -> tuple[Floats, slice]:
    """Displacement of a vibration by two integrations, and the points at which it is known.

    After each integration, by trapezoids, running means over one period are subtracted.  They
    remove constants of integration and the drift of the sensor, and nothing that is periodic.

    Parameters
    ----------
    acceleration : (points,) acceleration [m/s^2]
    time : (points,) time [s]; None if it was not recorded
    label : name for messages

    Returns
    -------
    displacement : (points,) displacement [m], with mean zero
    known : points without the first and last two periods

    Raises
    ------
    InputError
        if the time is missing or uneven, numbers are missing, or there are too few periods
    """
    from scipy.integrate import cumulative_trapezoid
    from scipy.signal import detrend

    whole = "give the displacement itself, or every number of acceleration and time in even steps"
    if time is None or not np.all(np.isfinite([acceleration, time])):
        raise InputError(
            f"{label}: the acceleration cannot be integrated to a displacement: {whole}"
        )
    steps = np.diff(time)
    step = float(np.mean(steps))
    if step <= 0.0 or float(np.max(np.abs(steps - step))) > JITTER * step:
        raise InputError(f"{label}: the time of the acceleration has uneven steps: {whole}")
    motion = np.asarray(detrend(acceleration))
    main = _frequency(motion, step)
    periods = main * step * acceleration.size
    if periods < PERIODS:
        raise InputError(
            f"{label}: the acceleration holds about {periods:.0f} periods: record {PERIODS} or "
            "more, or give the displacement itself"
        )
    for _ in range(2):
        motion = cumulative_trapezoid(motion, dx=step, initial=0.0)
        for _ in range(PASSES):
            motion = motion - _running_mean(motion, 1.0 / (main * step))
    cut = int(np.ceil(ENDS / (main * step)))
    return motion, slice(cut, acceleration.size - cut)


def _frequency(motion: Floats, step: float) -> float:
    """Frequency of a vibration, from the peak of its velocity's spectrum between two bins."""
    spectrum = np.abs(np.fft.rfft(motion * np.hanning(motion.size)))[1:]
    speed = np.log(spectrum / np.arange(1, spectrum.size + 1) + 1e-300)
    peak = int(np.clip(np.argmax(speed), 1, speed.size - 2))
    before, here, after = speed[peak - 1 : peak + 2]
    bend = before - 2.0 * here + after
    off = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return float((peak + 1 + np.clip(off, -0.5, 0.5)) / (motion.size * step))


def _running_mean(column: Floats, width: float) -> Floats:
    """Mean (points,) over a width in points around each point; wrong within half of it at ends."""
    points = np.arange(column.size, dtype=float)
    summed = np.append(0.0, np.cumsum(0.5 * (column[1:] + column[:-1])))
    ahead, behind = (np.interp(points + side * width, points, summed) for side in (0.5, -0.5))
    return np.asarray((ahead - behind) / width)

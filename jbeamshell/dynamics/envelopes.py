"""Amplitude, frequency and damping of a vibration from its turning points or its analytic signal.

Friction shifts the mean of the vibration from swing to swing, so the amplitude of a swing is half
the distance between one extremum and the next, and the mean is not used.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

EDGE = 0.05  # part of the signal left out at both ends, where the Hilbert transform is inaccurate
SHORTEST = 0.2  # shortest time between two extrema, in periods
NEIGHBOURS = 5  # swings whose scatter tells the error of one
TWO_SIGMA = 1.96


class Envelope(NamedTuple):
    """Amplitude, frequency in cycles and logarithmic decrement over 2 pi, at k times.

    Attributes
    ----------
    time, amplitude, frequency, decrement : (k,) each
    frequency_off, decrement_off : (k,) half widths of 95 % intervals
    """

    time: Floats
    amplitude: Floats
    frequency: Floats
    decrement: Floats
    frequency_off: Floats
    decrement_off: Floats


def extrema(time: ArrayLike, values: ArrayLike) -> tuple[Floats, ...]:
    """Times and values of maxima and minima in alternation, by parabolas through three samples.

    Ripples much shorter than the period are left out.
    """
    from scipy.signal import find_peaks  # slow to import

    times, signal = np.asarray(time, float), np.asarray(values, float)
    spectrum = np.abs(np.fft.rfft((signal - signal.mean()) * np.hanning(signal.size)))
    main_frequency = max(int(np.argmax(spectrum)), 1) / (signal.size * (times[1] - times[0]))
    apart = max(1, int(SHORTEST / main_frequency / (times[1] - times[0])))
    picked = []
    for sign in (1.0, -1.0):
        picked += [(peak, sign) for peak in find_peaks(sign * signal, distance=2 * apart)[0]]
    picked.sort()
    kept: list[tuple[int, float]] = []
    for peak, sign in picked:
        if kept and kept[-1][1] == sign:  # of two maxima in a row the larger
            if sign * signal[peak] > sign * signal[kept[-1][0]]:
                kept[-1] = (peak, sign)
        else:
            kept.append((peak, sign))
    index = np.array([peak for peak, _ in kept], int)
    before, here, after = signal[index - 1], signal[index], signal[index + 1]
    bend = before - 2.0 * here + after
    shift = np.where(bend != 0.0, 0.5 * (before - after) / np.where(bend != 0.0, bend, 1.0), 0.0)
    return times[index] + shift * (times[1] - times[0]), here - 0.25 * (before - after) * shift


def from_swings(at: Floats, reached: Floats) -> Envelope:
    """Envelope from the times and values of the extrema; errors from the scatter of swings."""
    swings = 0.5 * np.abs(np.diff(reached))
    # The mean over a swing forth and one back cancels the difference between the two.
    decrement = np.log(swings[:-2] / swings[2:]) / (2.0 * np.pi)
    frequency = 1.0 / (0.5 * (at[2:-1] + at[3:] - at[:-3] - at[1:-2]))
    # A vibration turns atan(zeta) before its phase does, and zeta changes by so much in a swing.
    turned = np.abs(np.gradient(decrement)) / np.pi if decrement.size > 1 else np.abs(decrement)
    return Envelope(
        0.5 * (at[1:-2] + at[2:-1]),
        swings[1:-1],
        frequency,
        decrement,
        _scatter(frequency) + frequency * turned,
        _scatter(decrement) + np.abs(decrement) * (2.0 * np.pi * decrement) ** 2 / 24.0,
    )


def _scatter(column: Floats) -> Floats:
    """Half widths of a column of overlapping differences, from its second differences.

    Errors e of the swings give e_1 - e_3, whose second difference has five times the variance.
    """
    from scipy.ndimage import uniform_filter1d

    if column.size < 3:
        return np.full(column.size, np.inf)
    square = np.pad(np.diff(column, 2) ** 2, 1, mode="edge")
    return TWO_SIGMA * np.sqrt(uniform_filter1d(square, NEIGHBOURS, mode="nearest") / 5.0)


def from_analytic_signal(
    times: Floats, signal: Floats, period: float, smoothing: float, share: float
) -> Envelope:
    """Envelope from straight lines through the logarithm and phase of the analytic signal.

    Parameters
    ----------
    times, signal : samples
    period : of the vibration
    smoothing : length of a line, in periods
    share : part of all frequencies that the signal has, of which neighbours are correlated
    """
    import scipy.signal
    from scipy.ndimage import uniform_filter1d

    step = float(times[1] - times[0])
    length = min(2 * (max(3, int(smoothing * period / step)) // 2) + 1, _odd(signal.size))
    slow = scipy.signal.savgol_filter(signal, min(_odd(4.0 * period / step), _odd(signal.size)), 1)
    analytic = scipy.signal.hilbert(signal - slow)
    columns = np.log(np.abs(analytic)), np.unwrap(np.angle(analytic))
    (level, fall), (phase, rate) = (
        [scipy.signal.savgol_filter(column, length, 1, deriv=d, delta=step) for d in (0, 1)]
        for column in columns
    )
    # The slope of a line through n points has the variance 12 s^2/(n^3 h^2).
    known = max(2.0, length * min(1.0, share))
    off, turn = (
        TWO_SIGMA
        * np.sqrt(12.0 / known * uniform_filter1d((column - line) ** 2, length, mode="nearest"))
        / (length * step)
        for column, line in zip(columns, (level, phase), strict=True)
    )
    inside = slice(int(EDGE * signal.size), int((1.0 - EDGE) * signal.size))
    found = Envelope(
        times, np.exp(level), rate / (2.0 * np.pi), -fall / rate, turn / (2.0 * np.pi), off / rate
    )
    return Envelope(*(column[inside] for column in found))


def _odd(count: float) -> int:
    """Largest odd number not above a number."""
    return 2 * ((int(count) - 1) // 2) + 1

"""Frequency and damping over amplitude, from the signal of a decaying vibration.

Friction shifts the mean of the vibration from swing to swing, so the amplitude of a swing is half
the distance between one extremum and the next, and the mean is not used.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jbeamshell.common.checks import require, require_choice
from jbeamshell.measured.curves import (
    DampingCurve,
    DissipationCurve,
    FrequencyCurve,
    StiffnessCurve,
)

METHODS = ("turning-points", "hilbert")
SIGNAL = "give as many evenly spaced times as finite values, at least {} of both"
EDGE = 0.05  # part of the signal left out at both ends, where the Hilbert transform is inaccurate
KINDS = ("displacement", "velocity", "acceleration")  # powers of i omega
ORDER = 3  # of the filter of a band
FEWEST = 4  # points of a bin that tell its scatter
SHORTEST = 0.2  # shortest time between two extrema, in periods


class RingDown(NamedTuple):
    """Frequency and damping over the amplitude of a decaying vibration, (k,) each.

    Attributes
    ----------
    time : times
    amplitude : half of a swing
    frequency : cycles per time
    damping : damping ratio zeta; the logarithmic decrement is 2 pi zeta per cycle
    """

    time: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    frequency: NDArray[np.float64]
    damping: NDArray[np.float64]

    def curves(
        self, mass: float, points: int = 12, width: float = 1.0
    ) -> tuple[DissipationCurve, StiffnessCurve]:
        """Dissipation and stiffness of a strip from the ring-down of a mass on it.

        The mass balances the strip, so the amplitude of the force is F = m omega^2 u, and the
        energy per cycle is 2 pi zeta F u.

        Parameters
        ----------
        mass : mass at the loaded end, far heavier than the strip
        points : number of points of a curve, evenly spaced in the logarithm of the amplitude
        width : width of the strip, by which forces are divided

        Returns
        -------
        DissipationCurve, StiffnessCurve
            observations for `jbeamshell.identify.fit`

        Raises
        ------
        InputError
            for a signal that does not decay
        """
        rising = np.argsort(self.amplitude)
        known = rising[self.damping[rising] > 0.0]
        fix = "is nowhere positive: give the signal of a vibration that decays"
        require("damping", float(self.damping.max()), known.size > 1, fix)
        smallest, largest = self.amplitude[known[[0, -1]]].tolist()
        u = np.geomspace(smallest, largest, points)
        frequency, damping = (
            np.interp(u, self.amplitude[known], column[known])
            for column in (self.frequency, self.damping)
        )
        force = mass / width * (2.0 * np.pi * frequency) ** 2 * u
        loss = DissipationCurve(
            force, 2.0 * np.pi * damping * force * u, label="ring-down, damping"
        )
        return loss, StiffnessCurve(force, force / u, label="ring-down, frequency")

    def modal_curves(
        self, points: int = 20, *, low: float = 0.0, high: float = np.inf, label: str = "ring-down"
    ) -> tuple[FrequencyCurve, DampingCurve]:
        """Frequency and damping of a structure over the amplitude, with their noise.

        Each point is the mean of a bin, evenly wide in the logarithm of the amplitude.  Its noise
        is that of the mean: the scatter about a straight line in the bin, over the root of its
        independent points, whose number follows from the correlation of neighbours.

        Parameters
        ----------
        points : number of bins; those without enough points are left out
        low, high : amplitudes between which the vibration is taken
        label : label of the curves

        Returns
        -------
        FrequencyCurve, DampingCurve
            observations of a structure for `jbeamshell.identify.fit`

        Raises
        ------
        InputError
            for a signal that does not decay between these amplitudes
        """
        kept = (self.amplitude >= low) & (self.amplitude <= high)
        size, bins = np.log(self.amplitude[kept]), []
        fix = "leaves no vibration: take wider bounds"
        require("low, high", (low, high), size.size >= FEWEST, fix)
        edges = np.linspace(size.min(), size.max() + 1e-9, points + 1)
        for place in range(points):
            inside = (size >= edges[place]) & (size < edges[place + 1])
            if np.count_nonzero(inside) < FEWEST:
                continue
            columns = (self.frequency[kept][inside], self.damping[kept][inside])
            means = [_mean_and_noise(size[inside], column) for column in columns]
            if means[1][0] > 0.0:
                bins.append((np.exp(np.mean(size[inside])), *means[0], *means[1]))
        fix = "has no bin that decays: take fewer points, or more of the vibration"
        require("points", points, len(bins) > 1, fix)
        u, frequency, scatter, damping, spread = np.array(bins).T
        return (
            FrequencyCurve(u, frequency, f"{label}, frequency", scatter),
            DampingCurve(u, damping, f"{label}, damping", spread),
        )

    def plot(self, axes: Any = None) -> Any:
        """Draw frequency and damping over amplitude; see `jbeamshell.plotting.ring_down`."""
        from jbeamshell import plotting

        return plotting.ring_down(self, axes=axes)


def ring_down(
    time: ArrayLike,
    values: ArrayLike,
    *,
    method: str = "turning-points",
    smoothing: float = 1.0,
    band: tuple[float, float] | None = None,
    kind: str = KINDS[0],
) -> RingDown:
    """Amplitude, frequency and damping of one decaying vibration.

    Parameters
    ----------
    time : (T,) evenly spaced times
    values : (T,) displacements, or what ``kind`` names
    method : "turning-points" measures the length and the decrease of every swing; "hilbert" fits
        straight lines to the logarithm and the phase of the analytic signal over a moving window
        (Feldman 2011)
    smoothing : length of that window, in periods
    band : lowest and highest frequency of a band-pass filter without phase shift, which leaves one
        mode of several; it disturbs some periods at both ends
    kind : "displacement", "velocity" or "acceleration" of an accelerometer; the amplitude is that
        of the displacement, by the frequency found

    Raises
    ------
    InputError
        for a signal that is not finite or evenly spaced, or has fewer than four extrema; for a band
        that the times do not resolve

    Examples
    --------
    >>> t = np.linspace(0.0, 30.0, 6001)
    >>> found = ring_down(t, np.exp(-0.1 * t) * np.cos(10.0 * t))
    >>> round(float(found.damping[10]), 3)
    0.01
    """
    times, signal = np.asarray(time, float), np.asarray(values, float)
    require_choice("method", method, METHODS)
    paired = times.ndim == 1 and times.shape == signal.shape and times.size >= 8
    require("values", signal.shape, paired, SIGNAL.format(8))
    steps = np.diff(times)
    even = bool(np.all(np.isfinite(signal)) and np.allclose(steps, steps[0]) and steps[0] > 0.0)
    require("time", times[:3], even, SIGNAL.format(8))
    require_choice("kind", kind, KINDS)
    signal = signal if band is None else _within(signal, float(np.mean(steps)), band)
    at, reached = extrema(times, signal)
    fix = "must be at least 4: follow the motion for longer"
    require("extrema of values", at.size, at.size >= 4, fix)
    if method == "turning-points":
        found = _from_swings(at, reached)
    else:
        found = _from_envelope(times, signal, 2.0 * float(np.mean(np.diff(at))), smoothing)
    omega = 2.0 * np.pi * found.frequency
    return found._replace(amplitude=found.amplitude / omega ** KINDS.index(kind))


def _within(
    signal: NDArray[np.float64], step: float, band: tuple[float, float]
) -> NDArray[np.float64]:
    """Part of a signal in a band of frequencies, by a Butterworth filter run both ways."""
    from scipy.signal import butter, sosfiltfilt

    known = len(band) == 2 and 0.0 < band[0] < band[1] < 0.5 / step
    require("band", tuple(band), known, f"give two rising frequencies below {0.5 / step:.6g}")
    sections = butter(ORDER, band, "bandpass", fs=1.0 / step, output="sos")
    return np.asarray(sosfiltfilt(sections, signal))


def _mean_and_noise(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[float, float]:
    """Mean of a column, and the noise of that mean beside a straight trend over x."""
    along, left = x - np.mean(x), y - np.mean(y)
    left = left - along * (along @ left) / max(float(along @ along), np.finfo(float).tiny)
    scatter = float(np.std(left, ddof=2))
    square = float(left @ left)
    after = float(left[1:] @ left[:-1]) / square if square > 0.0 else 0.0
    # n points of a first-order process with correlation rho tell as much as n (1-rho)/(1+rho).
    share = np.clip((1.0 - after) / (1.0 + after), 1.0 / x.size, 1.0)
    least = np.finfo(float).eps * float(np.max(np.abs(y)))
    return float(np.mean(y)), max(scatter / float(np.sqrt(x.size * share)), least)


def extrema(time: ArrayLike, values: ArrayLike) -> tuple[NDArray[np.float64], ...]:
    """Times and values of maxima and minima in alternation, by parabolas through three samples.

    Ripples much shorter than the period are left out.
    """
    times, signal = np.asarray(time, float), np.asarray(values, float)
    spectrum = np.abs(np.fft.rfft((signal - signal.mean()) * np.hanning(signal.size)))
    main_frequency = max(int(np.argmax(spectrum)), 1) / (signal.size * (times[1] - times[0]))
    apart = max(1, int(SHORTEST / main_frequency / (times[1] - times[0])))
    picked = []
    for sign in (1.0, -1.0):
        picked += [(peak, sign) for peak in _peaks(sign * signal, 2 * apart)]
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


def _peaks(signal: NDArray[np.float64], apart: int) -> list[int]:
    """Places of maxima; of those nearer to each other than some samples only the highest."""
    inner = signal[1:-1]
    tops = 1 + np.flatnonzero((inner > signal[:-2]) & (inner >= signal[2:]))
    free = np.ones(signal.size, bool)
    found = []
    for top in tops[np.argsort(-signal[tops], kind="stable")].tolist():
        if free[top]:
            free[max(0, top - apart + 1) : top + apart] = False
            found.append(top)
    return found


def _from_swings(at: NDArray[np.float64], reached: NDArray[np.float64]) -> RingDown:
    """Ring-down from the times and values of the extrema."""
    swings = 0.5 * np.abs(np.diff(reached))
    # The mean over a swing forth and one back cancels the difference between the two.
    decrease = np.log(swings[:-2] / swings[2:]) / (2.0 * np.pi)
    return RingDown(
        time=0.5 * (at[1:-2] + at[2:-1]),
        amplitude=swings[1:-1],
        frequency=1.0 / (0.5 * (at[2:-1] + at[3:] - at[:-3] - at[1:-2])),
        damping=decrease,
    )


def _from_envelope(
    times: NDArray[np.float64], signal: NDArray[np.float64], period: float, smoothing: float
) -> RingDown:
    """Ring-down from the analytic signal."""
    import scipy.signal

    step = times[1] - times[0]
    window = 2 * (max(3, int(smoothing * period / step)) // 2) + 1
    slow = scipy.signal.savgol_filter(signal, min(_odd(4.0 * period / step), _odd(signal.size)), 1)
    analytic = scipy.signal.hilbert(signal - slow)
    level, phase = np.log(np.abs(analytic)), np.unwrap(np.angle(analytic))
    smooth, slope = (
        scipy.signal.savgol_filter(column, min(window, _odd(signal.size)), 1, deriv=d, delta=step)
        for column, d in ((level, 0), (level, 1))
    )
    rate = scipy.signal.savgol_filter(phase, min(window, _odd(signal.size)), 1, 1, step)
    inside = slice(int(EDGE * signal.size), int((1.0 - EDGE) * signal.size))
    return RingDown(
        times[inside], np.exp(smooth)[inside], rate[inside] / (2.0 * np.pi), -(slope / rate)[inside]
    )


def _odd(count: float) -> int:
    """Largest odd number not above a number."""
    return 2 * ((int(count) - 1) // 2) + 1

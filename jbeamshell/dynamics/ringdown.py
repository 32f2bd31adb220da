"""Frequency and damping over amplitude, from the signal of a decaying vibration.

Friction shifts the mean of the vibration from swing to swing, so the amplitude of a swing is half
the distance between one extremum and the next, and the mean is not used.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jbeamshell.common.checks import require, require_choice
from jbeamshell.measured.curves import DissipationCurve, StiffnessCurve

METHODS = ("turning-points", "hilbert")
SIGNAL = "give as many evenly spaced times as finite values, at least {} of both"
EDGE = 0.05  # part of the signal left out at both ends, where the Hilbert transform is inaccurate
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

    def plot(self, axes: Any = None) -> Any:
        """Draw frequency and damping over amplitude; see `jbeamshell.plotting.ring_down`."""
        from jbeamshell import plotting

        return plotting.ring_down(self, axes=axes)


def ring_down(
    time: ArrayLike, values: ArrayLike, *, method: str = "turning-points", smoothing: float = 1.0
) -> RingDown:
    """Amplitude, frequency and damping of one decaying vibration.

    Parameters
    ----------
    time : (T,) evenly spaced times
    values : (T,) displacements
    method : "turning-points" measures the length and the decrease of every swing; "hilbert" fits
        straight lines to the logarithm and the phase of the analytic signal over a moving window
        (Feldman 2011)
    smoothing : length of that window, in periods

    Raises
    ------
    InputError
        for a signal that is not finite or evenly spaced, or has fewer than four extrema

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
    at, reached = extrema(times, signal)
    fix = "must be at least 4: follow the motion for longer"
    require("extrema of values", at.size, at.size >= 4, fix)
    if method == "turning-points":
        return _from_swings(at, reached)
    return _from_envelope(times, signal, 2.0 * float(np.mean(np.diff(at))), smoothing)


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

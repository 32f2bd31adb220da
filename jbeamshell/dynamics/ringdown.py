"""Ring-down to frequency and damping that depend on amplitude.

Friction leaves a strip off its zero, by more or less at every swing, so amplitudes are half the
distance between one turning point and the next, and nothing is asked of the mean.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy.signal
from numpy.typing import ArrayLike, NDArray

from jbeamshell.common.checks import require, require_choice
from jbeamshell.measured.curves import DissipationCurve, StiffnessCurve

METHODS = ("turning-points", "hilbert")
SIGNAL = "give as many evenly spaced times as finite values, at least {} of both"
EDGE = 0.05  # of the signal at both ends, where the Hilbert transform is not to be trusted
RELIABLE = 0.2  # of a period is the least between two turning points that belong to one vibration


class RingDown(NamedTuple):
    """Frequency and damping at instants of a decaying vibration, (k,) each.

    Attributes
    ----------
    time : instants
    amplitude : half of the swing
    frequency : cycles per time
    damping : ratio zeta, of the logarithmic decrement 2 pi zeta per cycle
    """

    time: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    frequency: NDArray[np.float64]
    damping: NDArray[np.float64]

    def curves(
        self, mass: float, points: int = 12, width: float = 1.0
    ) -> tuple[DissipationCurve, StiffnessCurve]:
        """What a mass on a strip tells of it, for `jbeamshell.identify.fit`.

        Inertia balances the strip, so the force's amplitude is F = m omega^2 u and, with the
        decrement, the energy per cycle 2 pi zeta F u.

        Parameters
        ----------
        mass : at the loaded end, far heavier than the strip
        points : of the curves, evenly spaced in the logarithm of the amplitude
        width : of the strip, by which forces are divided
        """
        rising = np.argsort(self.amplitude)
        known = rising[self.damping[rising] > 0.0]
        fix = "nowhere decreases: there is no damping to fit"
        require("damping", float(self.damping.max()), known.size > 1, fix)
        least, most = self.amplitude[known[[0, -1]]].tolist()
        u = np.geomspace(least, most, points)
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
    """Instantaneous amplitude, frequency and damping of one decaying vibration.

    Parameters
    ----------
    time, values : (T,) evenly spaced instants and a displacement
    method : "turning-points": every swing, its length and its decrease; or "hilbert": the analytic
        signal, whose logarithm and phase are fitted by straight lines over a moving window
    smoothing : window of the second, in periods

    Raises
    ------
    InputError
        for a signal that is none, or has fewer than three turning points
    """
    times, signal = np.asarray(time, float), np.asarray(values, float)
    require_choice("method", method, METHODS)
    paired = times.ndim == 1 and times.shape == signal.shape and times.size >= 8
    require("values", signal.shape, paired, SIGNAL.format(8))
    steps = np.diff(times)
    even = bool(np.all(np.isfinite(signal)) and np.allclose(steps, steps[0]) and steps[0] > 0.0)
    require("time", times[:3], even, SIGNAL.format(8))
    at, turned = turning_points(times, signal)
    fix = "turns fewer than four times: follow the motion for longer"
    require("values", at.size, at.size >= 4, fix)
    if method == "turning-points":
        return _of_swings(at, turned)
    return _of_envelope(times, signal, 2.0 * float(np.mean(np.diff(at))), smoothing)


def turning_points(time: ArrayLike, values: ArrayLike) -> tuple[NDArray[np.float64], ...]:
    """Instants and values of the maxima and minima by turns, parabolas through three samples.

    Ripples on the way from one to the other, shorter than a part of the period, do not count.
    """
    times, signal = np.asarray(time, float), np.asarray(values, float)
    spectrum = np.abs(np.fft.rfft((signal - signal.mean()) * np.hanning(signal.size)))
    main = max(int(np.argmax(spectrum)), 1) / (signal.size * (times[1] - times[0]))
    apart = max(1, int(RELIABLE / main / (times[1] - times[0])))
    picked = []
    for sign in (1.0, -1.0):
        peaks, _ = scipy.signal.find_peaks(sign * signal, distance=2 * apart)
        picked += [(int(peak), sign) for peak in peaks]
    picked.sort()
    kept: list[tuple[int, float]] = []
    for peak, sign in picked:
        if kept and kept[-1][1] == sign:  # two of a kind: the further out
            if sign * signal[peak] > sign * signal[kept[-1][0]]:
                kept[-1] = (peak, sign)
        else:
            kept.append((peak, sign))
    index = np.array([peak for peak, _ in kept], int)
    before, here, after = signal[index - 1], signal[index], signal[index + 1]
    bend = before - 2.0 * here + after
    shift = np.where(bend != 0.0, 0.5 * (before - after) / np.where(bend != 0.0, bend, 1.0), 0.0)
    return times[index] + shift * (times[1] - times[0]), here - 0.25 * (before - after) * shift


def _of_swings(at: NDArray[np.float64], turned: NDArray[np.float64]) -> RingDown:
    swings = 0.5 * np.abs(np.diff(turned))
    # The mean of two swings, there and back, so that what differs between them cancels.
    decrease = np.log(swings[:-2] / swings[2:]) / (2.0 * np.pi)
    return RingDown(
        time=0.5 * (at[1:-2] + at[2:-1]),
        amplitude=swings[1:-1],
        frequency=1.0 / (0.5 * (at[2:-1] + at[3:] - at[:-3] - at[1:-2])),
        damping=decrease,
    )


def _of_envelope(
    times: NDArray[np.float64], signal: NDArray[np.float64], period: float, smoothing: float
) -> RingDown:
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
    return 2 * ((int(count) - 1) // 2) + 1

"""Frequency and damping over amplitude, from the signal of a decaying vibration.

By itself `ring_down` fits a decaying vibration (`jbeamshell.dynamics.decay`), which withstands
noise, short records and few samples of a period.  A motion without noise that is no vibration of
slowly changing amplitude and frequency, such as the first swings of a strip that is let go from
near gross slip, is measured swing by swing.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jbeamshell.common.checks import require, require_choice
from jbeamshell.common.errors import InputError, warn_of_doubts
from jbeamshell.dynamics.decay import Decay, evidence_needed, fit_decay
from jbeamshell.dynamics.envelopes import Envelope, extrema, from_analytic_signal, from_swings
from jbeamshell.dynamics.over_amplitude import RingDown

Floats = NDArray[np.float64]

METHODS = ("auto", "least-squares", "turning-points", "hilbert")
SIGNAL = "give as many evenly spaced times as finite values, at least {} of both"
KINDS = ("displacement", "velocity", "acceleration")  # powers of i omega
ORDER = 3  # of the filter of a band
UNEVEN = 0.35  # largest shift of a time from an even one, in steps: a lost sample shifts .5
TURNS = 8  # least number of turning points that are met of themselves
SMOOTH = 16.0  # samples of a period from which turning points are met
NOISY = 1e-4  # noise of a sample over the signal's range, beyond which they are not
STRANGE = 1e-4  # what a fit leaves over that range, from which they are better
CLEARLY = 10.0  # that over the noise
FEWEST = 5  # turning points, of which two points of a ring-down come
STILL = 1e-12  # range of a signal over its values, up to which it never changes
EDGES = 2.0  # time that a filter disturbs at its ends, times its width
OTHER = 0.05  # another vibration over the first one, from which it is doubted
HARMONICS = 0.15  # distance from a multiple of the frequency, over it, that makes another vibration
UNKNOWN = 0.2  # half width of an interval over its value, beyond which there is no frequency
VAGUE = 0.5  # half width of the damping's interval over the damping, beyond which it is doubted
SMALL = 1e-5  # half width of that interval that is always good enough
COARSE = 2.5  # samples of a period, below which it is doubted
NOTHING = (
    "no decaying vibration stands out from noise: follow more cycles with less noise, or give the "
    "band= of frequencies that it lies in"
)


def ring_down(
    time: ArrayLike,
    values: ArrayLike,
    *,
    method: str = METHODS[0],
    smoothing: float = 1.0,
    band: tuple[float, float] | None = None,
    kind: str = KINDS[0],
) -> RingDown:
    """Amplitude, frequency and damping of one decaying vibration, with their 95 % intervals.

    The damping is that of the decay.  Steady vibration of a joint that softens by friction is
    damped less, by a quarter near gross slip: see `RingDown.steady_damping`.

    Parameters
    ----------
    time : (T,) evenly spaced times
    values : (T,) displacements, or what ``kind`` names
    method : "least-squares" fits a decaying vibration whose rates are constant, or depend on the
        amplitude if the data show it; "turning-points" measures the length and the decrease of
        every swing; "hilbert" fits straight lines to the logarithm and the phase of the analytic
        signal over a moving window (Feldman 2011); "auto" takes turning points for a motion without
        noise that the fit cannot describe, and the fit for all else
    smoothing : length of that window, in periods
    band : lowest and highest frequency of a band-pass filter without phase shift, which leaves one
        mode of several; it disturbs some periods at both ends, which a fit leaves out
    kind : "displacement", "velocity" or "acceleration" of an accelerometer; the amplitude is that
        of the displacement, by the frequency found

    Returns
    -------
    RingDown

    Raises
    ------
    InputError
        for a signal that is not finite or evenly spaced, is constant, shows no decaying vibration
        above its noise, or has fewer than five extrema where they are measured; for a band that the
        times do not resolve

    Warns
    -----
    DoubtfulWarning
        if the record leaves damping or frequency open, or has another vibration; see ``doubts``

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
    step = float(times[-1] - times[0]) / (times.size - 1)
    meant = times[0] + step * np.arange(times.size)  # files may hold rounded times
    off = np.abs(times - meant)
    even = bool(np.all(np.isfinite(signal)) and step > 0.0 and np.all(off < UNEVEN * step))
    require("time", times[:3], even, SIGNAL.format(8))
    times = meant
    require_choice("kind", kind, KINDS)
    first, moves = float(signal[0]), float(np.ptp(signal)) > STILL * float(np.max(np.abs(signal)))
    if band is not None:
        signal = _within(signal, step, band)
    require("values", first, moves, "never changes: give the signal of a vibration")
    known = slice(None) if band is None else _undisturbed(times, band)
    if method in ("auto", "least-squares"):
        limits = band or (0.0, np.inf)
        angular = 2.0 * np.pi * limits[0], 2.0 * np.pi * limits[1]
        fitted = fit_decay(times[known], signal[known], angular)
        free = method == "auto" and band is None and extrema(times, signal)[0].size >= TURNS
        if free and fitted and _is_strange(fitted, step, float(np.ptp(signal))):
            method = "turning-points"
        else:
            result = _told(fitted, step, limits)
    if method in ("turning-points", "hilbert"):
        points = _points(times, signal, method, smoothing, band)
        result = _measured(points, method)
    warn_of_doubts(result.doubts)
    return dataclasses.replace(
        result, amplitude=result.amplitude / result.omega ** KINDS.index(kind)
    )


def _points(
    times: Floats,
    signal: Floats,
    method: str,
    smoothing: float,
    band: tuple[float, float] | None,
) -> Envelope:
    """Envelope by turning points or by the analytic signal."""
    at, reached = extrema(times, signal)
    fix = f"must be at least {FEWEST}: follow the motion for longer"
    require("extrema of values", at.size, at.size >= FEWEST, fix)
    if method == "turning-points":
        return from_swings(at, reached)
    share = 1.0 if band is None else 2.0 * float(times[1] - times[0]) * (band[1] - band[0])
    period = 2.0 * float(np.mean(np.diff(at)))
    return from_analytic_signal(times, signal, period, smoothing, share)


def _undisturbed(times: Floats, band: tuple[float, float]) -> slice:
    """Samples that the filter of a band does not disturb at its ends."""
    edge = int(EDGES / (band[1] - band[0]) / (times[1] - times[0]))
    return slice(edge, times.size - edge) if times.size > 4 * edge else slice(None)


def _is_strange(fitted: Decay, step: float, size: float) -> bool:
    """True for a dense motion without noise that no slowly changing vibration describes."""
    dense = 2.0 * np.pi / (fitted.omega[-1] * step) > SMOOTH
    strange = fitted.left > max(STRANGE * size, CLEARLY * fitted.quiet)
    octave = abs(np.log2(max(fitted.other_omega, 1e-300) / fitted.omega[-1])) > 1.0
    several = octave and _has_another(fitted)
    return bool(dense and strange and fitted.quiet < NOISY * size and not several)


def _told(fitted: Decay | None, step: float, band: tuple[float, float]) -> RingDown:
    """Ring-down by the fit of a decaying vibration, with its doubts."""
    if fitted is None or fitted.evidence < evidence_needed(fitted.samples):
        raise InputError(f"values: {NOTHING}")
    off = fitted.omega_off / fitted.omega
    known = (off < UNKNOWN) & (fitted.decay < fitted.omega)
    if np.count_nonzero(known) < 2:
        raise InputError(f"values: {NOTHING}")
    ratio, spread = fitted.decay / fitted.omega, fitted.decay_off / fitted.omega
    frequency, root = fitted.omega / (2.0 * np.pi), np.sqrt(1.0 + ratio**2)
    spread = np.hypot(spread, ratio * off) / root**3
    result = RingDown(
        fitted.time,
        fitted.amplitude,
        frequency,
        ratio / root,
        _ends(frequency, frequency * off),
        _ends(ratio / root, spread),
        fitted.numbers,
        "least-squares",
    ).part(known)
    return dataclasses.replace(
        result, doubts=(*_doubts_of_record(fitted, step, band), *_doubts(result))
    )


def _measured(found: Envelope, method: str) -> RingDown:
    """Ring-down of points that were measured one by one, with its doubts."""
    root = np.sqrt(1.0 + found.decrement**2)
    result = RingDown(
        found.time,
        found.amplitude,
        found.frequency,
        found.decrement / root,
        _ends(found.frequency, found.frequency_off),
        _ends(found.decrement / root, found.decrement_off / root**3),
        method=method,
    )
    return dataclasses.replace(result, doubts=_doubts(result))


def _ends(column: Floats, off: Floats) -> Floats:
    """Ends (k, 2) of intervals."""
    return np.stack([column - off, column + off], axis=1)


def _doubts(found: RingDown) -> tuple[str, ...]:
    """Doubt about a damping that the record leaves open."""
    ends = found.damping_interval
    assert ends is not None
    off, damping = 0.5 * np.ptp(ends, axis=1), np.abs(found.damping)
    if np.mean(ends[:, 1] < 0.0) > 0.5:
        return ("the vibration grows: give the part of the record in which it decays",)
    if np.mean(off > np.maximum(VAGUE * damping, SMALL)) <= 0.5:
        return ()
    if not np.all(np.isfinite(off)):
        return ("too few swings tell no error: follow the motion for longer",)
    row = int(np.argsort(off / np.maximum(damping, 1e-300))[off.size // 2])
    return (
        f"the damping lies between {ends[row, 0]:.3g} and {ends[row, 1]:.3g} as far as the record "
        f"tells: follow more cycles, or with less noise",
    )


def _has_another(fitted: Decay, band: tuple[float, float] = (0.0, np.inf)) -> bool:
    """True if the fit leaves another vibration in the band that is no multiple of the first."""
    if not band[0] < fitted.other_omega / (2.0 * np.pi) < band[1]:
        return False
    multiple = fitted.other_omega / float(fitted.omega[-1])
    order = round(multiple)
    return fitted.other > OTHER and (order not in range(6) or abs(multiple - order) > HARMONICS)


def _doubts_of_record(fitted: Decay, step: float, band: tuple[float, float]) -> tuple[str, ...]:
    """Doubts about a record with another vibration, or with few samples of a period."""
    omega, other, doubts = float(fitted.omega[-1]), fitted.other_omega, []
    if _has_another(fitted, band):
        between = float(np.sqrt(omega * other))
        top = min(2.0 * omega, 0.9 * np.pi / step)
        ends = (between, top) if other < omega else (0.5 * omega, between)
        words = ", ".join(f"{end / (2.0 * np.pi):.3g}" for end in ends)
        doubts.append(
            f"another vibration of frequency {other / (2.0 * np.pi):.4g} is left, "
            f"{100.0 * fitted.other:.2g} % of the one that was fitted: give band=({words})"
        )
    if omega * step > 2.0 * np.pi / COARSE:
        doubts.append(
            f"a period has {2.0 * np.pi / (omega * step):.2g} samples, and faster vibrations look "
            "like slower ones below two: sample faster"
        )
    return tuple(doubts)


def _within(
    signal: NDArray[np.float64], step: float, band: tuple[float, float]
) -> NDArray[np.float64]:
    """Part of a signal in a band of frequencies, by a Butterworth filter run both ways."""
    from scipy.signal import butter, sosfiltfilt

    known = len(band) == 2 and 0.0 < band[0] < band[1] < 0.5 / step
    require("band", tuple(band), known, f"give two rising frequencies below {0.5 / step:.6g}")
    sections = butter(ORDER, band, "bandpass", fs=1.0 / step, output="sos")
    return np.asarray(sosfiltfilt(sections, signal))

"""Decaying vibration by least squares: rate of decay and frequency as functions of the amplitude.

The signal is x(t) = c(t) + a(t) cos psi(t) with a slow mean c, and

    d log a/dt = -sigma(a),      d psi/dt = omega(a),

the slow flow of a lightly damped mode (Nayfeh and Mook 1979).  Both rates are splines of log a,
with as many numbers as the data ask for by Akaike's corrected criterion, from constants upwards.
Rates that depend on the amplitude are stated one step richer than the criterion asks, because what
it leaves out is as large as the error.  Noise is taken from what is left; where that is not white,
about the frequency of the vibration, so that harmonics and drifts do not count.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jbeamshell.dynamics.decay_start import DENSEST, begins_at, strongest

Floats = NDArray[np.float64]

NUMBERS = (1, 2, 3, 4, 6, 9)  # of each rate
VISIBLE = 2.0  # smallest amplitude that tells a rate, over the noise of one cycle's amplitude
ROUNDING = 1e-9  # of the signal, below which nothing is told
BAND = 0.5  # half width of the band about the frequency that tells the noise, over the frequency
ODDS = 1e-3  # of white noise, below which what is left is not taken as white
EVIDENCE = 8.0  # power of a vibration over the noise and the log of the samples, to be one
HIGHEST = 50.0  # log a that a search may meet
LEAST = 0.1  # range of log a that may tell how rates depend on it
FREE = 4  # degrees of freedom that tell a variance
LEVEL = 0.95  # of the intervals
CONSTANT = 5.0  # gain of the criterion that rates which depend on the amplitude must show
ROUNDS = 8  # of a fit, whose splines are those of the amplitude before
SETTLED = 1e-3  # change of log a by a round after which there is no further one
FEWEST_PERIODS = 1.5  # of a number of a rate


class Decay(NamedTuple):
    """Decaying vibration that was fitted to a signal, at k times.

    Attributes
    ----------
    time, amplitude, decay, omega : (k,) times, amplitudes, rates of decay and angular frequencies
    decay_off, omega_off : (k,) half widths of their 95 % intervals
    numbers : of each rate; 1 where they do not depend on the amplitude
    quiet : standard deviation of a sample's white noise, without what the fit cannot describe
    left : largest that the fit leaves of the signal
    other : strongest vibration in what the fit leaves, its amplitude over that of the fitted one,
        both over the record
    other_omega : its angular frequency
    evidence : power of the fitted vibration over the record, over the variance of the noise
    samples : number of those that were fitted
    """

    time: Floats
    amplitude: Floats
    decay: Floats
    omega: Floats
    decay_off: Floats
    omega_off: Floats
    numbers: int
    quiet: float
    left: float
    other: float
    other_omega: float
    evidence: float
    samples: int


class _Fit(NamedTuple):
    """Least-squares fit with some numbers of each rate; times in samples."""

    values: Floats
    inverse: Floats
    mean: int
    left: Floats
    level: Floats
    knots: Floats
    variance: float
    freedom: float
    near: float
    whole: float
    white: bool

    @property
    def numbers(self) -> int:
        return (self.values.size - self.mean - 2) // 2

    def rates(self, level: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Decay and frequency at levels of log a, and their variances."""
        basis = _basis(level, self.knots, self.numbers)
        first, last = self.mean + 2, self.mean + 2 + self.numbers
        one, two = slice(first, last), slice(last, None)
        spread = self.inverse * self.variance
        variances = (np.einsum("ki,ij,kj->k", basis, spread[i, i], basis) for i in (one, two))
        decay, omega = basis @ self.values[one], basis @ self.values[two]
        return decay, omega, *variances


def fit_decay(
    time: Floats, signal: Floats, band: tuple[float, float] = (0.0, np.inf)
) -> Decay | None:
    """Fit a decaying vibration to a signal at evenly spaced times; None where none is found.

    Parameters
    ----------
    time, signal : samples
    band : angular frequencies outside of which a filter has left no noise
    """
    from scipy.special import stdtrit

    step, size = float(time[1] - time[0]), float(np.ptp(signal))
    y = (signal - np.mean(signal)) / size
    begun = begins_at(y)
    y, time, band = y[begun:], time[begun:], (step * band[0], step * band[1])
    start = strongest(y)
    if start is None:
        return None
    merged = max(1, int(2.0 * np.pi / start[2] / DENSEST))
    if merged > 1:
        y = y[: y.size // merged * merged].reshape(-1, merged).mean(axis=1)
        band = merged * band[0], merged * band[1]
        time = time[0] + step * (np.arange(y.size) * merged + 0.5 * (merged - 1))
        step *= merged
    fits = _fits(y, merged * start[1], merged * start[2], band)
    if not fits:
        return None
    place = int(np.argmin(_scores(fits)))
    place = min(place + 1, len(fits) - 1) if place else 0
    best, other = fits[place], fits[max(place - 1, 0)]
    at = _times(best)
    if at.size < 1:
        return None
    level = np.interp(at, np.arange(y.size), best.level)
    decay, omega, one, two = best.rates(level)
    factor = float(stdtrit(best.freedom, 0.5 + 0.5 * LEVEL))
    zeta = decay / omega
    offs = []
    for value, variance, beside, order in (
        (decay, one, other.rates(level)[0], (2.0 * np.pi * zeta) ** 2 / 24.0),
        (omega, two, other.rates(level)[1], 0.5 * zeta**2),
    ):
        off = np.sqrt(factor**2 * variance) + ROUNDING * omega
        if best.numbers > 1:
            off = np.hypot(off, beside - value) + np.abs(value) * order
        offs.append(off)
    # A mean of neighbours is smaller than the vibration, and the more so, the higher its frequency.
    complex_rate = -decay + 1j * omega
    within = (np.arange(merged) - 0.5 * (merged - 1)) / merged
    shrunk = np.abs(np.exp(complex_rate[:, None] * within).mean(axis=1))
    rest, quiet = strongest(best.left), _quiet(best.left)
    seen = rest is not None and rest[0] > evidence_needed(y.size) * quiet
    if at.size > 1:
        decay = decay + np.gradient(np.log(shrunk), at)
    told = float(np.sum((y - y.mean()) ** 2) - np.sum(best.left**2))
    return Decay(
        time[0] + step * at,
        size * np.exp(level) / shrunk,
        decay / step,
        omega / step,
        offs[0] / step,
        offs[1] / step,
        best.numbers,
        size * float(np.sqrt(quiet * merged)),
        size * float(np.max(np.abs(best.left))),
        float(np.sqrt(rest[0] / max(told, ROUNDING**2))) if rest and seen else 0.0,
        rest[2] / step if rest else 0.0,
        told / best.variance,
        y.size,
    )


def evidence_needed(samples: int) -> float:
    """Power that a vibration among some samples must have over the noise of one, to be one."""
    return EVIDENCE * float(np.log(samples))


def _fits(y: Floats, fall: float, about: float, band: tuple[float, float]) -> list[_Fit]:
    """Fits with rising numbers of each rate, until the criterion has risen twice."""
    n = np.arange(y.size, dtype=float)
    fits: list[_Fit] = []
    level, rates = -fall * n, (np.array([fall]), np.array([about]))
    band = max(band[0], (1.0 - BAND) * about), min(band[1], (1.0 + BAND) * about)
    for numbers in NUMBERS:
        if fits:
            before = fits[-1]
            level, floor = before.level, _floor(before)
            periods = before.rates(level[:1])[1][0] * np.sum(level > floor) / (2.0 * np.pi)
            if numbers * FEWEST_PERIODS > periods or level[0] - floor < LEAST:
                break
        fit = None
        for _ in range(1 if numbers == 1 else ROUNDS):
            if fits and level.max() - _floor(fits[-1]) < LEAST:
                fit = None
                break
            knots = _knots(level, fits[-1] if fits else None, numbers)
            basis = _basis(level, knots, numbers)
            if fits or fit is not None:
                old = fit or fits[-1]
                decay, omega = old.rates(old.level)[:2]
                weight = np.exp(2.0 * np.maximum(old.level - old.level.max(), -6.0))
                root = np.sqrt(weight)[:, None]
                fitted = np.linalg.lstsq(
                    root * basis, root * np.stack([decay, omega], axis=1), rcond=None
                )[0]
                rates = (
                    np.clip(fitted[:, 0], decay.min(), decay.max()),
                    np.clip(fitted[:, 1], omega.min(), omega.max()),
                )
            mean = np.column_stack([basis, n / n.size])
            fit = _least_squares(y, mean, basis, rates, knots, band)
            if fit is None:
                break
            moved, level = float(np.max(np.abs(fit.level - level))), fit.level
            if moved < SETTLED:
                break
        if fit is None or not _is_seen(fit.rates(fit.level)[1]):
            break
        fits.append(fit)
        if len(fits) - 1 - int(np.argmin(_scores(fits))) >= 2:
            break
    return fits


def _is_seen(omega: Floats) -> bool:
    """True for frequencies per sample that samples tell: positive, with two samples a period."""
    return bool(np.all((omega > 0.0) & (omega < np.pi)))


def _least_squares(
    y: Floats,
    mean: Floats,
    basis: Floats,
    rates: tuple[Floats, Floats],
    knots: Floats,
    band: tuple[float, float],
) -> _Fit | None:
    """Fit of the mean, amplitude, phase and rates."""
    from scipy.optimize import least_squares

    count, numbers = mean.shape[1], basis.shape[1]
    passed = np.zeros_like(basis)
    passed[1:] = np.cumsum(0.5 * (basis[1:] + basis[:-1]), axis=0)
    size, angle = np.exp(np.minimum(-passed @ rates[0], HIGHEST)), passed @ rates[1]
    columns = np.column_stack([mean, size * np.cos(angle), size * np.sin(angle)])
    first = np.linalg.lstsq(columns, y, rcond=None)[0]
    c, s = first[-2:]
    top = float(np.log(max(np.hypot(c, s), 1e-12)))
    begin = np.concatenate([first[:-2], [top, np.arctan2(-s, c)], rates[0], rates[1]])
    one, two = slice(count + 2, count + 2 + numbers), slice(count + 2 + numbers, None)

    def parts(values: Floats) -> tuple[Floats, Floats]:
        level = np.minimum(values[count] - passed @ values[one], HIGHEST)
        return np.exp(level), values[count + 1] + passed @ values[two]

    def off(values: Floats) -> Floats:
        size, angle = parts(values)
        return np.asarray(mean @ values[:count] + size * np.cos(angle) - y)

    def slopes(values: Floats) -> Floats:
        size, angle = parts(values)
        c, s = (size * np.cos(angle))[:, None], (-size * np.sin(angle))[:, None]
        return np.hstack([mean, c, s, -c * passed, s * passed])

    if y.size <= begin.size + 2:
        return None
    try:
        found: Any = least_squares(
            off, begin, slopes, method="lm", x_scale="jac", xtol=1e-13, ftol=1e-13, gtol=1e-13
        )
    except ValueError:
        return None
    jacobian = found.jac
    scale = np.linalg.norm(jacobian, axis=0)
    if not np.all(np.isfinite(found.x)) or np.any(scale == 0.0):
        return None
    inverse = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale), rcond=1e-12)
    inverse /= np.outer(scale, scale)
    level = found.x[count] - passed @ found.x[one]
    left = -found.fun
    told = _noise(left, band, count, 2 * numbers + 2)
    return _Fit(found.x, inverse, count, left, level, knots, *told)


def _noise(
    left: Floats, band: tuple[float, float], mean: int, numbers: int
) -> tuple[float, float, float, float, bool]:
    """Variance of a sample, its degrees of freedom, criteria in the band and in all, if white.

    What is left in a band about the frequency tells the variance where it is not white.
    """
    from scipy.stats import f

    n, numbers = left.size, mean + numbers
    square = float(np.sum(left**2))
    power = 2.0 * np.abs(np.fft.rfft(left)) ** 2 / n
    omega = 2.0 * np.pi * np.arange(power.size) / n
    inside = (omega > band[0]) & (omega < band[1])
    inside[0] = False
    known, within = 2 * int(np.count_nonzero(inside)), float(np.sum(power[inside]))
    whole = square / (n - numbers) + ROUNDING**2
    free, rest = known - numbers, n - known
    if free < FREE or rest < FREE:
        return whole, n - numbers, np.inf, _criterion(whole, n, numbers), True
    near, far = within / free + ROUNDING**2, max(square - within, 0.0) / rest + ROUNDING**2
    scores = _criterion(near, known, numbers), _criterion(whole, n, numbers)
    if float(f.sf(max(near / far, far / near), free, rest)) < ODDS:
        return near, free, *scores, False
    return whole, n - numbers, *scores, True


def _scores(fits: list[_Fit]) -> Floats:
    """Criterion of each fit: of all that is left where it is white, and else of the band."""
    scores = np.array([fit.whole if fits[-1].white else fit.near for fit in fits])
    scores[1:] += CONSTANT
    return scores


def _criterion(variance: float, count: int, numbers: int) -> float:
    """Akaike's corrected criterion of independent numbers whose variance is known."""
    spare = count - numbers - 2
    share = variance * (count - numbers) / count
    return count * float(np.log(share) + 2.0 * (numbers + 1) / spare) if spare > 0 else np.inf


def _floor(fit: _Fit) -> float:
    """Smallest log a that tells a rate."""
    omega = float(fit.rates(fit.level[:1])[1][0])
    cycle = max(2.0 * np.pi / omega, 2.0)
    noise = np.sqrt(2.0 * min(fit.variance, _quiet(fit.left)) / cycle)
    return max(float(np.log(VISIBLE * noise)), float(fit.level.max()) - 14.0)


def _quiet(left: Floats) -> float:
    """Variance of white noise in what is left, by the median of its spectrum."""
    window = np.hanning(left.size)
    power = np.abs(np.fft.rfft(window * left)) ** 2 / np.sum(window**2)
    return float(np.median(power)) / float(np.log(2.0)) + ROUNDING**2


def _knots(level: Floats, before: _Fit | None, numbers: int) -> Floats:
    """Ends and inner knots of the splines, between which the vibration tells equally much."""
    if before is None or numbers == 1:
        return np.array([level.min() - 1.0, level.max() + 1.0])
    low = max(_floor(before), float(level.min()))
    high = float(level.max())
    inner = max(0, numbers - 1 - _degree(numbers))
    seen = np.clip(level, low, high)
    weight = np.cumsum(np.exp(seen - high) * (level > low))
    at = np.interp(np.linspace(0.0, 1.0, inner + 2)[1:-1], weight / weight[-1], seen)
    return np.concatenate([[low], np.sort(at), [high]])


def _degree(numbers: int) -> int:
    return min(numbers - 1, 3)


def _basis(level: Floats, knots: Floats, numbers: int) -> Floats:
    """Splines of log a, (n, numbers), constant beyond the ends."""
    from scipy.interpolate import BSpline

    degree = _degree(numbers)
    if degree == 0:
        return np.ones((level.size, 1))
    ends = np.concatenate([[knots[0]] * degree, knots, [knots[-1]] * degree])
    seen = np.clip(level, knots[0], knots[-1])
    return np.asarray(BSpline.design_matrix(seen, ends, degree).toarray())


def _times(fit: _Fit) -> Floats:
    """Times in samples, two a cycle, as long as the vibration is seen."""
    omega = fit.rates(fit.level)[1]
    angle = np.cumsum(omega)
    seen = np.flatnonzero(fit.level >= _floor(fit))
    if seen.size == 0:
        return np.zeros(0)
    last = angle[seen[-1]]
    turns = np.arange(angle[0], last + 1e-9, np.pi)
    return np.interp(turns, angle, np.arange(angle.size))

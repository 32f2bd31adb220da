"""Beginning of a decaying vibration, and a first guess of its decay and frequency."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

DENSEST = 32.0  # samples of a period, beyond which neighbours are averaged
ZETAS = (0.0, 0.003, 0.01, 0.03, 0.1, 0.2, 0.35)  # of the guesses
FACTORS = (0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2)  # of a broad peak's frequency
SHARP = 0.05  # zeta of a narrow peak
PEAKS = 3  # of the spectrum, at which it starts
MOST = 4000  # samples of a first guess


def begins_at(y: Floats) -> int:
    """First sample of the decay: where a cycle is strongest, if the signal begins with less."""
    omega = _peaks(y)[0]
    length = max(3, round(2.0 * np.pi / omega))
    if y.size < 3 * length:
        return 0
    total = np.cumsum(np.concatenate([[0.0], (y - np.median(y)) ** 2]))
    power = total[length:] - total[:-length]
    return 0 if power[0] > 0.5 * power.max() else int(np.argmax(power))


def strongest(y: Floats) -> tuple[float, float, float] | None:
    """Strongest of many decaying vibrations: its power, decay and angular frequency per sample."""
    best, found = 0.0, None
    for peak in _peaks(y):
        merged = max(1, int(2.0 * np.pi / peak / DENSEST))
        z = y[: y.size // merged * merged].reshape(-1, merged).mean(axis=1)[:MOST]
        n = np.arange(z.size)
        total = float(np.sum((z - z.mean()) ** 2))
        for zeta in ZETAS:
            for factor in FACTORS if zeta > SHARP else (1.0,):
                omega = factor * peak * merged
                if omega >= np.pi:
                    continue
                size = np.exp(-zeta * omega * n)
                columns = [size * np.cos(omega * n), size * np.sin(omega * n), np.ones(n.size), n]
                given = np.stack(columns, axis=1)
                values = np.linalg.lstsq(given, z, rcond=None)[0]
                power = merged * (total - float(np.sum((z - given @ values) ** 2)))
                if power > best:
                    best, found = power, (power, zeta * omega / merged, omega / merged)
    return found


def _peaks(y: Floats) -> list[float]:
    """Angular frequencies per sample of the highest peaks of the spectrum, the highest first."""
    count = 4 * y.size
    y = y - np.polynomial.Polynomial.fit(np.arange(y.size), y, 1)(np.arange(y.size))
    power = np.abs(np.fft.rfft(y, count)) ** 2
    power += np.abs(np.fft.rfft(y * np.hanning(y.size), count)) ** 2
    power[:3] = 0.0
    tops = 1 + np.flatnonzero((power[1:-1] > power[:-2]) & (power[1:-1] >= power[2:]))
    tops = tops if tops.size else np.array([max(int(np.argmax(power)), 1)])
    order = np.argsort(-power[tops])[:PEAKS]
    return [2.0 * np.pi * float(top) / count for top in tops[order]]

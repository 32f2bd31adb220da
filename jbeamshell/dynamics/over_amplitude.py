"""Frequency and damping of a vibration over its amplitude, and the curves that fits take."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import require
from jbeamshell.measured.curves import (
    DampingCurve,
    DissipationCurve,
    FrequencyCurve,
    StiffnessCurve,
)

Floats = NDArray[np.float64]

FEWEST = 4  # points of a bin that tell its scatter
DEGREE = 3  # of the frequency over the logarithm of the amplitude, for its slope
TELLING = 0.02  # difference of the damping of steady cycles that is printed
TWO_SIGMA = 1.96  # half width of a 95 % interval over the standard error


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class RingDown:
    """Frequency and damping over the amplitude of a decaying vibration, (k,) each.

    Attributes
    ----------
    time : times
    amplitude : half of a swing
    frequency : cycles per time, as they pass; see `omega` for the undamped one
    damping : damping ratio zeta of the decay; the logarithmic decrement is
        2 pi zeta/sqrt(1 - zeta^2) per cycle
    frequency_interval, damping_interval : (k, 2) ends of 95 % intervals; None where not known
    numbers : how many numbers of frequency and of damping the data told; 1 if neither depends on
        the amplitude as far as the data tell, 0 if each point is measured by itself
    method : that was used, see `ring_down`
    doubts : sentences that say what may be wrong, and what to change
    """

    time: Floats
    amplitude: Floats
    frequency: Floats
    damping: Floats
    frequency_interval: Floats | None = None
    damping_interval: Floats | None = None
    numbers: int = 0
    method: str = ""
    doubts: tuple[str, ...] = ()

    @property
    def omega(self) -> Floats:
        """Undamped angular frequency (k,), 2 pi frequency/sqrt(1 - zeta^2)."""
        return 2.0 * np.pi * self.frequency / np.sqrt(1.0 - self.damping**2)

    @property
    def steady_damping(self) -> Floats:
        """Damping ratio (k,) of steady vibration, if friction is what softens the joint.

        A swing of a decay begins on the branch of the swing before, from a turn of larger force.
        To first order of Masing's rule, for any backbone, zeta of a steady cycle is that of the
        decay times 1 + d log omega^2/d log a.
        """
        if self.numbers == 1 or self.amplitude.size < 2 * FEWEST:
            return self.damping
        size = np.log(self.amplitude)
        line = np.polynomial.Polynomial.fit(size, 2.0 * np.log(self.omega), DEGREE)
        return self.damping * (1.0 + np.clip(line.deriv()(size), -1.0, 0.0))

    @property
    def omega_interval(self) -> Floats | None:
        """Ends of the 95 % intervals of `omega`, (k, 2); None where not known."""
        if self.frequency_interval is None or self.damping_interval is None:
            return None
        off, spread = (
            0.5 * (ends[:, 1] - ends[:, 0])
            for ends in (self.frequency_interval, self.damping_interval)
        )
        part = np.hypot(off / self.frequency, self.damping * spread / (1.0 - self.damping**2))
        return self.omega[:, None] * (1.0 + part[:, None] * np.array([-1.0, 1.0]))

    def part(self, inside: NDArray[np.bool_] | slice) -> RingDown:
        """Points that a mask (k,) or a slice picks."""
        kept: dict[str, Any] = {
            name: column[inside]
            for name, column in vars(self).items()
            if isinstance(column, np.ndarray)
        }
        return dataclasses.replace(self, **kept)

    def __repr__(self) -> str:
        """Frequency and damping with the half widths of their intervals, and the doubts."""
        if not np.size(self.time):
            return "ring-down without points"
        rows = range(1) if self.numbers == 1 else (0, self.time.size // 2, self.time.size - 1)
        lines = [f"ring-down by {self.method}" if self.method else "ring-down"]
        columns = {
            "frequency": (self.frequency, self.frequency_interval),
            "omega": (self.omega, self.omega_interval),
            "zeta": (self.damping, self.damping_interval),
        }
        for row in dict.fromkeys(rows):
            words = [
                f"{name} {column[row]:.6g}"
                + (f" +- {0.5 * np.ptp(ends[row]):.2g}" if ends is not None else "")
                for name, (column, ends) in columns.items()
            ]
            if abs(self.steady_damping[row] - self.damping[row]) > TELLING * self.damping[row]:
                words.append(f"{self.steady_damping[row]:.3g} in steady cycles of friction")
            where = "" if self.numbers == 1 else f"amplitude {self.amplitude[row]:.4g}: "
            lines.append(f"  {where}{', '.join(words)}")
        if self.numbers == 1:
            reach = f"{self.amplitude[0]:.4g} to {self.amplitude[-1]:.4g}"
            lines.append(f"  at all amplitudes, {reach}, as far as the record tells")
        return "\n".join([*lines, *(f"doubtful: {doubt}" for doubt in self.doubts)])

    def curves(
        self, mass: float, points: int = 12, width: float = 1.0
    ) -> tuple[DissipationCurve, StiffnessCurve]:
        """Dissipation and stiffness of a strip from the ring-down of a mass on it.

        The mass balances the strip, so the amplitude of the force is F = m omega^2 u, and the
        energy per cycle is 2 pi zeta F u, with the `steady_damping`.

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
            for column in (self.frequency, self.steady_damping)
        )
        force = mass / width * (2.0 * np.pi * frequency) ** 2 * u
        loss = DissipationCurve(
            force, 2.0 * np.pi * damping * force * u, label="ring-down, damping"
        )
        return loss, StiffnessCurve(force, force / u, label="ring-down, frequency")

    def modal_curves(
        self, points: int = 20, *, low: float = 0.0, high: float = np.inf, label: str = "ring-down"
    ) -> tuple[FrequencyCurve, DampingCurve]:
        """Frequency and steady damping of a structure over the amplitude, with their noise.

        Each point is the mean of a bin, evenly wide in the logarithm of the amplitude.  Its noise
        is that of the fitted rates, shared among the bins, if they were fitted.  Otherwise it is
        that of the mean: the scatter about a straight line in the bin, over the root of its
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
        size, steady, bins = np.log(self.amplitude[kept]), self.steady_damping[kept], []
        fix = "leaves no vibration: take wider bounds"
        require("low, high", (low, high), size.size >= FEWEST, fix)
        edges = np.linspace(size.min(), size.max() + 1e-9, points + 1)
        for place in range(points):
            inside = (size >= edges[place]) & (size < edges[place + 1])
            if np.count_nonzero(inside) < FEWEST:
                continue
            columns = (self.frequency[kept][inside], steady[inside])
            means = [_mean_and_noise(size[inside], column) for column in columns]
            if means[1][0] > 0.0:
                bins.append((np.exp(np.mean(size[inside])), *means[0], *means[1]))
        fix = "has no bin that decays: take fewer points, or more of the vibration"
        require("points", points, len(bins) > 1, fix)
        u, frequency, scatter, damping, spread = np.array(bins).T
        if self.numbers and self.frequency_interval is not None:
            scatter, spread = self._noise_of_bins(np.log(u))
        return (
            FrequencyCurve(u, frequency, label=f"{label}, frequency", noise=scatter),
            DampingCurve(u, damping, label=f"{label}, damping", noise=spread),
        )

    def _noise_of_bins(self, size: Floats) -> list[Floats]:
        """Standard errors at some log amplitudes, as if these were independent."""
        rising, more = np.argsort(self.amplitude), np.sqrt(max(1.0, size.size / self.numbers))
        known = np.log(self.amplitude[rising])
        return [
            more * np.interp(size, known, np.ptp(ends, axis=1)[rising]) / (2.0 * TWO_SIGMA)
            for ends in (self.frequency_interval, self.damping_interval)
            if ends is not None
        ]

    def plot(self, axes: Any = None) -> Any:
        """Draw frequency and damping over amplitude; see `jbeamshell.plotting.ring_down`."""
        from jbeamshell import plotting

        return plotting.ring_down(self, axes=axes)


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

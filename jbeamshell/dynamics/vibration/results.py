"""Results of harmonic balance: forced responses and nonlinear modes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import is_traced
from jbeamshell.common.errors import UnconvergedError
from jbeamshell.common.summary import Summary, ranged, with_unit
from jbeamshell.dynamics.structure.modal import summary_of_mode

PHASES = 720  # angles of a cycle at which largest values are looked for


class ForcedResponse(NamedTuple):
    """Steady responses of a structure along a curve of k points, in the order of the curve.

    Attributes
    ----------
    frequency : (k,) angular frequencies of the force
    level : (k,) factors of the force
    harmonic : (H,) numbers of the harmonics
    coefficients : (k, H, r) complex coefficients of the motion in ``basis``
    basis : (n, r) displacements of the degrees of freedom in it
    place : degree of freedom that `amplitude` and `phase` are of
    joints : (k, J) largest displacements of the elements
    dissipation : (k,) energy lost in the elements per cycle
    stable : (k,) True where small deviations do not grow
    folds : (f,) numbers of the points where frequency, or level, has an extremum
    truncation : (k,) displacement of the elements in the next harmonic, over that in the first
    """

    frequency: NDArray[np.float64]
    level: NDArray[np.float64]
    harmonic: NDArray[np.int64]
    coefficients: NDArray[np.complex128]
    basis: NDArray[np.float64]
    place: int
    joints: NDArray[np.float64]
    dissipation: NDArray[np.float64]
    stable: NDArray[np.bool_]
    folds: NDArray[np.int64]
    truncation: NDArray[np.float64]

    def at(self, place: int) -> NDArray[np.complex128]:
        """Complex amplitudes (k, H) of the harmonics of a degree of freedom.

        The displacement is the real part of sum_h a_h exp(i h omega t) under a force cos(omega t).
        """
        return np.asarray(self.coefficients @ self.basis[place])

    @property
    def harmonics(self) -> NDArray[np.float64]:
        """Amplitudes (k, H) of the harmonics at ``place``."""
        return np.abs(self.at(self.place))

    @property
    def amplitude(self) -> NDArray[np.float64]:
        """Amplitude (k,) of the first harmonic at ``place``."""
        return self.harmonics[:, 0]

    @property
    def phase(self) -> NDArray[np.float64]:
        """Phase (k,) of the first harmonic at ``place``, in radians; negative behind the force."""
        return np.angle(self.at(self.place)[:, 0])

    @property
    def peak(self) -> NDArray[np.float64]:
        """Largest displacement (k,) at ``place`` within a cycle."""
        return np.max(np.abs(over_a_cycle(self.at(self.place), self.harmonic)), axis=1)

    @property
    def summary(self) -> Summary:
        """Summary in a few lines."""
        top = int(np.argmax(self.amplitude))
        over = "level" if np.ptp(self.frequency) == 0.0 else "frequency"
        rows = [
            (over, ranged(getattr(self, over))),
            ("largest amplitude", f"{self.amplitude[top]:.4g} at {getattr(self, over)[top]:.4g}"),
            ("lost per cycle", f"{self.dissipation[top]:.4g} there"),
            ("joints", f"move by up to {np.max(self.joints, initial=0.0):.4g}"),
            ("left out", f"{np.max(self.truncation):.2g} of the first harmonic"),
        ]
        unstable = int(np.sum(~self.stable))
        notes = [f"{self.folds.size} folds, {unstable} unstable points"] if unstable else []
        title = f"forced response at degree of freedom {self.place}, {self.level.size} points"
        return Summary(title, rows, notes)

    def __str__(self) -> str:
        return self.summary.as_text()

    def __repr__(self) -> str:
        return self.summary.as_text()

    def plot(self, axes: Any = None) -> Any:
        """Draw amplitude and harmonics; see `jbeamshell.plotting.forced_response`."""
        from jbeamshell import plotting

        return plotting.forced_response(self, axes=axes)


class StalledContinuationError(UnconvergedError):
    """Continuation that ended before its range; ``response`` is the part that was found."""

    def __init__(self, message: str, response: ForcedResponse) -> None:
        super().__init__(message)
        self.response = response


class NonlinearMode(NamedTuple):
    """Frequency and damping of a mode over its amplitude, by harmonic balance, k points.

    Attributes
    ----------
    amplitude : (k,) modal displacement q of the first harmonic
    frequency : (k,) angular frequency
    damping : (k,) damping ratio, of joints and structure
    dissipation : (k,) energy lost in the elements per cycle
    joints : (k, J) largest displacements of the elements
    harmonic : (H,) numbers of the harmonics
    coefficients : (k, H, r) complex coefficients of the motion in ``basis``
    basis : (n, r) displacements of the degrees of freedom in it
    truncation : (k,) displacement of the elements in the next harmonic, over that in the first
    """

    amplitude: Any
    frequency: Any
    damping: Any
    dissipation: Any
    joints: Any
    harmonic: NDArray[np.int64]
    coefficients: Any
    basis: Any
    truncation: Any

    def at(self, place: int) -> Any:
        """Complex amplitudes (k, H) of the harmonics of a degree of freedom."""
        return self.coefficients @ self.basis[place]

    def __str__(self) -> str:
        return summary_of_mode("nonlinear mode, by harmonic balance", self).as_text()

    def __repr__(self) -> str:
        return str(self)

    def plot(self, axes: Any = None) -> Any:
        """Draw frequency and damping over amplitude; see `jbeamshell.plotting.modal_curve`."""
        from jbeamshell import plotting

        return plotting.modal_curve(self, axes=axes, label="harmonic balance")


class SteadyResponse(NamedTuple):
    """Steady responses at k frequencies, which may be traced.

    Attributes
    ----------
    frequency : (k,) angular frequencies of the force
    amplitude, phase : (k,) of the first harmonic at one degree of freedom
    harmonics : (k, H) complex amplitudes there
    coefficients : (k, H, r) complex coefficients of the motion in ``basis``
    basis : (n, r) displacements of the degrees of freedom in it
    truncation : (k,) displacement of the elements in the next harmonic, over that in the first
    """

    frequency: Any
    amplitude: Any
    phase: Any
    harmonics: Any
    coefficients: Any
    basis: Any
    truncation: Any

    def __str__(self) -> str:
        if is_traced(self):
            return "steady response, traced"
        rows = [
            ("frequency", ranged(np.asarray(self.frequency))),
            ("amplitude", ranged(np.asarray(self.amplitude))),
            ("left out", f"{with_unit(float(np.max(self.truncation)))} of the first harmonic"),
        ]
        return Summary(f"steady response at {len(self.frequency)} frequencies", rows).as_text()

    def __repr__(self) -> str:
        return str(self)


def over_a_cycle(coefficients: Any, harmonic: Any, xp: Any = np) -> Any:
    """Displacements (k, PHASES, ...) within a cycle from coefficients (k, H, ...).

    ``xp`` is NumPy, or JAX for traced coefficients.
    """
    angle = 2.0 * np.pi * np.arange(PHASES) / PHASES
    table = np.exp(1j * np.outer(angle, harmonic))
    return xp.real(xp.einsum("ph,kh...->kp...", table, coefficients))

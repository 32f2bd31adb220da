"""Results of harmonic balance: forced responses and nonlinear modes."""

from __future__ import annotations

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import is_traced
from jbeamshell.common.summary import Summary, ranged
from jbeamshell.dynamics.frequencies import OverAmplitude, OverFrequency

DOUBTED = 1e-3  # displacement in the next harmonic over that in the first
WRONG = 2.5e-3  # relative error that this may make at a resonance; measured .2 to 1.6 times it
PHASES = 720  # angles of a cycle at which largest values are looked for


class Balanced(OverFrequency):
    """Motions (k,) of harmonics that are in balance; see `ForcedResponse`."""

    told: ClassVar[str] = "the amplitude"  # what a harmonic that is left out changes

    harmonics: NDArray[np.int64]
    coefficients: Any
    basis: Any
    joints: Any
    dissipation: Any
    truncation: Any
    truncation_error: Any

    def at(self, place: int) -> Any:
        """Complex amplitudes (k, H) of the harmonics of a degree of freedom.

        The displacement is the real part of sum_h a_h exp(i h omega t) under a force cos(omega t).
        """
        return self.coefficients @ self.basis[place]

    @property
    def doubts(self) -> tuple[str, ...]:
        """Sentence that says how large the harmonic is that is left out; none if it is small."""
        most, error = (
            float(np.max(np.asarray(column), initial=0.0))
            for column in (self.truncation, self.truncation_error)
        )
        if most <= DOUBTED and error <= WRONG:
            return ()
        return (
            f"harmonic {self.harmonics[-1] + 2}, which is left out, moves the joints by "
            f"{most:.2g} of the first one, which may change {self.told} by {100.0 * error:.1g} %: "
            "give more harmonics",
        )


class ForcedResponse(Balanced):
    """Steady responses of a structure at k frequencies, which may be traced.

    Attributes
    ----------
    place : degree of freedom that `amplitude` and `phase` are of
    frequency : (k,) of the force, cycles per time; see `omega`
    harmonics : (H,) their numbers
    coefficients : (k, H, r) complex coefficients of the motion in ``basis``
    basis : (n, r) displacements of the degrees of freedom in it
    joints : (k, J) largest displacements of the joints
    dissipation : (k,) energy lost in the joints per cycle
    truncation : (k,) displacement of the joints in the next harmonic, over that in the first
    truncation_error : (k,) estimated relative error of the amplitude by what is left out, times the
        elastic force over the driving one, as a resonance amplifies it
    """

    place: int

    @property
    def harmonic_amplitudes(self) -> Any:
        """Amplitudes (k, H) of the harmonics at ``place``."""
        return abs(self.at(self.place))

    @property
    def amplitude(self) -> Any:
        """Amplitude (k,) of the first harmonic at ``place``."""
        return self.harmonic_amplitudes[:, 0]

    @property
    def phase(self) -> Any:
        """Phase (k,) of the first harmonic at ``place``, in radians; negative behind the force."""
        first = self.at(self.place)[:, 0]
        return jnp.angle(first) if is_traced(first) else np.angle(first)

    def __str__(self) -> str:
        if is_traced(self):
            return "forced response, traced"
        top = int(np.argmax(self.amplitude))
        rows = [
            ("frequency", ranged(np.asarray(self.frequency))),
            ("largest amplitude", f"{self.amplitude[top]:.4g} at {self.frequency[top]:.4g}"),
            ("lost per cycle", f"{self.dissipation[top]:.4g} there"),
            ("joints", f"move by up to {np.max(self.joints, initial=0.0):.4g}"),
            ("left out", f"{np.max(self.truncation):.2g} of the first harmonic"),
        ]
        title = (
            f"forced response at degree of freedom {self.place}, {np.size(self.frequency)} points"
        )
        return Summary(title, rows, [f"doubtful: {doubt}" for doubt in self.doubts]).as_text()

    def __repr__(self) -> str:
        return str(self)

    def plot(self, axes: Any = None) -> Any:
        """Draw amplitude and harmonics; see `jbeamshell.plotting.forced_response`."""
        from jbeamshell import plotting

        return plotting.forced_response(self, axes=axes)


class NonlinearMode(Balanced, OverAmplitude):
    """Frequency and damping of a mode over its amplitude, by harmonic balance, k points.

    Attributes
    ----------
    amplitude : (k,) modal displacement q of the first harmonic
    frequency, damping, dissipation, joints : see `ModalCurve`
    harmonics, coefficients, basis, truncation : see `ForcedResponse`
    truncation_error : (k,) the same of the damping
    """

    told: ClassVar[str] = "the damping"
    title = "nonlinear mode, by harmonic balance"
    label = "harmonic balance"


def over_a_cycle(coefficients: Any, harmonics: Any, xp: Any = np) -> Any:
    """Displacements (k, PHASES, ...) within a cycle from coefficients (k, H, ...).

    ``xp`` is NumPy, or JAX for traced coefficients.
    """
    angle = 2.0 * np.pi * np.arange(PHASES) / PHASES
    table = np.exp(1j * np.outer(angle, harmonics))
    return xp.real(xp.einsum("ph,kh...->kp...", table, coefficients))

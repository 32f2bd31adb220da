"""What tests leave behind, besides a `Loop`: curves that a model can be compared with.

Every curve may carry its noise, the standard deviation of what the model answers, in that column's
units: one number or one for each point; and a weight by which its residuals are multiplied.
"""

from __future__ import annotations

import abc
from typing import Any

import equinox as eqx
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jbeamshell.common.checks import shown
from jbeamshell.common.errors import InputError
from jbeamshell.measured.loops import Loop
from jbeamshell.measured.recordings import FEWEST_POINTS, HUGE, as_column

FEWEST_OF_BACKBONE = 3


class Curve(eqx.Module):
    """A measurement with noise and weight.

    Attributes
    ----------
    label : for pictures and messages
    noise : (points,) standard deviations; None where they are not known
    weight : factor of its residuals among those of other measurements
    """

    label: eqx.AbstractVar[str]
    noise: eqx.AbstractVar[NDArray[np.float64] | None]
    weight: eqx.AbstractVar[float]

    @abc.abstractmethod
    def response(self, control: str) -> str:
        """Name of the column that the model answers."""

    def _check(self, fewest: int, **columns: NDArray[np.float64]) -> None:
        """Columns of pairs, all finite; and what goes with them."""
        (one, x), (other, y) = columns.items()
        for name, column in columns.items():
            if column.ndim != 1 or column.size < fewest:
                fix = f"give {fewest} point{'s' * (fewest > 1)} or more"
                raise InputError(f"{self.label}: {name} has shape {column.shape}: {fix}")
            bad = np.flatnonzero(~(np.abs(column) <= HUGE))
            if bad.size:
                raise InputError(
                    f"{self.label}: {name} is {column[bad[0]]} at point {bad[0] + 1}: remove or "
                    "repair it"
                )
        if x.size != y.size:
            raise InputError(
                f"{self.label}: {one} and {other} have {x.size} and {y.size} points: give pairs"
            )
        check_noise(self.label, self.noise, x.size)
        if not (np.isfinite(self.weight) and self.weight > 0.0):
            raise InputError(f"{self.label}: weight = {self.weight}: must be a positive number")


class SqueezeCurve(Curve):
    """Mean of sigma_y over the height along a strip under its pressures, before any end load.

    Attributes
    ----------
    x : (points,) increasing positions X
    stress : (points,) mean of sigma_y over the height, compression negative
    label, noise, weight : see `Curve`
    """

    x: NDArray[np.float64]
    stress: NDArray[np.float64]
    label: str = eqx.field(static=True)
    noise: NDArray[np.float64] | None
    weight: float = eqx.field(static=True)

    def __init__(
        self,
        x: ArrayLike,
        stress: ArrayLike,
        label: str = "squeeze",
        noise: ArrayLike | None = None,
        weight: float = 1.0,
    ) -> None:
        self.x, self.stress = as_column(x, "x", label), as_column(stress, "stress", label)
        self.label, self.weight = label, _weight(weight, label)
        self.noise = _noise(noise, self.x, label)

    def __check_init__(self) -> None:
        self._check(FEWEST_POINTS, x=self.x, stress=self.stress)
        back = np.flatnonzero(np.diff(self.x) <= 0.0)
        if back.size:
            before, after = self.x[back[0] : back[0] + 2]
            raise InputError(
                f"{self.label}: x goes from {before:g} to {after:g} at point {back[0] + 2}: it "
                "must increase; sort the points and keep one of each position"
            )
        if np.ptp(self.stress) == 0.0:
            raise InputError(
                f"{self.label}: stress is constant ({self.stress[0]:g}): measure over an edge of "
                "the pressure, where it changes"
            )
        strongest = self.stress[np.argmax(np.abs(self.stress))]
        if strongest > 0.0:
            raise InputError(
                f"{self.label}: stress is mostly tension (up to {strongest:g}): compression is "
                "negative; change the sign"
            )

    def response(self, control: str) -> str:
        """The stress, whatever drives."""
        return "stress"

    def between(self, low: float, high: float) -> SqueezeCurve:
        """The part of the curve with low < x < high."""
        inside = (self.x > low) & (self.x < high)
        noise = None if self.noise is None else self.noise[inside]
        return SqueezeCurve(self.x[inside], self.stress[inside], self.label, noise, self.weight)


class Backbone(Curve):
    """The first loading from rest, up or down, without a reversal.

    Attributes
    ----------
    force : (points,) per unit width
    displacement : (points,) of the loaded end since the pressure
    label, noise, weight : see `Curve`; the noise is that of the column that does not drive
    """

    force: NDArray[np.float64]
    displacement: NDArray[np.float64]
    label: str = eqx.field(static=True)
    noise: NDArray[np.float64] | None
    weight: float = eqx.field(static=True)

    def __init__(
        self,
        force: ArrayLike,
        displacement: ArrayLike,
        label: str = "backbone",
        noise: ArrayLike | None = None,
        weight: float = 1.0,
    ) -> None:
        self.force = as_column(force, "force", label)
        self.displacement = as_column(displacement, "displacement", label)
        self.label, self.weight = label, _weight(weight, label)
        self.noise = _noise(noise, self.force, label)

    def __check_init__(self) -> None:
        columns = {"force": self.force, "displacement": self.displacement}
        self._check(FEWEST_OF_BACKBONE, **columns)
        for name, column in columns.items():
            if np.ptp(column) == 0.0:
                raise InputError(f"{self.label}: {name} is constant ({column[0]:g}): no loading")

    def response(self, control: str) -> str:
        """The column that does not drive."""
        return "displacement" if control == "force" else "force"


class AmplitudeCurve(Curve):
    """A figure of the steady cycle against the amplitude of what drives the test."""

    amplitude: eqx.AbstractVar[NDArray[np.float64]]

    def _check_positive(self, **columns: NDArray[np.float64]) -> None:
        self._check(1, **columns)
        for name, column in columns.items():
            if np.any(column <= 0.0):
                at = int(np.argmax(column <= 0.0))
                raise InputError(
                    f"{self.label}: {name} is {column[at]:g} at point {at + 1}: it must be "
                    "positive; leave out what was not measured"
                )


class DissipationCurve(AmplitudeCurve):
    """Work dissipated per steady cycle against amplitude, compared by its logarithm.

    Attributes
    ----------
    amplitude : (points,) half the range of what drives
    dissipation : (points,) area of the loop, per unit width
    label, noise, weight : see `Curve`
    """

    amplitude: NDArray[np.float64]
    dissipation: NDArray[np.float64]
    label: str = eqx.field(static=True)
    noise: NDArray[np.float64] | None
    weight: float = eqx.field(static=True)

    def __init__(
        self,
        amplitude: ArrayLike,
        dissipation: ArrayLike,
        label: str = "dissipation",
        noise: ArrayLike | None = None,
        weight: float = 1.0,
    ) -> None:
        self.amplitude = as_column(amplitude, "amplitude", label)
        self.dissipation = as_column(dissipation, "dissipation", label)
        self.label, self.weight = label, _weight(weight, label)
        self.noise = _noise(noise, self.amplitude, label)

    def __check_init__(self) -> None:
        self._check_positive(amplitude=self.amplitude, dissipation=self.dissipation)

    def response(self, control: str) -> str:
        """The dissipation, whatever drives."""
        return "dissipation"


class StiffnessCurve(AmplitudeCurve):
    """Secant stiffness of the steady cycle against amplitude, compared by its logarithm.

    Attributes
    ----------
    amplitude : (points,) half the range of what drives
    stiffness : (points,) range of force over range of displacement, per unit width
    label, noise, weight : see `Curve`
    """

    amplitude: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    label: str = eqx.field(static=True)
    noise: NDArray[np.float64] | None
    weight: float = eqx.field(static=True)

    def __init__(
        self,
        amplitude: ArrayLike,
        stiffness: ArrayLike,
        label: str = "stiffness",
        noise: ArrayLike | None = None,
        weight: float = 1.0,
    ) -> None:
        self.amplitude = as_column(amplitude, "amplitude", label)
        self.stiffness = as_column(stiffness, "stiffness", label)
        self.label, self.weight = label, _weight(weight, label)
        self.noise = _noise(noise, self.amplitude, label)

    def __check_init__(self) -> None:
        self._check_positive(amplitude=self.amplitude, stiffness=self.stiffness)

    def response(self, control: str) -> str:
        """The stiffness, whatever drives."""
        return "stiffness"


Measurement = Loop | Curve


def response_of(measurement: Measurement, control: str) -> str:
    """Name of the measurement's column that the model answers."""
    if isinstance(measurement, Loop):
        return "displacement" if control == "force" else "force"
    return measurement.response(control)


def noise_of(measurement: Measurement) -> NDArray[np.float64] | None:
    """Standard deviations (points,) of the column that the model answers, where they are known.

    Those of a mean of several cycles are smaller than the noise of one.
    """
    if isinstance(measurement, Curve):
        return measurement.noise
    error = measurement.standard_error
    if error is None and measurement.noise is not None:
        error = measurement.noise / np.sqrt(measurement.cycles)
    noise = _noise(error, measurement.force)
    check_noise(measurement.label, noise, measurement.force.size)
    return noise


def weight_of(measurement: Measurement) -> float:
    """Factor of the measurement's residuals; a loop counts once."""
    return measurement.weight if isinstance(measurement, Curve) else 1.0


def check_noise(label: str, noise: NDArray[np.float64] | None, points: int) -> None:
    """Raise `InputError` unless the noise is positive, and one number or one for each point."""
    if noise is None:
        return
    if noise.shape != (points,):
        fix = f"give one number, or one for each of the {points} points"
        raise InputError(f"{label}: noise has shape {noise.shape}: {fix}")
    bad = np.flatnonzero(~(np.isfinite(noise) & (noise > 0.0)))
    if bad.size:
        raise InputError(
            f"{label}: noise is {noise[bad[0]]:g} at point {bad[0] + 1}: give a positive standard "
            "deviation, or none at all"
        )


def _weight(weight: Any, label: str) -> float:
    number = isinstance(weight, int | float | np.floating | np.integer)
    if number and not isinstance(weight, bool) and abs(weight) <= HUGE:
        return float(weight)
    raise InputError(f"{label}: weight = {shown(weight)}: must be a positive number")


def _noise(
    noise: Any, column: NDArray[np.float64], label: str = "noise"
) -> NDArray[np.float64] | None:
    if noise is None:
        return None
    values = as_column(noise, "noise", label)
    return np.full(column.shape, float(values)) if values.ndim == 0 else values

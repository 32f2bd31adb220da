"""Measured curves that a model can be compared with, besides a `Loop`.

Every curve may carry its noise, the standard deviation of the column that the model answers, in
that column's units: one number, or one for each point. Its weight multiplies its residuals.

A new kind of curve is a class with two columns and a `Form`; its entry in `CURVES` lets it be
read from files.
"""

from __future__ import annotations

import abc
import dataclasses
from typing import TYPE_CHECKING, Any, ClassVar

import equinox as eqx
import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import shown
from jbeamshell.common.errors import InputError
from jbeamshell.measured.form import (
    AMPLITUDE,
    DAMPING,
    DISSIPATION,
    FREQUENCY,
    HARMONIC_FORCE,
    LOOP,
    POSITION,
    SECANT_STIFFNESS,
    SQUEEZE_STRESS,
    Column,
    Form,
)
from jbeamshell.measured.loops import Loop
from jbeamshell.measured.recordings import FEWEST_POINTS, HUGE, as_column

ROUNDING = 1e-6  # of a column's range, below which cycles are the same numbers

Floats = NDArray[np.float64]


class Curve(eqx.Module):
    """Measured curve: two columns of one length, their noise and weight.

    Attributes
    ----------
    form : names, labels and units of its columns, the same for all curves of a class
    fewest : fewest points that a curve of the class may have
    label : name in pictures and messages
    noise : (points,) standard deviations; None where they are not known
    weight : factor of its residuals among those of other measurements
    """

    form: ClassVar[Form]
    fewest: ClassVar[int] = 1

    @property
    @abc.abstractmethod
    def label(self) -> str: ...
    @property
    @abc.abstractmethod
    def noise(self) -> Floats | None: ...
    @property
    @abc.abstractmethod
    def weight(self) -> float: ...

    def __post_init__(self) -> None:
        """Keep columns as arrays, the noise as one of their length."""
        names = [field.name for field in dataclasses.fields(self)]
        kept: dict[str, Any] = {
            name: as_column(getattr(self, name), name, self.label)
            for name in names
            if name not in ("label", "noise", "weight")
        }
        first = next(iter(kept.values()))
        kept["noise"] = _noise(self.noise, first, self.label)
        kept["weight"] = _weight(self.weight, self.label)
        for name, value in kept.items():
            setattr(self, name, value)

    def __check_init__(self) -> None:
        columns = {name: getattr(self, name) for name in self.form.columns}
        for name, column in columns.items():
            if column.ndim != 1 or column.size < self.fewest:
                fix = f"give {self.fewest} point{'s' * (self.fewest > 1)} or more"
                raise InputError(f"{self.label}: {name} has shape {column.shape}: {fix}")
            bad = np.flatnonzero(~(np.abs(column) <= HUGE))
            if bad.size:
                raise InputError(
                    f"{self.label}: {name} is {column[bad[0]]} at point {bad[0] + 1}: remove or "
                    "repair it"
                )
        (one, x), (other, y) = columns.items()
        if x.size != y.size:
            raise InputError(
                f"{self.label}: {one} and {other} have {x.size} and {y.size} points: give pairs"
            )
        check_noise(self.label, self.noise, x.size)
        if not (np.isfinite(self.weight) and self.weight > 0.0):
            raise InputError(f"{self.label}: weight = {self.weight}: must be a positive number")
        self._check_columns(columns)

    def _check_columns(self, columns: dict[str, Floats]) -> None:
        """Raise `InputError` for numbers that a curve of this kind cannot have."""


class SqueezeCurve(Curve):
    """Mean of sigma_y over the height along a strip under its pressures, before any end load.

    Attributes
    ----------
    x : (points,) positions X, increasing
    stress : (points,) mean of sigma_y over the height, compression negative
    label, noise, weight : see `Curve`
    """

    form = Form("squeeze", {"x": POSITION, "stress": SQUEEZE_STRESS}, "x", "stress", ("stress",))
    fewest = FEWEST_POINTS

    x: Floats
    stress: Floats
    label: str = eqx.field(static=True, default="squeeze")
    noise: Floats | None = None
    weight: float = eqx.field(static=True, default=1.0)

    def _check_columns(self, columns: dict[str, Floats]) -> None:
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

    def between(self, low: float, high: float) -> SqueezeCurve:
        """Part of the curve with low < x < high."""
        inside = (self.x > low) & (self.x < high)
        noise = None if self.noise is None else self.noise[inside]
        return dataclasses.replace(self, x=self.x[inside], stress=self.stress[inside], noise=noise)


class Backbone(Curve):
    """First loading from zero, up or down, without a reversal.

    Attributes
    ----------
    force : (points,) end force per unit width
    displacement : (points,) displacement of the loaded end since the pressure was applied
    label, noise, weight : see `Curve`; the noise is that of the column that does not drive
    """

    form = LOOP
    fewest = 3

    force: Floats
    displacement: Floats
    label: str = eqx.field(static=True, default="backbone")
    noise: Floats | None = None
    weight: float = eqx.field(static=True, default=1.0)

    def _check_columns(self, columns: dict[str, Floats]) -> None:
        for name, column in columns.items():
            if np.ptp(column) == 0.0:
                raise InputError(
                    f"{self.label}: {name} is constant ({column[0]:g}): no loading; give points "
                    "of a rising load"
                )


class AmplitudeCurve(Curve):
    """A figure of the steady cycle over its amplitude, compared by its logarithm."""

    if TYPE_CHECKING:  # a column of each kind, in its own place
        amplitude: Floats

    def _check_columns(self, columns: dict[str, Floats]) -> None:
        for name, column in columns.items():
            if np.any(column <= 0.0):
                at = int(np.argmax(column <= 0.0))
                raise InputError(
                    f"{self.label}: {name} is {column[at]:g} at point {at + 1}: it must be "
                    "positive; leave out what was not measured"
                )


def _over_amplitude(name: str, column: Column) -> Form:
    """Form of a figure over the amplitude."""
    columns = {"amplitude": AMPLITUDE, name: column}
    return Form(name, columns, "amplitude", name, (name,), scale="log")


class DissipationCurve(AmplitudeCurve):
    """Work dissipated per steady cycle over amplitude, compared by its logarithm.

    Attributes
    ----------
    amplitude : (points,) half the range of the column that drives
    dissipation : (points,) area of the loop, per unit width
    label, noise, weight : see `Curve`
    """

    form = _over_amplitude("dissipation", DISSIPATION)

    amplitude: Floats
    dissipation: Floats
    label: str = eqx.field(static=True, default="dissipation")
    noise: Floats | None = None
    weight: float = eqx.field(static=True, default=1.0)


class StiffnessCurve(AmplitudeCurve):
    """Secant stiffness of the steady cycle over amplitude, compared by its logarithm.

    Attributes
    ----------
    amplitude : (points,) half the range of the column that drives
    stiffness : (points,) range of the force over the range of the displacement, per unit width
    label, noise, weight : see `Curve`
    """

    form = _over_amplitude("stiffness", SECANT_STIFFNESS)

    amplitude: Floats
    stiffness: Floats
    label: str = eqx.field(static=True, default="stiffness")
    noise: Floats | None = None
    weight: float = eqx.field(static=True, default=1.0)


class FrequencyCurve(AmplitudeCurve):
    """Frequency of a mode of a structure over its amplitude, compared by its logarithm.

    Attributes
    ----------
    amplitude : (points,) amplitude of the displacement of one point of the structure
    frequency : (points,) cycles per time
    label, noise, weight : see `Curve`
    """

    form = _over_amplitude("frequency", FREQUENCY)

    amplitude: Floats
    frequency: Floats
    label: str = eqx.field(static=True, default="frequency")
    noise: Floats | None = None
    weight: float = eqx.field(static=True, default=1.0)


class DampingCurve(AmplitudeCurve):
    """Damping ratio of a mode of a structure over its amplitude, compared by its logarithm.

    Attributes
    ----------
    amplitude : (points,) amplitude of the displacement of one point of the structure
    damping : (points,) damping ratio
    label, noise, weight : see `Curve`
    """

    form = _over_amplitude("damping", DAMPING)

    amplitude: Floats
    damping: Floats
    label: str = eqx.field(static=True, default="damping")
    noise: Floats | None = None
    weight: float = eqx.field(static=True, default=1.0)


class ForcedCurve(AmplitudeCurve):
    """Steady response of a structure to a harmonic force near the resonance of one mode.

    The model answers the force that a measured amplitude needs at its frequency: it is one number
    where the response of a softening structure may be three.  It is compared by its logarithm.

    Attributes
    ----------
    frequency : (points,) cycles per time of the force
    force : (points,) its amplitude
    amplitude : (points,) amplitude of the displacement of one point of the structure
    label, noise, weight : see `Curve`; the noise is that of the force
    """

    form = Form(
        "forced",
        {"frequency": FREQUENCY, "force": HARMONIC_FORCE},
        "frequency",
        "force",
        ("force",),
        scale="log",
    )

    frequency: Floats
    force: Floats
    amplitude: Floats
    label: str = eqx.field(static=True, default="forced response")
    noise: Floats | None = None
    weight: float = eqx.field(static=True, default=1.0)

    def _check_columns(self, columns: dict[str, Floats]) -> None:
        super()._check_columns(columns | {"amplitude": self.amplitude})
        if self.amplitude.shape != self.force.shape:
            raise InputError(
                f"{self.label}: amplitude has shape {self.amplitude.shape}: give one for each of "
                f"the {self.force.size} forces"
            )


CURVES: dict[str, type[Curve]] = {
    kind.form.name: kind
    for kind in (DissipationCurve, StiffnessCurve, SqueezeCurve, FrequencyCurve, DampingCurve)
}
"""Kinds of curve that are read from files, by name."""

Measurement = Loop | Curve


def noise_of(measurement: Measurement) -> Floats | None:
    """Standard deviations (points,) of the column that the model answers; None if unknown.

    A loop that is the mean of several cycles has less noise than one cycle.
    """
    if isinstance(measurement, Curve):
        return measurement.noise
    error = measurement.standard_error
    if error is None and measurement.noise is not None:
        error = measurement.noise / np.sqrt(measurement.cycles)
    if measurement.scatter is not None and measurement.driver is not None:
        answer = getattr(measurement, LOOP.response(measurement.driver))
        if error is not None and error <= ROUNDING * np.ptp(answer):
            error = None  # copies of one cycle tell no noise
    noise = _noise(error, measurement.force)
    check_noise(measurement.label, noise, measurement.force.size)
    return noise


def weight_of(measurement: Measurement) -> float:
    """Factor of the measurement's residuals; 1 for a loop."""
    return measurement.weight if isinstance(measurement, Curve) else 1.0


def check_noise(label: str, noise: Floats | None, points: int) -> None:
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
    """Weight as a number."""
    number = isinstance(weight, int | float | np.floating | np.integer)
    if number and not isinstance(weight, bool) and abs(weight) <= HUGE:
        return float(weight)
    raise InputError(f"{label}: weight = {shown(weight)}: must be a positive number")


def _noise(noise: Any, column: Floats, label: str = "noise") -> Floats | None:
    """Noise as an array of the column's shape, if it is one number."""
    if noise is None:
        return None
    values = as_column(noise, "noise", label)
    return np.full(column.shape, float(values)) if values.ndim == 0 else values

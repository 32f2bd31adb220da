"""Measured curves that a model can be compared with, besides a `Loop`.

Every curve may carry its noise, the standard deviation of the column that the model answers, in
that column's units: one number, or one for each point.

A new kind of curve is a class with columns and a `Form`; its place in `KINDS` lets it be read from
files.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from jbeamshell.common.errors import InputError
from jbeamshell.measured.form import (
    AMPLITUDE,
    DAMPING,
    DISSIPATION,
    FEWEST_POINTS,
    FREQUENCY,
    HARMONIC_FORCE,
    HUGE,
    LOOP,
    POSITION,
    RESPONSE,
    SECANT_STIFFNESS,
    SQUEEZE_STRESS,
    Column,
    Floats,
    Form,
    Measurement,
    as_column,
    checked_noise,
)
from jbeamshell.measured.loops import Loop


@dataclasses.dataclass(frozen=True, eq=False)
class Curve(Measurement):
    """Measured curve: columns of one length, and their noise.

    Attributes
    ----------
    noise : (points,) standard deviations of the column that the model answers; None where they are
        not known
    label, weight : see `Measurement`

    Raises
    ------
    InputError
        for columns that are no arrays of one length, hold too few points or an infinite one
    """

    noise: Any = dataclasses.field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        columns = {
            name: as_column(getattr(self, name), name, self.label) for name in self.form.columns
        }
        for name, column in columns.items():
            if column.ndim != 1 or column.size < self.form.fewest:
                fix = f"give {self.form.fewest} point{'s' * (self.form.fewest > 1)} or more"
                raise InputError(f"{self.label}: {name} has shape {column.shape}: {fix}")
            bad = np.flatnonzero(~(np.abs(column) <= HUGE))
            if bad.size:
                raise InputError(
                    f"{self.label}: {name} is {column[bad[0]]} at point {bad[0] + 1}: remove or "
                    "repair it"
                )
        (one, x), *others = columns.items()
        for other, y in others:
            if x.size != y.size:
                raise InputError(
                    f"{self.label}: {one} and {other} have {x.size} and {y.size} points: give pairs"
                )
        kept = columns | {"noise": checked_noise(self.noise, x.size, self.label)}
        for name, value in kept.items():
            object.__setattr__(self, name, value)
        self._check_columns(columns)

    def _check_columns(self, columns: dict[str, Floats]) -> None:
        """Raise `InputError` for numbers that a curve of this kind cannot have."""

    @property
    def deviations(self) -> Floats | None:
        noise: Floats | None = self.noise
        return noise


@dataclasses.dataclass(frozen=True, eq=False)
class SqueezeCurve(Curve):
    """Mean of sigma_y over the height along a strip under its pressures, before any end load.

    Attributes
    ----------
    x : (points,) positions X, increasing
    stress : (points,) mean of sigma_y over the height, compression negative
    label, noise, weight : see `Curve`
    """

    kind = "squeeze"
    form = Form(
        kind,
        {"x": POSITION, "stress": SQUEEZE_STRESS},
        "x",
        "stress",
        ("stress",),
        fewest=FEWEST_POINTS,
    )

    x: Floats
    stress: Floats

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
        return self.but(x=self.x[inside], stress=self.stress[inside], noise=noise)


@dataclasses.dataclass(frozen=True, eq=False)
class Backbone(Curve):
    """First loading from zero, up or down, without a reversal.

    Attributes
    ----------
    force : (points,) end force per unit width
    displacement : (points,) displacement of the loaded end since the pressure was applied
    label, noise, weight : see `Curve`; the noise is that of the column that does not drive
    """

    kind = "backbone"
    form = LOOP

    force: Floats
    displacement: Floats

    def _check_columns(self, columns: dict[str, Floats]) -> None:
        for name, column in columns.items():
            if np.ptp(column) == 0.0:
                raise InputError(
                    f"{self.label}: {name} is constant ({column[0]:g}): no loading; give points "
                    "of a rising load"
                )


@dataclasses.dataclass(frozen=True, eq=False)
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


@dataclasses.dataclass(frozen=True, eq=False)
class DissipationCurve(AmplitudeCurve):
    """Work dissipated per steady cycle over amplitude, compared by its logarithm.

    Attributes
    ----------
    amplitude : (points,) half the range of the column that drives
    dissipation : (points,) area of the loop, per unit width
    label, noise, weight : see `Curve`
    """

    kind = "dissipation"
    form = _over_amplitude(kind, DISSIPATION)

    amplitude: Floats
    dissipation: Floats


@dataclasses.dataclass(frozen=True, eq=False)
class StiffnessCurve(AmplitudeCurve):
    """Secant stiffness of the steady cycle over amplitude, compared by its logarithm.

    Attributes
    ----------
    amplitude : (points,) half the range of the column that drives
    stiffness : (points,) range of the force over the range of the displacement, per unit width
    label, noise, weight : see `Curve`
    """

    kind = "stiffness"
    form = _over_amplitude(kind, SECANT_STIFFNESS)

    amplitude: Floats
    stiffness: Floats


@dataclasses.dataclass(frozen=True, eq=False)
class FrequencyCurve(AmplitudeCurve):
    """Frequency of a mode of a structure over its amplitude, compared by its logarithm.

    Attributes
    ----------
    amplitude : (points,) amplitude of the displacement of one point of the structure
    frequency : (points,) cycles per time
    label, noise, weight : see `Curve`
    """

    kind = "frequency"
    form = _over_amplitude(kind, FREQUENCY)

    amplitude: Floats
    frequency: Floats


@dataclasses.dataclass(frozen=True, eq=False)
class DampingCurve(AmplitudeCurve):
    """Damping ratio of a mode of a structure over its amplitude, compared by its logarithm.

    Attributes
    ----------
    amplitude : (points,) amplitude of the displacement of one point of the structure
    damping : (points,) damping ratio
    label, noise, weight : see `Curve`
    """

    kind = "damping"
    form = _over_amplitude(kind, DAMPING)

    amplitude: Floats
    damping: Floats


@dataclasses.dataclass(frozen=True, eq=False)
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

    kind = "forced"
    form = Form(
        kind,
        {"frequency": FREQUENCY, "force": HARMONIC_FORCE, "amplitude": RESPONSE},
        "frequency",
        "force",
        ("force",),
        scale="log",
    )

    frequency: Floats
    force: Floats
    amplitude: Floats


CURVES: dict[str, type[Curve]] = {
    each.kind: each
    for each in (
        *(DissipationCurve, StiffnessCurve, SqueezeCurve),
        *(FrequencyCurve, DampingCurve, ForcedCurve),
    )
}
"""Kinds of curve that are read from files, by name."""

KINDS: dict[str, type[Measurement]] = {"loop": Loop, "backbone": Backbone, **CURVES}
"""All kinds of measurement."""

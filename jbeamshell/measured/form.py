"""Measurements: what all have, and the form of their columns in pictures, tables and files."""

from __future__ import annotations

import abc
import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jbeamshell.common.checks import shown
from jbeamshell.common.errors import InputError

FEWEST_POINTS = 8
HUGE = 1e100  # squares and quotients of smaller numbers are finite
NUMBER = ("dimensionless",)

Floats = NDArray[np.float64]


class Column(NamedTuple):
    """A column of measured numbers.

    Attributes
    ----------
    label : label of an axis, with symbol and unit
    units : SI units to which a file's unit may be converted, forces per unit width; `NUMBER` for
        a pure number, whose column needs no unit
    totals : the same units where forces are those of a whole width; empty if there are none
    """

    label: str
    units: tuple[str, ...]
    totals: tuple[str, ...] = ()


class Form(NamedTuple):
    """Columns of one kind of measurement.

    Measurements of one form share a panel of a picture and a table of a report.

    Attributes
    ----------
    name : name of the table
    columns : columns by name, in the order of the table
    x, y : names of the columns drawn along and up
    answers : names of the columns that a model can answer
    scale : scale of both axes, "linear" or "log"; on "log", model and data are compared by their
        logarithms
    heading : heading of the table's first column, which holds the labels
    fewest : fewest points of a curve

    Examples
    --------
    >>> LOOP.response("force"), LOOP.response("displacement")
    ('displacement', 'force')
    """

    name: str
    columns: Mapping[str, Column]
    x: str
    y: str
    answers: tuple[str, ...]
    scale: str = "linear"
    heading: str = "curve"
    fewest: int = 1

    def response(self, control: str) -> str:
        """Name of the column that the model answers.

        Parameters
        ----------
        control : name of the column that drives the model, "force" or "displacement"
        """
        return next(name for name in self.answers if name != control)


FORCE = Column("$F$  [force/width]", ("N/m",), ("N",))
DISPLACEMENT = Column("$u(L)$  [length]", ("m",))
POSITION = Column("$X$  [length]", ("m",))
SQUEEZE_STRESS = Column(r"$\chi\,/\,2H$  [stress]", ("N/m^2",))
AMPLITUDE = Column("amplitude of $F$ or $u(L)$  [force/width or length]", ("N/m", "m"), ("N", "m"))
DISSIPATION = Column("$D$, work per cycle  [force]", ("J/m",), ("J",))
SECANT_STIFFNESS = Column("secant stiffness  [force/width/length]", ("N/m^2",), ("N/m",))
FREQUENCY = Column("frequency  [1/time]", ("Hz",))
DAMPING = Column(r"damping ratio $\zeta$", NUMBER)
RESPONSE = Column("amplitude of $u$  [length]", ("m",))
HARMONIC_FORCE = Column("amplitude of the force  [force]", ("N",))

LOOP = Form(
    "overlay",
    {"force": FORCE, "displacement": DISPLACEMENT},
    x="displacement",
    y="force",
    answers=("force", "displacement"),
    heading="loop",
    fewest=3,
)


@dataclasses.dataclass(frozen=True, eq=False)
class Measurement(abc.ABC):
    """Measured columns of one length that a model can be compared with.

    Attributes
    ----------
    form : names, labels and units of its columns, the same for all of a class
    kind : word for its class in files and plans of fits
    label : name in pictures and messages; its kind where none is given
    weight : factor of its residuals among those of other measurements

    Raises
    ------
    InputError
        for a weight that is no positive number
    """

    form: ClassVar[Form]
    kind: ClassVar[str]

    label: str = dataclasses.field(default="", kw_only=True)
    weight: float = dataclasses.field(default=1.0, kw_only=True)

    def __post_init__(self) -> None:
        object.__setattr__(self, "label", self.label or self.kind)
        number = isinstance(self.weight, int | float | np.number)
        if not (number and self.weight is not True and 0.0 < self.weight <= HUGE):
            raise InputError(
                f"{self.label}: weight = {shown(self.weight)}: must be a positive number"
            )

    @property
    def columns(self) -> list[Floats]:
        """Its columns (points,), in the order of its form."""
        return [getattr(self, name) for name in self.form.columns]

    @property
    @abc.abstractmethod
    def deviations(self) -> Floats | None:
        """Standard deviations (points,) of the column that a model answers; None if unknown."""

    def but(self, **values: Any) -> Self:
        """Copy with other values of some fields, which are neither converted nor checked."""
        copy = object.__new__(type(self))
        vars(copy).update(vars(self) | values)
        return copy


def by_form(measurements: Sequence[Any]) -> list[tuple[Form, list[int]]]:
    """Forms among some measurements, in the order of their first, with the places of each."""
    places: dict[str, list[int]] = {}
    for place, measurement in enumerate(measurements):
        places.setdefault(measurement.form.name, []).append(place)
    return [(measurements[some[0]].form, some) for some in places.values()]


def as_column(values: ArrayLike, name: str, label: str) -> NDArray[np.float64]:
    """Array of floats from real numbers, NaN for None and masked ones; raises `InputError` else."""
    try:
        if isinstance(values, np.ma.MaskedArray):
            values = np.ma.filled(values.astype(float), np.nan)
        given = np.asarray(values)
        if given.dtype.kind in "iufO":
            return given.astype(float)
    except (TypeError, ValueError, OverflowError):
        pass
    raise InputError(f"{label}: {name} is no array of numbers: give a list of numbers")


def checked_noise(noise: Any, points: int, label: str) -> Floats | None:
    """Standard deviations (points,) of one number or one for each point; None stays None.

    Raises
    ------
    InputError
        unless all are positive
    """
    if noise is None:
        return None
    values = as_column(noise, "noise", label)
    values = np.full(points, float(values)) if values.ndim == 0 else values
    if values.shape != (points,):
        fix = f"give one number, or one for each of the {points} points"
        raise InputError(f"{label}: noise has shape {values.shape}: {fix}")
    bad = np.flatnonzero(~(np.isfinite(values) & (values > 0.0)))
    if bad.size:
        raise InputError(
            f"{label}: noise is {values[bad[0]]:g} at point {bad[0] + 1}: give a positive standard "
            "deviation, or none at all"
        )
    return values

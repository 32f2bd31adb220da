"""Form of a measurement: its columns, and how they are drawn, tabulated and read from files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

NUMBER = ("dimensionless",)


class Column(NamedTuple):
    """A column of measured numbers.

    Attributes
    ----------
    label : label of an axis, with symbol and unit
    units : SI units to which a file's unit may be converted, forces per unit width; `NUMBER` for
        a pure number, whose column needs no unit
    """

    label: str
    units: tuple[str, ...]


class Form(NamedTuple):
    """Columns of one kind of measurement.

    Measurements of one form share a panel of a picture and a table of a report.

    Attributes
    ----------
    name : name of the table; of a curve also the name of its kind in plans of fits
    columns : both columns by name, in the order of the table
    x, y : names of the columns drawn along and up
    answers : names of the columns that a model can answer
    scale : scale of both axes, "linear" or "log"; on "log", model and data are compared by their
        logarithms
    heading : heading of the table's first column, which holds the labels

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

    def response(self, control: str) -> str:
        """Name of the column that the model answers.

        Parameters
        ----------
        control : name of the column that drives the model, "force" or "displacement"
        """
        return next(name for name in self.answers if name != control)


FORCE = Column("$F$  [force/width]", ("N/m",))
DISPLACEMENT = Column("$u(L)$  [length]", ("m",))
POSITION = Column("$X$  [length]", ("m",))
SQUEEZE_STRESS = Column(r"$\chi\,/\,2H$  [stress]", ("N/m^2",))
AMPLITUDE = Column("amplitude of $F$ or $u(L)$  [force/width or length]", ("N/m", "m"))
DISSIPATION = Column("$D$, work per cycle  [force]", ("J/m",))
SECANT_STIFFNESS = Column("secant stiffness  [force/width/length]", ("N/m^2",))
FREQUENCY = Column("frequency  [1/time]", ("Hz",))
DAMPING = Column(r"damping ratio $\zeta$", NUMBER)
HARMONIC_FORCE = Column("amplitude of the force  [force]", ("N",))

LOOP = Form(
    "overlay",
    {"force": FORCE, "displacement": DISPLACEMENT},
    x="displacement",
    y="force",
    answers=("force", "displacement"),
    heading="loop",
)


def by_form(measurements: Sequence[Any]) -> list[tuple[Form, list[int]]]:
    """Forms among some measurements, in the order of their first, with the places of each."""
    places: dict[str, list[int]] = {}
    for place, measurement in enumerate(measurements):
        places.setdefault(measurement.form.name, []).append(place)
    return [(measurements[some[0]].form, some) for some in places.values()]

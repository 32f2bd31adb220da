"""Element that leaves: sliders in parallel and a spring, and the words that every file says of it.

A slider is a spring of stiffness k_j that slips at the force phi_j; with the spring k_0 beside them
F = k_0 u + sum_j clip(f_j + k_j du, -phi_j, phi_j) (Jenkins 1962, Iwan 1966).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from jbeamshell.dynamics.four_parameters import FourParameters

NEGLIGIBLE = 1e-13  # stiffness of a slider that is left out, over that of all


@dataclasses.dataclass(frozen=True, eq=False)
class Element:
    """Numbers of a joint, and what they mean.

    Attributes
    ----------
    displacement, force : (k + 1,) points of the backbone
    stiffness : (k,) of the sliders
    limit : (k,) forces at which they slip
    spring : stiffness of the spring beside them
    width : width of the strip, with which forces are multiplied already
    asymmetry : largest difference of pull and push from the backbone, over the displacement
    capacity : force of gross slip; infinite if it is not known
    units : names of the units of displacement and force
    sides : (2, k + 1) displacements of pull and push at the forces; None if they do not differ
    model : four-parameter Iwan model of the same joint, for targets that have one
    """

    displacement: NDArray[np.float64]
    force: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    limit: NDArray[np.float64]
    spring: float
    width: float
    asymmetry: float
    capacity: float
    units: tuple[str, str]
    sides: NDArray[np.float64] | None = None
    model: FourParameters | None = None

    @property
    def sliders(self) -> list[tuple[float, float]]:
        """Stiffness and limit of each slider that is not negligible."""
        total = self.spring + float(np.sum(self.stiffness))
        kept = self.stiffness > NEGLIGIBLE * total
        return list(zip(self.stiffness[kept].tolist(), self.limit[kept].tolist(), strict=True))

    @property
    def slides(self) -> bool:
        """True if no spring remains at the last point, so that the force stays there."""
        return self.spring <= NEGLIGIBLE * float(np.sum(self.stiffness))

    @property
    def title(self) -> str:
        """First line of a file."""
        return (
            f"Joint of {len(self.sliders)} sliders in parallel with a spring (Iwan 1966), by "
            f"jbeamshell {version('jbeamshell')}."
        )

    @property
    def facts(self) -> list[str]:
        """Units, sign, width, range and asymmetry, a line each."""
        length, force = self.units
        reach, top = float(self.displacement[-1]), float(self.force[-1])
        beyond = "the joint slides at this force" if self.slides else "nothing is known"
        return [
            f"Units: u in {length}, F in {force}, stiffness in {force}/{length}.",
            f"Width: {self.width!r} {length}; forces are those of the whole width.",
            "Sign: positive in a pull.  F moves the end by u; -F acts on what pulls.",
            f"Range: |F| <= {top:.6g}, |u| <= {reach:.6g}; beyond, {beyond}.",
            f"Pull and push: this is their mean; each differs from it by up to "
            f"{100.0 * self.asymmetry:.2g} % of u at one F.",
        ]

    def comment(self, sign: str, more: Sequence[str]) -> str:
        """Title, facts and more lines, each behind a comment sign."""
        return "".join(f"{sign} {line}\n" for line in [self.title, *self.facts, *more])


def rows(pairs: list[tuple[float, float]]) -> str:
    """Python lines of a list of pairs, with all digits."""
    return "[\n" + "".join(f"    ({a!r}, {b!r}),\n" for a, b in pairs) + "]\n"

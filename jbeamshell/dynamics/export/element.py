"""Element that leaves: sliders in parallel and a spring, and the words that every file says of it.

A slider is a spring of stiffness k_j that slips at the force phi_j; with the spring k_0 beside them
F = k_0 u + sum_j clip(f_j + k_j du, -phi_j, phi_j) (Jenkins 1962, Iwan 1966).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

NEGLIGIBLE = 1e-13  # stiffness of a slider that is left out, over that of all


@dataclasses.dataclass(frozen=True, eq=False)
class Element:
    """Joint that leaves, in Python's numbers.

    Attributes
    ----------
    joint : the `jbeamshell.dynamics.Joint`
    units : names of the units of displacement and force
    """

    joint: Any
    units: tuple[str, str]

    @property
    def spring(self) -> float:
        """Stiffness of the spring beside the sliders."""
        return float(self.joint.spring)

    @property
    def reach(self) -> float:
        """Displacement at the last point of the backbone."""
        return float(self.joint.displacements[-1])

    @property
    def sliders(self) -> list[tuple[float, float]]:
        """Stiffness and limit of each slider that is not negligible."""
        stiffness, limit = (np.asarray(a, float) for a in (self.joint.springs, self.joint.limits))
        kept = stiffness > NEGLIGIBLE * float(self.joint.stiffness)
        return list(zip(stiffness[kept].tolist(), limit[kept].tolist(), strict=True))

    @property
    def slides(self) -> bool:
        """True if no spring remains at the last point, so that the force stays there."""
        return self.spring <= NEGLIGIBLE * (float(self.joint.stiffness) - self.spring)

    @property
    def title(self) -> str:
        """First line of a file."""
        return (
            f"Joint of {len(self.sliders)} sliders in parallel with a spring (Iwan 1966), by "
            f"jbeamshell {version('jbeamshell')}."
        )

    @property
    def facts(self) -> list[str]:
        """Units, sign, width, range, asymmetry and the mounting of a lap joint, a line each."""
        (length, force), joint = self.units, self.joint
        beyond = "the joint slides at this force" if self.slides else "nothing is known"
        top = f"{float(joint.forces[-1]):.6g}"
        facts = [
            f"Units: u in {length}, F in {force}, stiffness in {force}/{length}.",
            f"Width: {float(joint.width)!r} {length}; forces are those of the whole width.",
            "Sign: positive in a pull.  F moves the end by u; -F acts on what pulls.",
            f"Range: |F| <= {top}, |u| <= {self.reach:.6g}; beyond, {beyond}.",
            f"Pull and push: this is their mean; each differs from it by up to "
            f"{100.0 * float(joint.asymmetry):.2g} % of u at one F.",
        ]
        return [*facts, f"Mounting: {joint.mounting}."] if joint.mounting else facts

    def comment(self, sign: str, more: Sequence[str]) -> str:
        """Title, facts and more lines, each behind a comment sign."""
        return "".join(f"{sign} {line}\n" for line in [self.title, *self.facts, *more])


def rows(pairs: list[tuple[float, float]]) -> str:
    """Python lines of a list of pairs, with all digits."""
    return "[\n" + "".join(f"    ({a!r}, {b!r}),\n" for a, b in pairs) + "]\n"

"""Lap joint from the dimensions of a drawing, as the command line takes them."""

from __future__ import annotations

from typing import Any

from jbeamshell.history.history import History
from jbeamshell.scene.dimensions import dimensions_of
from jbeamshell.scene.scene import Scene
from jbeamshell.solving.sensitivity import Sensitivity, sensitivity
from jbeamshell.solving.solve import solve


class LapJoint:
    """Single or double lap joint of two plates, from dimensions with their units.

    Its scene is in SI, with a width: forces are in N, works in J, stiffnesses in N/m.

    Parameters
    ----------
    joint : "single-lap" or "double-lap"
    **dimensions : texts such as ``length="100 mm"``, by the names of
        `jbeamshell.scene.dimension_table`: length, thickness, width, modulus, bolts with torque (or
        pressure), force, friction, overhang, ...
    change : values of the scene by dotted key that override what follows from the dimensions

    Attributes
    ----------
    scene : the scene
    bolts : bolts in words
    scatter : half the range of the preloads over their mean
    notes : sentences on what was taken for granted

    Raises
    ------
    InputError
        for dimensions that are missing, impossible or without unit

    Examples
    --------
    >>> joint = jb.LapJoint(
    ...     "single-lap",
    ...     length="100 mm",
    ...     thickness="8 mm",
    ...     width="30 mm",
    ...     modulus="210 GPa",
    ...     overhang="100 mm",
    ...     bolts="2xM8@30mm,70mm",
    ...     torque="25 N m",
    ...     friction=0.2,
    ...     force="4 kN",
    ... )
    >>> history = joint.solve()
    >>> print(joint.sensitivity(history))
    """

    def __init__(
        self, joint: str = "single-lap", change: dict[str, Any] | None = None, **dimensions: Any
    ) -> None:
        known = dimensions_of({"joint": joint, **dimensions})
        self.bolts, self.scatter, self.notes = known.bolts, known.scatter, known.notes
        self.scene: Scene = Scene().replace(known.values | (change or {}))

    def solve(self, **options: Any) -> History:
        """History of its cycles; options are those of `jbeamshell.solve`."""
        return solve(self.scene, **options)

    def sensitivity(self, history: History | None = None) -> Sensitivity:
        """Slopes of its dissipation, and what the scatter of its bolts makes of it."""
        return sensitivity(history or self.scene, self.scatter)

    def __str__(self) -> str:
        return "\n".join([str(self.scene), *self.bolts, *self.notes])

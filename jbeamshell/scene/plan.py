"""Plan of a scene: the record of how it is solved."""

from __future__ import annotations

from typing import NamedTuple

from jbeamshell.mechanics.elements import (
    CONTACT_LINE_FAR_SIZE,
    FAR_SIZE,
    GROWTH,
    SMALL_GROWTH,
    TINY,
)
from jbeamshell.mechanics.kinematics import FIELDS
from jbeamshell.scene.sections import fields_of

LINE = "contact line"  # event by event, exact in time
STEPS = "load steps"  # Newton's method


class Plan(NamedTuple):
    """How a scene is solved.

    Attributes
    ----------
    section : name of the section, see `jbeamshell.scene.sections`
    kinematics : rotations, "exact" or "linear"
    engine : "contact line" or "load steps"
    lifts : True if the strip may lift off
    nodes : number of nodes along X
    end_size : smallest elements in units of H, before the number of nodes scales all of them; below
        1e-4 it serves the last node alone
    steps : load steps per half cycle
    """

    section: str
    kinematics: str
    engine: str
    lifts: bool
    nodes: int
    end_size: float
    steps: int

    @property
    def on_contact_line(self) -> bool:
        """True if the strip is solved on its contact line, exactly in time."""
        return self.engine == LINE

    @property
    def elastic(self) -> bool:
        """True for plane elasticity."""
        return self.section == "plane"

    @property
    def fields(self) -> tuple[str, ...]:
        """Fields of a section among v, w, beta and psi."""
        return fields_of(self.section, self.lifts)

    @property
    def active(self) -> tuple[int, ...]:
        """Positions of the active fields among v, w, beta and psi."""
        return tuple(FIELDS.index(f) for f in self.fields)

    @property
    def far_size(self) -> float:
        """Largest elements before the number of nodes scales all, over L."""
        return CONTACT_LINE_FAR_SIZE if self.on_contact_line else FAR_SIZE

    @property
    def small_growth(self) -> float:
        """Growth of elements below H/48: fast if the smallest ones serve the last node alone."""
        return SMALL_GROWTH if self.end_size < TINY else GROWTH

    def __str__(self) -> str:
        held = "" if self.lifts or self.section == "bar" else " held down"
        by = "on its contact line" if self.on_contact_line else "in load steps"
        return (
            f"section {self.section}{held} {by}, {self.kinematics} kinematics, {self.nodes} nodes"
        )

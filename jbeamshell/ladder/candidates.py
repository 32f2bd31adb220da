"""Candidates of `advise`: rungs, each with the grids and load paths that suit it."""

from __future__ import annotations

from typing import Any, NamedTuple

from jbeamshell.scene.choice import CONTACT_LINE


class Candidate(NamedTuple):
    """Rung with its resolution.

    Attributes
    ----------
    rung : name of the rung, see `jbeamshell.scene.rungs`
    nodes : number of nodes along X
    steps : load steps per half cycle
    """

    rung: str
    nodes: int
    steps: int

    @property
    def name(self) -> str:
        """Name of rung and resolution, such as "p3@81x10"."""
        return f"{self.rung}@{self.nodes}x{self.steps}"

    @property
    def section(self) -> str:
        """Rung with the same section: "squeeze" for "masing", "p3" for "condensed-p3"."""
        last = self.rung.rpartition("-")[2]
        return "squeeze" if last in ("masing", "pull") else last

    @property
    def on_contact_line(self) -> bool:
        """True for linear kinematics, exact in time: load steps make no error."""
        return self.rung == "plane" or self.rung.startswith("condensed-")

    @property
    def resolution(self) -> dict[str, Any]:
        """Dotted values of the grid and the load path."""
        if self.rung == "plane":  # it has a grid of its own
            return {"model.nodes": self.nodes, "load.steps_per_half_cycle": self.steps}
        if self.on_contact_line:
            return {
                "model.nodes": self.nodes,
                "model.end_size": CONTACT_LINE.end_size,
                "load.steps_per_half_cycle": self.steps,
            }
        # Coarse grids need their nodes at the loaded end.  On finer elements than these the
        # beamshell's point reaction there turns into tension.
        fine = self.nodes <= 41 or self.section.startswith("p")
        return {
            "model.nodes": self.nodes,
            "model.end_size": 1.0 / 12.0 if fine else 1.0 / 6.0,
            "load.steps_per_half_cycle": self.steps,
        }

    @property
    def settings(self) -> dict[str, Any]:
        """Dotted values of the model, except its kinematics; measured in load steps."""
        general = self.rung == self.section and self.rung not in ("bar", "plane")
        stepwise = {"model.solution": "stepwise"} if general else {}
        return {"model.rung": self.rung} | self.resolution | stepwise


_COARSE, _MIDDLE = [(41, 4), (41, 10)], [(81, 10)]
_RESOLUTIONS = {
    "bar": [(41, 4)],
    "condensed-shell": [(33, 4), (65, 4)],
    "condensed-squeeze": [(33, 4), (65, 4), (129, 4)],
    "masing": _COARSE + _MIDDLE,
    "shell": _COARSE + _MIDDLE,
    "squeeze": [*_COARSE, *_MIDDLE, (161, 20)],
    "p4": _COARSE + _MIDDLE,
    "p6": [*_MIDDLE, (161, 10)],
    "plane": [(65, 4), (129, 4), (257, 4)],
}
CANDIDATES = {
    candidate.name: candidate
    for candidate in (
        Candidate(rung, *resolution)
        for rung, resolutions in _RESOLUTIONS.items()
        for resolution in resolutions
    )
}

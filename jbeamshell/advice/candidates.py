"""What `advise` chooses from: rungs, each on grids and load paths that suit it."""

from __future__ import annotations

from typing import Any, NamedTuple


class Candidate(NamedTuple):
    """A rung with its resolution.

    Attributes
    ----------
    rung : its name, see `jbeamshell.rungs`
    nodes : along X
    steps : load steps per half cycle
    """

    rung: str
    nodes: int
    steps: int

    @property
    def name(self) -> str:
        """Such as "p3@81x10"."""
        return f"{self.rung}@{self.nodes}x{self.steps}"

    @property
    def settings(self) -> dict[str, Any]:
        """Dotted values that make a scene's model this one, all but the kinematics."""
        # Coarse grids spend their nodes at the loaded end; the beamshell's point reaction there
        # goes into tension on finer elements than this.
        fine = self.nodes <= 41 or self.rung.rpartition("-")[2].startswith("p")
        return {
            "model.rung": self.rung,
            "model.nodes": self.nodes,
            "model.end_size": 1.0 / 12.0 if fine else 1.0 / 6.0,
            "load.steps_per_half_cycle": self.steps,
        }


_RESOLUTIONS = {
    "bar": [(41, 4)],
    "masing": [(41, 4), (41, 10), (81, 10)],
    "masing-p2": [(41, 4), (41, 10), (81, 10)],
    "masing-p3": [(41, 4), (41, 10), (81, 10)],
    "shell": [(41, 4), (41, 10), (81, 10)],
    "squeeze": [(41, 4), (41, 10), (81, 10), (161, 20)],
    "p2": [(41, 4), (41, 10), (81, 10)],
    "p3": [(41, 4), (41, 10), (81, 10)],
    "p4": [(41, 4), (41, 10), (81, 10)],
    "p6": [(41, 4), (41, 10), (81, 10), (161, 10)],
}
CANDIDATES = {
    candidate.name: candidate
    for candidate in (
        Candidate(rung, *resolution)
        for rung, resolutions in _RESOLUTIONS.items()
        for resolution in resolutions
    )
}

"""Motion of the loaded end of a strip: the result of a transient."""

from __future__ import annotations

from typing import Any

import numpy as np
from jax import Array

from jbeamshell.dynamics.ledger import Ledger
from jbeamshell.scene.mounting import in_words
from jbeamshell.scene.scene import Scene


class EndMotion(Ledger):
    """Motion of a strip's loaded end.

    Attributes
    ----------
    force : (T,) F at the loaded end
    scene : of the strip
    payload : mass per width that moves with the end
    """

    force: Any
    scene: Scene
    payload: Any

    def plot(self, axes: Any = None) -> Any:
        """Draw u(L) over time; see `jbeamshell.plotting.vibration`."""
        from jbeamshell import plotting

        return plotting.vibration(self, axes=axes)

    def figures(self) -> dict[str, Any]:
        """Summary by name, in numbers and words that JSON takes."""
        mounting = in_words(self.scene)
        about = {"mounting": mounting} if mounting else {}
        return about | {
            "reached": self.reached,
            "complete": self.complete,
            "largest_displacement": _largest(self.displacement),
            "largest_kinetic_energy": _largest(self.kinetic),
            "external_work": _last(self.external_work),
            "friction_work": _last(self.friction_work),
            "damping_work": _last(self.damping_work),
            "energy_imbalance": _largest(self.imbalance),
        }

    def __str__(self) -> str:
        """Summary, one quantity a line, and the doubts."""
        lines = [f"{name:24s} {value}" for name, value in self.figures().items()]
        return "\n".join([*lines, *(f"doubtful: {doubt}" for doubt in self.doubts)])


class Motion(EndMotion):
    """Motion of a whole strip, with its profiles along X.

    Attributes
    ----------
    x, tributary : (n,) node positions and tributary lengths
    fields, rates : (T, n, 4) nodal fields v, w, beta and psi, and their rates
    traction, reaction : (T, n) friction traction and normal reaction
    steps : number of time steps
    """

    x: Array
    tributary: Array
    fields: Array
    rates: Array
    traction: Array
    reaction: Array
    steps: Array

    def figures(self) -> dict[str, Any]:
        """Summary by name, in numbers and words that JSON takes."""
        return super().figures() | {"steps": int(self.steps)}


def _largest(column: Any) -> float:
    return float(np.nanmax(np.abs(np.asarray(column))))


def _last(column: Any) -> float:
    known = np.asarray(column)
    return float(known[np.isfinite(known)][-1])

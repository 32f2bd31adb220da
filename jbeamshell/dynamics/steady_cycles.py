"""Steady cycles of a scene at several amplitudes of its end force."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jbeamshell.quasistatic.solver import solve
from jbeamshell.scene.pressure import resultant
from jbeamshell.scene.scene import Scene

CYCLE = np.array([1.0, -1.0, 1.0, -1.0, 1.0])  # the last two branches are the steady cycle


class SteadyCycles(NamedTuple):
    """Steady cycles, per width.

    Attributes
    ----------
    force : (k,) amplitudes of the end force
    displacement : (k,) half the ranges of its displacement
    dissipation : (k,) work of friction in a cycle
    """

    force: NDArray[np.float64]
    displacement: NDArray[np.float64]
    dissipation: NDArray[np.float64]

    @classmethod
    def of(cls, scene: Scene, forces: NDArray[np.float64]) -> SteadyCycles:
        """Cycles of rising amplitude, one after the other.

        Raises
        ------
        UnconvergedError
            if a load step has no equilibrium
        """
        history = solve(scene, np.outer(forces, CYCLE).ravel())
        size = forces.size * CYCLE.size
        u, work = (
            np.asarray(each)[-size:].reshape(forces.size, -1)
            for each in (history.displacement, history.slip_work)
        )
        half = 0.5 * np.abs(u[:, -1] - u[:, -2])
        return cls(forces, half, np.sum(work[:, -2:], axis=1))


def gross_slip(scene: Scene) -> Any:
    """End force per width at which the whole contact slips, mu F_N L; may be traced.

    Infinite for a moment, under which nothing slides off.
    """
    if scene.load.kind == "moment":
        return np.inf
    contact, length = scene.contact, scene.strip.length
    down, _ = resultant(contact.pressure, contact.bottom_pressure, length, scene.member.support)
    return contact.friction * down

"""Motions over time with their energies, which must add up."""

from __future__ import annotations

from typing import Any

import numpy as np

from jbeamshell.common.errors import UnconvergedError
from jbeamshell.common.pytrees import Tree

OPEN = 1e-3  # part of the energy that moved by which a balance may be open without a doubt
LITTLE = 0.01  # of the kinetic energy: losses below it are not told exactly


class Ledger(Tree):
    """Motion at T evenly spaced times, with its energies; times that were not reached hold NaN.

    Energies are in the frame of the foundation; those of a strip are per width.

    Attributes
    ----------
    time : (T,) times
    displacement, velocity : (T,) u(L) of a strip, counted from the pressed strip, and its rate;
        (T, n) of the degrees of freedom of a structure
    kinetic : (T,) kinetic energy
    stored : (T,) potential energy of bodies, contact and sliders
    external_work : (T,) work done by forces and by the foundation since t = 0
    friction_work, damping_work : (T,) work lost by friction and by damping since t = 0
    """

    time: Any
    displacement: Any
    velocity: Any
    kinetic: Any
    stored: Any
    external_work: Any
    friction_work: Any
    damping_work: Any

    @property
    def complete(self) -> bool:
        """True if the whole span was computed."""
        return bool(np.all(np.isfinite(np.asarray(self.kinetic))))

    @property
    def reached(self) -> float:
        """Last time that was computed."""
        known = np.isfinite(np.asarray(self.kinetic))
        return float(np.asarray(self.time)[known].max(initial=0.0))

    @property
    def energy(self) -> Any:
        """Kinetic plus stored energy, (T,)."""
        return self.kinetic + self.stored

    @property
    def imbalance(self) -> Any:
        """Error of the energy balance, (T,); zero but for errors of the time steps."""
        change = self.energy - self.energy[0]
        return change - self.external_work + self.friction_work + self.damping_work

    @property
    def open_part(self) -> float:
        """Largest error of the energy balance over the energy that moved.

        That is the largest of the works since t = 0, of the range of kinetic plus stored energy,
        and of a hundredth of the kinetic energy, as nearly nothing may be lost.
        """
        columns = (self.energy, self.external_work, self.friction_work + self.damping_work)
        energy, external, lost = map(np.asarray, columns)
        moved = (
            np.nanmax(np.abs([external, lost])),
            np.nanmax(energy) - np.nanmin(energy),
            LITTLE * np.nanmax(np.asarray(self.kinetic)),
        )
        error = float(np.nanmax(np.abs(np.asarray(self.imbalance))))
        return error / float(max(moved)) if max(moved) > 0.0 else 0.0

    @property
    def doubts(self) -> tuple[str, ...]:
        """Sentences that say what may be wrong, and the fix; none if the energies add up."""
        if self.open_part <= OPEN:
            return ()
        return (
            f"the energy balance is open by {100.0 * self.open_part:.2g} % of the energy that "
            "moved: take shorter time steps (a smaller step or tolerance)",
        )


class InterruptedMotionError(UnconvergedError):
    """Transient that ended before its span; ``motion`` is the part that was computed."""

    def __init__(self, message: str, motion: Ledger) -> None:
        super().__init__(message)
        self.motion = motion

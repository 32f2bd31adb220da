"""Motion: the result of a transient, with its energies."""

from __future__ import annotations

import enum
from typing import Any, Protocol

import equinox as eqx
import numpy as np
from jax import Array

from jbeamshell.common.errors import UnconvergedError
from jbeamshell.dynamics.strip.attached_masses import AttachedMasses
from jbeamshell.dynamics.strip.excitation import Excitation
from jbeamshell.dynamics.strip.inertia import Inertia
from jbeamshell.scene.scene import Scene

OPEN = 1e-3  # part of the energy that moved by which a balance may be open without a doubt

LITTLE = 0.01  # of the kinetic energy: losses below it are not told exactly


class Balance(Protocol):
    """Energies and works of a motion, (T,) each; those of times that were not reached are NaN."""

    @property
    def kinetic(self) -> Any: ...
    @property
    def stored(self) -> Any: ...
    @property
    def external_work(self) -> Any: ...
    @property
    def friction_work(self) -> Any: ...
    @property
    def damping_work(self) -> Any: ...
    @property
    def imbalance(self) -> Any: ...


def open_part(motion: Balance) -> float:
    """Largest error of the energy balance over the energy that moved.

    That is the largest of the works since t = 0, of the range of kinetic plus stored energy, and of
    a hundredth of the kinetic energy, as nearly nothing may be lost.
    """
    energy = np.asarray(motion.kinetic) + np.asarray(motion.stored)
    lost = np.asarray(motion.friction_work) + np.asarray(motion.damping_work)
    works = np.nanmax(np.abs([np.asarray(motion.external_work), lost]))
    moved = max(float(works), float(np.nanmax(energy) - np.nanmin(energy)))
    moved = max(moved, LITTLE * float(np.nanmax(np.asarray(motion.kinetic))))
    error = float(np.nanmax(np.abs(np.asarray(motion.imbalance))))
    return error / moved if moved > 0.0 else 0.0


def doubts_of_balance(motion: Balance) -> tuple[str, ...]:
    """Doubt about a motion whose energies do not add up."""
    part = open_part(motion)
    if part <= OPEN:
        return ()
    return (
        f"the energy balance is open by {100.0 * part:.2g} % of the energy that moved: take "
        "shorter time steps (a smaller step or tolerance)",
    )


class Ending(enum.IntEnum):
    """Way in which a transient ended."""

    COMPLETE = 0
    TOO_MANY_STEPS = 1
    GAVE_UP = 2


class Ledger(eqx.Module):
    """Motion of a loaded end at T evenly spaced times, with its energies and work per width.

    Attributes
    ----------
    time : (T,) times
    displacement, velocity : (T,) u(L), counted from the pressed strip, and its rate
    force : (T,) F at the loaded end
    kinetic : (T,) kinetic energy
    stored : (T,) potential energy of the strip, the contact, the pressures and the chain
    external_work : (T,) work done by forces and by the foundation since t = 0
    friction_work, damping_work : (T,) work lost by friction and by damping since t = 0
    """

    time: Array
    displacement: Array
    velocity: Array
    force: Array
    kinetic: Array
    stored: Array
    external_work: Array
    friction_work: Array
    damping_work: Array

    @property
    def reached(self) -> float:
        """Last time that was computed."""
        known = np.isfinite(np.asarray(self.displacement))
        return float(np.asarray(self.time)[known].max(initial=0.0))

    @property
    def energy(self) -> Array:
        """Kinetic plus stored energy, (T,)."""
        return self.kinetic + self.stored

    @property
    def imbalance(self) -> Array:
        """Error of the energy balance, (T,); zero but for errors of the time steps."""
        change = self.energy - self.energy[0]
        return change - self.external_work + self.friction_work + self.damping_work

    @property
    def doubts(self) -> tuple[str, ...]:
        """Sentences that say what may be wrong, and the fix; none if the energies add up."""
        return doubts_of_balance(self)

    def plot(self, axes: Any = None) -> Any:
        """Draw u(L) over time; see `jbeamshell.plotting.vibration`."""
        from jbeamshell import plotting

        return plotting.vibration(self, axes=axes)

    def figures(self) -> dict[str, Any]:
        """Summary by name, in numbers and words that JSON takes."""
        known = np.isfinite(np.asarray(self.displacement))
        last = int(np.flatnonzero(known)[-1])
        return {
            "reached": self.reached,
            "largest_displacement": float(np.max(np.abs(np.asarray(self.displacement)[known]))),
            "largest_kinetic_energy": float(np.max(np.abs(np.asarray(self.kinetic)[known]))),
            "external_work": float(self.external_work[last]),
            "friction_work": float(self.friction_work[last]),
            "damping_work": float(self.damping_work[last]),
            "energy_imbalance": float(np.max(np.abs(np.asarray(self.imbalance)[: last + 1]))),
        }

    def __str__(self) -> str:
        """Summary, one quantity a line, and the doubts."""
        lines = [f"{name:24s} {value}" for name, value in self.figures().items()]
        return "\n".join([*lines, *(f"doubtful: {doubt}" for doubt in self.doubts)])


class Motion(Ledger):
    """Result of a transient at T evenly spaced times; times that were not reached hold NaN.

    Energies are in the frame of the foundation.

    Attributes
    ----------
    scene, inertia, attached, excitation : input of `jbeamshell.dynamics.simulate`
    x, tributary : (n,) node positions and tributary lengths
    fields, rates : (T, n, m) nodal fields v, w, beta, psi (and those of a section of order p), and
        their rates
    traction, reaction : (T, n) friction traction and normal reaction
    chain : (T, k) displacements of the chain's masses
    steps, rejected : number of time steps, and of those that were rejected
    status : code of `Ending`
    """

    scene: Scene
    inertia: Inertia
    attached: AttachedMasses
    excitation: Excitation
    x: Array
    tributary: Array
    fields: Array
    rates: Array
    traction: Array
    reaction: Array
    chain: Array
    steps: Array
    rejected: Array
    status: Array

    @property
    def complete(self) -> bool:
        """True if the whole span was computed."""
        return int(self.status) == Ending.COMPLETE

    def figures(self) -> dict[str, Any]:
        """Summary by name, in numbers and words that JSON takes."""
        return super().figures() | {
            "steps": int(self.steps),
            "rejected_steps": int(self.rejected),
            "status": Ending(int(self.status)).name.lower(),
        }


class InterruptedMotionError(UnconvergedError):
    """Transient that ended before its span.

    Attributes
    ----------
    motion : the part that was computed
    """

    def __init__(self, message: str, motion: Motion) -> None:
        super().__init__(message)
        self.motion = motion

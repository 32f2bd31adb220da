"""Motion: what a transient left behind, with its energies."""

from __future__ import annotations

import enum
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.errors import UnconvergedError
from jbeamshell.dynamics.strip.attached_masses import AttachedMasses
from jbeamshell.dynamics.strip.excitation import Excitation
from jbeamshell.dynamics.strip.inertia import Inertia
from jbeamshell.scene.scene import Scene


class Ending(enum.IntEnum):
    """How a transient ended."""

    COMPLETE = 0
    TOO_MANY_STEPS = 1
    GAVE_UP = 2


class Motion(eqx.Module):
    """Result of a transient, at evenly spaced instants; those not reached hold NaN.

    Energies are per width, in the frame of the foundation.

    Attributes
    ----------
    scene, inertia, attached, excitation : what was set in motion
    x, tributary : (n,) nodes and their contact lengths
    time : (T,) instants
    fields, rates : (T, n, m) v, w, beta, psi (and those of a hierarchic section), and their rates
    traction, reaction : (T, n) of friction, and normal
    displacement, velocity : (T,) u(L) since the pressure, and its rate
    chain : (T, k) displacements of the chain's masses
    force : (T,) F at the loaded end
    kinetic, stored : (T,) energies, the sliders', the contact's and the pressure's in the second
    external_work : (T,) work done by forces and by the foundation since t = 0
    friction_work, damping_work : (T,) work lost by friction and by damping since t = 0
    steps, rejected : time steps taken, and those of them that were taken back
    status : code of `Ending`
    """

    scene: Scene
    inertia: Inertia
    attached: AttachedMasses
    excitation: Excitation
    x: Array
    tributary: Array
    time: Array
    fields: Array
    rates: Array
    traction: Array
    reaction: Array
    displacement: Array
    velocity: Array
    chain: Array
    force: Array
    kinetic: Array
    stored: Array
    external_work: Array
    friction_work: Array
    damping_work: Array
    steps: Array
    rejected: Array
    status: Array

    @property
    def reached(self) -> float:
        """Time of the last instant that was computed."""
        known = np.isfinite(np.asarray(self.displacement))
        return float(np.asarray(self.time)[known].max(initial=0.0))

    @property
    def energy(self) -> Array:
        """Kinetic and stored energy, from what the strip stores at rest under the last load."""
        return self.kinetic + self.stored

    @property
    def imbalance(self) -> Array:
        """Energy that the ledger does not account for, (T,); zero but for errors of the steps."""
        change = self.energy - self.energy[0]
        return change - self.external_work + self.friction_work + self.damping_work

    @property
    def complete(self) -> bool:
        """Whether the whole span was followed."""
        return int(self.status) == Ending.COMPLETE

    def plot(self, axes: Any = None) -> Any:
        """Draw u(L) over time; see `jbeamshell.plotting.vibration`."""
        from jbeamshell import plotting

        return plotting.vibration(self, axes=axes)

    def figures(self) -> dict[str, Any]:
        """Figures by name, numbers that JSON takes."""
        known = np.isfinite(np.asarray(self.displacement))
        last = int(np.flatnonzero(known)[-1])
        scale = float(np.max(np.abs(np.asarray(self.kinetic)[known])))
        figures = {
            "reached": self.reached,
            "steps": int(self.steps),
            "rejected_steps": int(self.rejected),
            "largest_displacement": float(np.max(np.abs(np.asarray(self.displacement)[known]))),
            "largest_kinetic_energy": scale,
            "external_work": float(self.external_work[last]),
            "friction_work": float(self.friction_work[last]),
            "damping_work": float(self.damping_work[last]),
            "energy_imbalance": float(jnp.max(jnp.abs(self.imbalance[: last + 1]))),
            "status": Ending(int(self.status)).name.lower(),
        }
        return figures

    def __str__(self) -> str:
        """Figures, one a line."""
        return "\n".join(f"{name:24s} {value}" for name, value in self.figures().items())


class InterruptedMotionError(UnconvergedError):
    """A transient that ended too early.

    Attributes
    ----------
    motion : the part computed
    """

    def __init__(self, message: str, motion: Motion) -> None:
        super().__init__(message)
        self.motion = motion

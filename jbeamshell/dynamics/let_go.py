"""A mass on a strip, pulled and let go: the ring-down beside its quasi-static prediction."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from jbeamshell.common.checks import POSITIVE, require_number
from jbeamshell.dynamics.ringdown import RingDown, ring_down
from jbeamshell.dynamics.strip.attached_masses import AttachedMasses
from jbeamshell.dynamics.strip.excitation import Recorded
from jbeamshell.dynamics.strip.inertia import Inertia
from jbeamshell.dynamics.strip.modes import first_period
from jbeamshell.dynamics.strip.motion import Motion
from jbeamshell.dynamics.strip.simulate import simulate
from jbeamshell.dynamics.structure.joint import Joint
from jbeamshell.dynamics.structure.matrices import Attachment, Structure
from jbeamshell.dynamics.structure.modal import ModalCurve, modal_curve
from jbeamshell.scene.scene import Scene

HEAVY = 50.0  # strips that a payload weighs, where none is given
LET_GO = 0.1  # of a period in which the force vanishes: the strip's own waves stay small
PER_CYCLE = 50  # samples
AMPLITUDES = 40


class RingDownStudy(NamedTuple):
    """A transient, what it says about frequency and damping, and what statics says.

    Attributes
    ----------
    motion : the transient
    found : its frequency and damping over amplitude
    predicted : quasi-static modal analysis of the payload on the strip as a joint; its amplitudes
        are u(L) times the root of the payload
    payload : mass per width
    """

    motion: Motion
    found: RingDown
    predicted: ModalCurve
    payload: float

    @property
    def ratio(self) -> Any:
        """Damping found over the predicted one at the same amplitude, (k,)."""
        at = self.found.amplitude * np.sqrt(self.payload)
        return self.found.damping / np.interp(at, self.predicted.amplitude, self.predicted.damping)

    def figures(self) -> dict[str, Any]:
        """Figures by name, numbers and lists that JSON takes."""
        at = self.found.amplitude * np.sqrt(self.payload)
        columns = {
            "amplitude": self.found.amplitude,
            "frequency": self.found.frequency,
            "damping": self.found.damping,
            "predicted_frequency": np.interp(at, self.predicted.amplitude, self.predicted.frequency)
            / (2.0 * np.pi),
            "predicted_damping": np.interp(at, self.predicted.amplitude, self.predicted.damping),
        }
        lists = {name: np.asarray(column).tolist() for name, column in columns.items()}
        return self.motion.figures() | {"payload": self.payload} | lists


def let_go(
    scene: Scene,
    force: float | None = None,
    *,
    payload: float | None = None,
    inertia: Inertia | None = None,
    cycles: float = 20.0,
    per_cycle: int = 200,
    progress: bool | None = None,
) -> RingDownStudy:
    """Pull a mass on a strip, let it go, and compare its ring-down with the prediction.

    Parameters
    ----------
    scene : the strip
    force : end force per width; None is ``scene.load.amplitude``
    payload : mass per width at the loaded end; None is `HEAVY` strips
    inertia : density and what goes with it
    cycles : of the stuck strip that are followed
    per_cycle : time steps in each
    progress : as of `simulate`
    """
    inertia = inertia or Inertia()
    pull = float(scene.load.amplitude) if force is None else force
    require_number("cycles", cycles, POSITIVE)
    strip = scene.strip
    own = float(2.0 * strip.half_height * strip.length * inertia.mean_density(scene))
    mass = HEAVY * own if payload is None else payload
    require_number("payload", mass)
    attached = AttachedMasses(payload=mass)
    joint = Joint.of(scene, pull)
    period = first_period(scene, inertia, attached)
    motion = simulate(
        scene,
        cycles * period,
        Recorded([0.0, LET_GO * period], [pull, 0.0]),
        inertia=inertia,
        attached=attached,
        released=pull,
        samples=round(cycles * PER_CYCLE) + 1,
        step=period / per_cycle,
        progress=progress,
    )
    found = ring_down(motion.time, motion.displacement)
    structure = Structure([[mass]], [[0.0]], [Attachment(joint, 0)])
    levels = np.geomspace(
        0.5 * found.amplitude.min(), 1.02 * float(joint.displacement[-1]), AMPLITUDES
    )
    predicted = modal_curve(structure, levels * np.sqrt(mass))
    return RingDownStudy(motion, found, predicted, mass)

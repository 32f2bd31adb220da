"""Ring-down of a mass on a strip, pulled and let go, beside its quasi-static prediction."""

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

HEAVY = 50.0  # default payload, over the mass of the strip
RELEASE = 0.1  # duration of the release in periods, long enough to excite the strip's waves little
SAMPLES_PER_CYCLE = 50
AMPLITUDES = 40  # of the prediction


class RingDownStudy(NamedTuple):
    """Ring-down of a payload on a strip, and its prediction by quasi-static modal analysis.

    Attributes
    ----------
    motion : transient
    found : frequency and damping over amplitude, from the transient
    predicted : frequency and damping over amplitude, with the strip as a joint; its amplitudes are
        u(L) times the square root of the payload
    payload : mass per width
    """

    motion: Motion
    found: RingDown
    predicted: ModalCurve
    payload: float

    @property
    def ratio(self) -> Any:
        """Damping of the transient over the predicted damping at the same amplitude, (k,)."""
        return self.found.damping / self._prediction(self.predicted.damping)

    def _prediction(self, column: Any) -> Any:
        """Predicted values (k,) at the amplitudes of the transient."""
        at = self.found.amplitude * np.sqrt(self.payload)
        return np.interp(at, self.predicted.amplitude, column)

    def figures(self) -> dict[str, Any]:
        """Summary and curves by name, in numbers and lists that JSON takes."""
        columns = {
            "amplitude": self.found.amplitude,
            "frequency": self.found.frequency,
            "damping": self.found.damping,
            "predicted_frequency": self._prediction(self.predicted.frequency) / (2.0 * np.pi),
            "predicted_damping": self._prediction(self.predicted.damping),
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
    scene : scene of the strip
    force : end force per width; None is ``scene.load.amplitude``
    payload : mass per width at the loaded end; None is `HEAVY` times the mass of the strip
    inertia : density and damping of the strip; None is density 1
    cycles : span of the transient, in periods of the stuck strip
    per_cycle : number of time steps in a period
    progress : show a progress bar; None shows it on a terminal only

    Returns
    -------
    RingDownStudy

    Raises
    ------
    InputError
        for a force beyond gross slip, or a number that is not positive
    InterruptedMotionError
        if the solver stops before the end; it carries the part that was computed

    Examples
    --------
    >>> study = let_go(jb.Scene(), 1.0, cycles=30)
    >>> study.found.damping  # damping ratios at study.found.amplitude
    """
    inertia = inertia or Inertia()
    end_force = float(scene.load.amplitude) if force is None else force
    require_number("cycles", cycles, POSITIVE)
    strip = scene.strip
    strip_mass = float(2.0 * strip.half_height * strip.length * inertia.mean_density(scene))
    mass = HEAVY * strip_mass if payload is None else payload
    require_number("payload", mass)
    attached = AttachedMasses(payload=mass)
    joint = Joint.of(scene, end_force)
    period = first_period(scene, inertia, attached)
    motion = simulate(
        scene,
        cycles * period,
        Recorded([0.0, RELEASE * period], [end_force, 0.0]),
        inertia=inertia,
        attached=attached,
        released=end_force,
        samples=round(cycles * SAMPLES_PER_CYCLE) + 1,
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

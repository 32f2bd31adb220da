"""Ring-down of a mass on a strip, pulled and let go, beside what its steady cycles predict.

The mass m feels the strip as a spring of compliance c, whose own mass moves with the end in part:
m_1, the integral of rho |u|^2/u(L)^2 over the stuck strip under an end load.  Rayleigh's quotient
with this shape gives (omega/omega_1)^2 = m_1/m, where omega = 1/sqrt(m c) and
omega_1 = 1/sqrt(m_1 c) are the lowest frequencies of the mass on the strip and of the strip alone.
Where this ratio is small, the strip is the sliders of its joint under the mass.  Compared with the
motion of whole strips, eta .1126 and .3, pulled with .25 and .8 of gross slip, frequencies without
the strip's inertia are too high by m_1/2m and damping ratios by 2 m_1/m, and by up to 10 m_1/m in
the first swings from .8 of gross slip.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jbeamshell.common.checks import POSITIVE, require, require_number
from jbeamshell.common.errors import InputError
from jbeamshell.contact_line.strip import condensed, moving_volume
from jbeamshell.dynamics.over_amplitude import RingDown
from jbeamshell.dynamics.ringdown import ring_down
from jbeamshell.dynamics.strip.inertia import Inertia
from jbeamshell.dynamics.strip.motion import EndMotion, Motion
from jbeamshell.dynamics.structure.joint import Joint, largest_force
from jbeamshell.dynamics.structure.matrices import Attachment, Structure
from jbeamshell.dynamics.structure.modal import ModalCurve
from jbeamshell.dynamics.structure.shaking import shake
from jbeamshell.scene.rows import AUTO
from jbeamshell.scene.scene import Scene

LIGHT = 0.005  # largest m_1/m at which the strip's inertia is left out by itself
NO_SLIDERS = (
    "plane elasticity does not cover this scene, so that it has no sliders: take True "
    "(--strip whole)"
)
STUCK = "nothing slips under it, so that nothing damps: take more of gross slip, mu F_N L"
LAP = "follows no lap joint in time steps: take None (--strip auto), for its sliders"
DAMPED = "is for time steps, and a lap joint has none: leave it out"
FEW = "shows too little of the motion: take more cycles, or a smaller force or a heavier payload"
NO_INERTIA = (
    "has no inertia here: take whole=False (--strip sliders), a heavier payload, or another section"
)
HEAVY = 50.0  # default payload, over the mass of the strip
RELEASE = 0.1  # duration of the release in periods, long enough to excite the strip's waves little
SAMPLES_PER_CYCLE = 50
AMPLITUDES = 40  # of the prediction


@dataclasses.dataclass(frozen=True, eq=False)
class RingDownStudy:
    """Ring-down of a payload on a strip, and its prediction by quasi-static modal analysis.

    Attributes
    ----------
    motion : transient
    found : frequency and damping over amplitude, from the transient
    predicted : frequency and damping over amplitude, with the strip as a joint; its amplitudes are
        u(L) times the square root of the payload
    payload : mass per width
    share : mass of the strip that moves with its stuck end, over the payload; None if the strip was
        followed as a whole without asking
    """

    motion: EndMotion
    found: RingDown
    predicted: ModalCurve
    payload: float
    share: float | None

    @property
    def light(self) -> bool:
        """True if the strip was its sliders, False if its inertia was followed."""
        return not isinstance(self.motion, Motion)

    @property
    def ratio(self) -> Any:
        """Damping of the transient over the predicted damping at the same amplitude, (k,)."""
        return self.found.damping / self._prediction(self.predicted.damping)

    def _prediction(self, column: Any) -> Any:
        """Predicted values (k,) at the amplitudes of the transient."""
        at = self.found.amplitude * np.sqrt(self.payload)
        return np.interp(at, self.predicted.amplitude, column)

    def figures(self) -> dict[str, Any]:
        """Summary and curves by name, in numbers and lists that JSON takes.

        ``frequency_low`` and ``frequency_high`` are the ends of 95 % intervals, and so are those of
        the damping; they are there where the intervals are known.
        """
        columns = {"amplitude": self.found.amplitude}
        for name in ("frequency", "damping"):
            columns[name] = getattr(self.found, name)
            ends = getattr(self.found, f"{name}_interval")
            if ends is not None:
                columns[f"{name}_low"], columns[f"{name}_high"] = ends.T
        columns |= {
            "predicted_frequency": self._prediction(self.predicted.frequency),
            "predicted_damping": self._prediction(self.predicted.damping),
        }
        lists = {name: np.asarray(column).tolist() for name, column in columns.items()}
        own = {
            "payload": self.payload,
            "strip": "network of sliders" if self.light else "whole",
            "strip_mass_over_payload": self.share,
        }
        return self.motion.figures() | own | lists


def let_go(
    scene: Scene,
    force: float | None = None,
    *,
    payload: float | None = None,
    inertia: Inertia | None = None,
    cycles: float = 20.0,
    per_cycle: int = 200,
    whole: bool | None = None,
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
    per_cycle : number of time steps in a period, of the whole strip
    whole : True to follow the whole strip in time steps; False to follow the sliders of plane
        elasticity (or of the section that the scene names, on its contact line), without the
        strip's inertia; None to take the sliders, if the scene has them, where the strip's inertia
        matters little (`LIGHT`) and it is not damped.  A lap joint is always its sliders
    progress : show a progress bar of the time steps; None shows it where a person watches

    Returns
    -------
    RingDownStudy

    Raises
    ------
    InputError
        for a force beyond gross slip or under which nothing slips, a number that is not positive,
        or a strip that has no sliders where they are asked for
    InterruptedMotionError
        if the solver stops before the end; it carries the part that was computed

    Examples
    --------
    >>> study = let_go(jb.Scene(), 1.0, cycles=30)
    >>> study.found.damping  # damping ratios at study.found.amplitude
    """
    inertia, lap = inertia or Inertia(), scene.member.support != "none"
    require("whole", whole, not (lap and whole), LAP)
    require("inertia", "damped", not (lap and inertia.damped), DAMPED)
    line = None if whole else on_contact_line(scene)
    steps = not lap and scene.model.section != "plane"
    scene = scene.by_load_steps() if steps else scene
    end_force = float(largest_force(scene, force))
    require_number("cycles", cycles, POSITIVE)
    inertia.check(scene)
    mass = HEAVY * _strip_mass(scene, inertia) if payload is None else payload
    require_number("payload", mass)
    samples = round(cycles * SAMPLES_PER_CYCLE) + 1
    require("whole", whole, line is not None or whole is not False, NO_SLIDERS)
    motion: EndMotion | None = None
    share = None
    if line is not None and (whole is False or not inertia.damped):
        share = _share(line, inertia, mass)
        if lap or whole is False or share <= LIGHT:
            joint = Joint.of(line, end_force)
            slips = bool(np.any(np.asarray(joint.springs) > 0.0))
            require("force", end_force, slips, STUCK)
            motion = _on_sliders(line, joint, mass, end_force, cycles, samples)
    if motion is None:
        require("model.section", scene.plan.section, steps, NO_INERTIA)
        motion = _whole(scene, end_force, mass, inertia, cycles, per_cycle, samples, progress)
        joint = Joint.of(motion.scene, end_force)  # which is held down as the motion is
    try:
        found = ring_down(motion.time, motion.displacement)
    except InputError as error:
        raise InputError(f"cycles = {cycles}: {FEW}") from error
    smallest = 0.5 * float(found.amplitude.min())
    return RingDownStudy(motion, found, _prediction(joint, mass, smallest), mass, share)


def _prediction(joint: Joint, mass: float, smallest: float) -> ModalCurve:
    """Frequency and damping of the mass on steady cycles, from a displacement to the largest."""
    reach = np.geomspace(smallest, np.asarray(joint.below_gross_slip[0])[-1], AMPLITUDES)
    force, loss = np.asarray(joint.backbone(reach)), np.asarray(joint.dissipation(reach))
    elastic = np.real(np.asarray(joint.harmonic(jnp.asarray(reach))))
    softer = elastic * reach / force
    return ModalCurve(
        amplitude=reach * np.sqrt(mass),
        frequency=np.sqrt(force / (mass * reach)) / (2.0 * np.pi),
        damping=loss / (2.0 * np.pi * force * reach),
        dissipation=loss,
        joints=reach[:, None],
        frequency_error=1.0 - np.sqrt(softer),
        damping_error=1.0 - 1.0 / softer,
    )


def on_contact_line(scene: Scene) -> Scene | None:
    """Scene of a named section on its contact line, or plane elasticity; None where neither is."""
    named = scene.model.section != AUTO or scene.member.support != "none"
    if named and scene.plan.on_contact_line:
        return scene
    if "psi" not in scene.plan.fields:
        return None
    open_grid: dict[str, Any] = {"nodes": AUTO, "end_size": AUTO, "by": AUTO}
    model = dataclasses.replace(scene.model, section="plane", kinematics="linear", **open_grid)
    try:
        return dataclasses.replace(scene, model=model)
    except InputError:
        return None


def _strip_mass(scene: Scene, inertia: Inertia) -> float:
    """Mass of the strip per width."""
    _, weights = inertia.through_height(scene)
    return float(scene.strip.length * np.sum(np.asarray(weights)))


def _share(line: Scene, inertia: Inertia, mass: float) -> float:
    """Mass of the strip that moves with the stuck end, over the payload."""
    volume = jax.jit(lambda line: moving_volume(condensed(line, line.plan.nodes)))(line)
    return float(np.sum(np.asarray(inertia.density) * np.asarray(volume))) / mass


def _on_sliders(
    line: Scene, joint: Joint, mass: float, force: float, cycles: float, samples: int
) -> EndMotion:
    """Motion of a mass on the sliders of a joint, pulled with a force and let go."""
    period = 2.0 * np.pi * np.sqrt(mass / float(joint.stiffness))
    pulled = Structure([[mass]], [[0.0]], [Attachment(joint, 0)])
    start = np.array([float(joint.displacement(force))])
    found = shake(pulled, cycles * period, displacement=start, samples=samples)
    return EndMotion(
        time=found.time,
        displacement=found.displacement[:, 0],
        velocity=found.velocity[:, 0],
        kinetic=found.kinetic,
        stored=found.stored,
        external_work=found.external_work,
        friction_work=found.friction_work,
        damping_work=found.damping_work,
        force=np.zeros(samples),
        scene=line,
        payload=mass,
    )


def _whole(
    scene: Scene,
    force: float,
    mass: float,
    inertia: Inertia,
    cycles: float,
    per_cycle: int,
    samples: int,
    progress: bool | None,
) -> Motion:
    """Motion of the whole strip, whose end force falls to zero within `RELEASE` periods."""
    from jbeamshell.dynamics.strip.excitation import Recorded
    from jbeamshell.dynamics.strip.modes import modes
    from jbeamshell.dynamics.strip.simulate import simulate

    period = 1.0 / float(modes(scene, inertia, payload=mass).frequency[0])
    return simulate(
        scene,
        cycles * period,
        Recorded([0.0, RELEASE * period], [force, 0.0]),
        payload=mass,
        inertia=inertia,
        released=force,
        samples=samples,
        step=period / per_cycle,
        progress=progress,
    )

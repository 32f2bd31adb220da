"""Dynamics of strips, and of structures that have strips as joints.

Strips: `simulate` computes the transient of a scene, `modes` its natural modes, and `let_go` the
ring-down of a mass on it; `ring_down` finds frequency and damping over amplitude from any decaying
signal.

Structures: `Joint` makes a force element of a strip, `Structure` takes the matrices of any
finite-element code, `modal_curve` finds frequency and damping over amplitude without a transient,
and `shake` computes the transient.
"""

from jbeamshell.dynamics.let_go import RingDownStudy as RingDownStudy
from jbeamshell.dynamics.let_go import let_go as let_go
from jbeamshell.dynamics.ringdown import RingDown as RingDown
from jbeamshell.dynamics.ringdown import ring_down as ring_down
from jbeamshell.dynamics.strip.attached_masses import AttachedMasses as AttachedMasses
from jbeamshell.dynamics.strip.excitation import Excitation as Excitation
from jbeamshell.dynamics.strip.excitation import Harmonic as Harmonic
from jbeamshell.dynamics.strip.excitation import Impact as Impact
from jbeamshell.dynamics.strip.excitation import Recorded as Recorded
from jbeamshell.dynamics.strip.excitation import Shaker as Shaker
from jbeamshell.dynamics.strip.inertia import THICKNESS_STRETCH as THICKNESS_STRETCH
from jbeamshell.dynamics.strip.inertia import Inertia as Inertia
from jbeamshell.dynamics.strip.modes import Modes as Modes
from jbeamshell.dynamics.strip.modes import modes as modes
from jbeamshell.dynamics.strip.motion import Ending as Ending
from jbeamshell.dynamics.strip.motion import InterruptedMotionError as InterruptedMotionError
from jbeamshell.dynamics.strip.motion import Motion as Motion
from jbeamshell.dynamics.strip.simulate import simulate as simulate
from jbeamshell.dynamics.strip.stepsize import METHODS as METHODS
from jbeamshell.dynamics.strip.stepsize import stable_step as stable_step
from jbeamshell.dynamics.structure.joint import Joint as Joint
from jbeamshell.dynamics.structure.matrices import Attachment as Attachment
from jbeamshell.dynamics.structure.matrices import Structure as Structure
from jbeamshell.dynamics.structure.modal import ModalCurve as ModalCurve
from jbeamshell.dynamics.structure.modal import harmonic_balance as harmonic_balance
from jbeamshell.dynamics.structure.modal import modal_curve as modal_curve
from jbeamshell.dynamics.structure.shaking import InterruptedShakingError as InterruptedShakingError
from jbeamshell.dynamics.structure.shaking import StructureMotion as StructureMotion
from jbeamshell.dynamics.structure.shaking import shake as shake

"""Dynamics: a strip that vibrates, and a strip as the joint inside a vibrating structure.

`simulate` follows a scene in time, `let_go` a mass on a strip; `ring_down` reads frequency and
damping over amplitude from any decaying signal.  `Joint` makes a force element of a strip,
`Structure` takes matrices of any finite-element code, `modal_curve` gives amplitude against
frequency and damping without a transient, and `shake` gives the transient.
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

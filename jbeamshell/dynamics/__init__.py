"""Dynamics: a strip that vibrates, and a strip as the joint inside a vibrating structure.

`simulate` follows a scene in time, `let_go` a mass on a strip; `ring_down` reads frequency and
damping over amplitude from any decaying signal.  `Joint` makes a force element of a strip,
`Structure` takes matrices of any finite-element code, `modal_curve` gives amplitude against
frequency and damping without a transient, and `shake` gives the transient.
"""

from jbeamshell.dynamics.excitation import Excitation as Excitation
from jbeamshell.dynamics.excitation import Harmonic as Harmonic
from jbeamshell.dynamics.excitation import Impact as Impact
from jbeamshell.dynamics.excitation import Recorded as Recorded
from jbeamshell.dynamics.excitation import Shaker as Shaker
from jbeamshell.dynamics.inertia import THICKNESS_STRETCH as THICKNESS_STRETCH
from jbeamshell.dynamics.inertia import Inertia as Inertia
from jbeamshell.dynamics.joint import Joint as Joint
from jbeamshell.dynamics.modal import ModalCurve as ModalCurve
from jbeamshell.dynamics.modal import harmonic_balance as harmonic_balance
from jbeamshell.dynamics.modal import modal_curve as modal_curve
from jbeamshell.dynamics.modes import Modes as Modes
from jbeamshell.dynamics.modes import modes as modes
from jbeamshell.dynamics.motion import Ending as Ending
from jbeamshell.dynamics.motion import InterruptedMotionError as InterruptedMotionError
from jbeamshell.dynamics.motion import Motion as Motion
from jbeamshell.dynamics.riders import Riders as Riders
from jbeamshell.dynamics.ringdown import RingDown as RingDown
from jbeamshell.dynamics.ringdown import ring_down as ring_down
from jbeamshell.dynamics.shaking import InterruptedShakingError as InterruptedShakingError
from jbeamshell.dynamics.shaking import Shaken as Shaken
from jbeamshell.dynamics.shaking import shake as shake
from jbeamshell.dynamics.stepsize import METHODS as METHODS
from jbeamshell.dynamics.stepsize import stable_step as stable_step
from jbeamshell.dynamics.structure import Attachment as Attachment
from jbeamshell.dynamics.structure import Structure as Structure
from jbeamshell.dynamics.study import RingDownStudy as RingDownStudy
from jbeamshell.dynamics.study import let_go as let_go
from jbeamshell.dynamics.transient import simulate as simulate

from .frequencies import Modes as Modes
from .four_parameters import (
    FourParameters as FourParameters,
    four_parameters as four_parameters,
)
from .ledger import InterruptedMotionError as InterruptedMotionError
from .over_amplitude import RingDown as RingDown
from .release import RingDownStudy as RingDownStudy, let_go as let_go
from .ringdown import ring_down as ring_down
from .strip.excitation import (
    Excitation as Excitation,
    Harmonic as Harmonic,
    Impact as Impact,
    Recorded as Recorded,
    Shaker as Shaker,
)
from .strip.inertia import Inertia as Inertia
from .strip.modes import modes as modes
from .strip.motion import Motion as Motion
from .strip.simulate import simulate as simulate
from .structure.joint import Joint as Joint
from .structure.matrices import Attachment as Attachment, Structure as Structure
from .structure.modal import (
    ModalCurve as ModalCurve,
    modal_curve as modal_curve,
)
from .structure.shaking import (
    StructureMotion as StructureMotion,
    shake as shake,
)
from .vibration.forced import (
    forced_response as forced_response,
    steady_response as steady_response,
)
from .vibration.modes import nonlinear_mode as nonlinear_mode
from .vibration.results import (
    ForcedResponse as ForcedResponse,
    NonlinearMode as NonlinearMode,
)

from . import (
    contact_line as contact_line,
    dynamics as dynamics,
    identify as identify,
    laws as laws,
    measured as measured,
    plotting as plotting,
    reference as reference,
)
from .common.errors import (
    DoubtfulWarning as DoubtfulWarning,
    InputError as InputError,
    Status as Status,
    UnconvergedError as UnconvergedError,
)
from .common.jax_options import configure as configure
from .bodies.contact import solve_contact as solve_contact
from .bodies.contact_file import read_contact as read_contact, read_parts as read_parts
from .bodies.deck import Deck as Deck
from .bodies.modes import (
    FaceCurve as FaceCurve,
    FacePart as FacePart,
    ModalBodies as ModalBodies,
    face_curve as face_curve,
    modal_bodies as modal_bodies,
)
from .bodies.stiffness_model import StiffnessModel as StiffnessModel
from .bodies.substructure import Substructure as Substructure
from .bodies.surface import Surface as Surface, face_surface as face_surface
from .explorer import explore as explore
from .identify.plan import fit as fit
from .history.contact_history import ContactHistory as ContactHistory
from .history.history import History as History
from .history.read_history import read_history as read_history
from .solving.advice import Advice as Advice, advise as advise
from .solving.lap_joint import LapJoint as LapJoint
from .solving.sensitivity import Sensitivity as Sensitivity, sensitivity as sensitivity
from .solving.solve import solve as solve
from .measured.inspection import Inspection as Inspection, inspect as inspect
from .numerics.newton import Newton as Newton
from .solving.response import response as response
from .scene import library as library
from .scene.bolts import Bolt as Bolt
from .scene.parts import (
    Contact as Contact,
    Load as Load,
    Member as Member,
    Model as Model,
    Strip as Strip,
)
from .scene.scene import Scene as Scene
from .scene.toml import (
    read_scene as read_scene,
    scene_to_toml as scene_to_toml,
    write_scene as write_scene,
)
from .sweeping.run import sweep as sweep

__version__: str

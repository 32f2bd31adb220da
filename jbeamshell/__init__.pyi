from . import (
    condensed as condensed,
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
from .condensed.contact import solve_contact as solve_contact
from .condensed.contact_file import read_contact as read_contact
from .condensed.stiffness_model import StiffnessModel as StiffnessModel
from .condensed.substructure import Substructure as Substructure
from .explorer import explore as explore
from .history.contact_history import ContactHistory as ContactHistory
from .history.history import History as History
from .quasistatic.advice import Advice as Advice, advise as advise
from .quasistatic.solving import solve as solve
from .measured.inspection import Inspection as Inspection, inspect as inspect
from .numerics.newton import Newton as Newton
from .quasistatic.read_history import read_history as read_history
from .quasistatic.response import response as response
from .scene import library as library
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
from .sweeping.results import Sweep as Sweep
from .sweeping.run import sweep as sweep

__version__: str

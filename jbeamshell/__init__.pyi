from . import (
    dynamics as dynamics,
)
from . import (
    identify as identify,
)
from . import (
    ladder as ladder,
)
from . import (
    measured as measured,
)
from . import (
    plotting as plotting,
)
from . import (
    reference as reference,
)
from .common.errors import (
    DoubtfulWarning as DoubtfulWarning,
)
from .common.errors import (
    InputError as InputError,
)
from .common.errors import (
    Status as Status,
)
from .common.errors import (
    UnconvergedError as UnconvergedError,
)
from .common.jax_options import configure as configure
from .history.history import History as History
from .ladder.advice import Advice as Advice
from .ladder.advice import advise as advise
from .ladder.solving import solve as solve
from .numerics.newton import Newton as Newton
from .quasistatic.read_history import read_history as read_history
from .quasistatic.response import response as response
from .scene import library as library
from .scene.parts import Contact as Contact
from .scene.parts import Load as Load
from .scene.parts import Model as Model
from .scene.parts import Strip as Strip
from .scene.scene import Scene as Scene
from .scene.toml import (
    read_scene as read_scene,
)
from .scene.toml import (
    scene_to_toml as scene_to_toml,
)
from .scene.toml import (
    write_scene as write_scene,
)
from .sweeping.results import Sweep as Sweep
from .sweeping.run import sweep as sweep

__version__: str

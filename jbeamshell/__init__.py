"""jbeamshell: differentiable beamshells on a rough foundation."""

from jbeamshell.advice import Advice, advise
from jbeamshell.errors import DoubtfulWarning, InputError, UnconvergedError
from jbeamshell.histories import read_history
from jbeamshell.history import History, Status
from jbeamshell.newton import Newton
from jbeamshell.parts import Contact, Load, Model, Strip
from jbeamshell.quasistatic import solve
from jbeamshell.response import response
from jbeamshell.runtime import configure
from jbeamshell.scene import Scene, read_scene, scene_to_toml, write_scene
from jbeamshell.sweeping import Sweep, sweep

__version__ = "0.1.0"

__all__ = [
    "Advice",
    "Contact",
    "DoubtfulWarning",
    "History",
    "InputError",
    "Load",
    "Model",
    "Newton",
    "Scene",
    "Status",
    "Strip",
    "Sweep",
    "UnconvergedError",
    "advise",
    "configure",
    "read_history",
    "read_scene",
    "response",
    "scene_to_toml",
    "solve",
    "sweep",
    "write_scene",
]

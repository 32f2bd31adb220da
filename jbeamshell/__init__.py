"""jbeamshell: differentiable beamshells on a rough foundation.

The names below are loaded on first use; ``__init__.pyi`` says where each of them lives.
"""

from importlib.metadata import version

import lazy_loader

__version__ = version(__name__)
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Scene: strip, contact, load and model, with keys, TOML files and the scenes that ship."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["library"])

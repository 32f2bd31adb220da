"""Worker processes that start without the user's script."""

from __future__ import annotations

import contextlib
import sys
import threading
import types
from collections.abc import Iterator

_script = threading.RLock()  # of the entry of modules that is exchanged


@contextlib.contextmanager
def without_main() -> Iterator[None]:
    """Context in which processes start without the user's script, of which they need nothing.

    A spawned process imports the script that started it.  One without ``if __name__ ==
    "__main__":`` would start over in each of them.
    """
    with _script:
        script = sys.modules["__main__"]
        sys.modules["__main__"] = types.ModuleType("__main__")
        try:
            yield
        finally:
            sys.modules["__main__"] = script

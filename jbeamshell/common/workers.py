"""Worker processes of this machine: an executor that owns them, and how each of them begins.

The module imports nothing heavy: a worker sets its environment before JAX and NumPy read theirs.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
import types
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from multiprocessing.connection import Connection

_script = threading.RLock()  # of the entry of modules that is exchanged
ONE_THREAD = {"PJRT_NPROC": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
"""Environment of a worker: the threads of several workers would take turns on the cores."""


@contextlib.contextmanager
def processes(count: int, environment: Mapping[str, str]) -> Iterator[ProcessPoolExecutor]:
    """Executor with processes of one thread each, which end with the context or with this process.

    Parameters
    ----------
    count : number of processes
    environment : variables for them, beside those of this process
    """
    # Spawned, because JAX does not survive a fork.
    context = multiprocessing.get_context("spawn")
    end, lifeline = context.Pipe(duplex=False)
    given = dict(environment) | ONE_THREAD
    with end, ProcessPoolExecutor(count, context, begin, (end, given)) as pool, lifeline:
        yield pool


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


def begin(end: Connection, environment: Mapping[str, str]) -> None:
    """Set the environment of this worker, and end it when the other end of its pipe is closed."""
    os.environ.update(environment)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that sweeps gets it too, and ends us
    threading.Thread(target=_wait_for, args=(end,), daemon=True).start()


def _wait_for(end: Connection) -> None:
    with contextlib.suppress(EOFError, OSError):
        end.recv()
    os._exit(1)

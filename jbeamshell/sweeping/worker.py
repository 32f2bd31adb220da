"""Worker process of a sweep: `python -m jbeamshell.sweeping.worker FOLDER NUMBER OF`."""

from __future__ import annotations

import os
import sys
import threading
import time

from jbeamshell.sweeping.job import read_job
from jbeamshell.sweeping.processes import mark
from jbeamshell.sweeping.store import Store

WAIT = 0.02  # seconds between two looks for the first worker's mark


def work(folder: str, number: int, of: int) -> None:
    """Run a worker's blocks of the sweep in a folder, as long as the parent process lives.

    Parameters
    ----------
    folder : folder of the sweep's `Store`
    number, of : number of this worker, from 0, and count of workers; it takes blocks number,
        number + of, ...
    """
    threading.Thread(target=_end_with_parent, daemon=True).start()
    store = Store(folder)
    job = read_job(store)
    share = range(number, len(job.blocks), of)
    runner = job.runner()
    runner.lower()
    while number > 0 and not mark(store, 0).exists():  # worker 0 compiles for all
        time.sleep(WAIT)
    runner.compile()
    mark(store, number).touch()
    job.run(share, runner, store, lambda _: None, job.stored(share, store))


def _end_with_parent() -> None:
    """End this process when its parent ends, which closes the pipe to the standard input."""
    os.read(0, 1)  # unbuffered, so that it holds no lock when the interpreter ends
    os._exit(1)


if __name__ == "__main__":
    try:
        work(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
    except KeyboardInterrupt:  # the parent gets it too, and reports it
        sys.exit(130)

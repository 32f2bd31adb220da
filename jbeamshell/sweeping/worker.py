"""One of a sweep's worker processes: `python -m jbeamshell.sweeping.worker FOLDER NUMBER OF`."""

from __future__ import annotations

import os
import sys
import threading
import time

from jbeamshell.sweeping.job import read_job
from jbeamshell.sweeping.processes import mark
from jbeamshell.sweeping.store import Store

WAIT = 0.02  # seconds between looks


def work(folder: str, number: int, of: int) -> None:
    """Run every so-many-th block of the sweep in a folder, as long as the parent lives."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    store = Store(folder)
    job = read_job(store)
    share = range(number, len(job.blocks), of)
    runner = job.runner()
    runner.lower()
    while number > 0 and not mark(store, 0).exists():  # compiles for all
        time.sleep(WAIT)
    runner.compile()
    mark(store, number).touch()
    job.run(share, runner, store, lambda _: None, job.stored(share, store))


def _end_with_parent() -> None:
    """The parent holds the other end of the standard input, and writes nothing there."""
    os.read(0, 1)  # unbuffered: the end of the interpreter waits for no lock
    os._exit(1)


if __name__ == "__main__":
    try:
        work(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
    except KeyboardInterrupt:  # the parent has heard it, too
        sys.exit(130)

"""One of a sweep's worker processes: `python -m jbeamshell.sweeping.worker FOLDER NUMBER OF`."""

from __future__ import annotations

import os
import sys
import time

from jbeamshell.sweeping.job import read_job
from jbeamshell.sweeping.processes import mark
from jbeamshell.sweeping.store import Store

WAIT = 0.02  # seconds between looks


def work(folder: str, number: int, of: int) -> None:
    """Run every so-many-th block of the sweep in a folder, as long as the parent lives."""
    parent = os.getppid()

    def alive(_: int = 0) -> None:
        if os.getppid() != parent:
            sys.exit(1)

    store = Store(folder)
    job = read_job(store)
    share = range(number, len(job.blocks), of)
    runner = job.runner()
    runner.lower()
    while number > 0 and not mark(store, 0).exists():  # compiles for all
        alive()
        time.sleep(WAIT)
    runner.compile()
    mark(store, number).touch()
    job.run(share, runner, store, alive, job.stored(share, store))


if __name__ == "__main__":
    try:
        work(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
    except KeyboardInterrupt:  # the parent has heard it, too
        sys.exit(130)

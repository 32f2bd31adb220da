"""Processes of a sweep: workers on this machine, or the processes of `jax.distributed`."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

import jax
import numpy as np

from jbeamshell.common.errors import InputError, UnconvergedError
from jbeamshell.sweeping.job import Job, Tell
from jbeamshell.sweeping.runner import Block
from jbeamshell.sweeping.store import Store

POLL = 0.01  # seconds between two looks at the workers and their blocks
TRIES = 3  # deaths of a worker without a finished block in between, after which it is given up


class Crew:
    """Worker processes of a sweep on this machine; one that dies is replaced.

    Attributes
    ----------
    store : folder of the sweep
    count : number of workers; worker k takes blocks k, k + count, ...
    lost : number of workers that have died
    """

    def __init__(self, store: Store, count: int, ready: Callable[[], None]) -> None:
        self.store, self.count = store, count
        self.lost = 0
        self._ready: Callable[[], None] | None = ready  # called once, when all have compiled
        self._environment: dict[str, str] = {}
        self._processes: list[subprocess.Popen[bytes]] = []
        self._deaths = [0] * count
        self._left = [-1] * count

    def finish(self, job: Job, tell: Tell) -> None:
        """Run the blocks that the store lacks.

        Parameters
        ----------
        job : sweep to be done
        tell : is called with the number of lanes of every block that is finished

        Raises
        ------
        UnconvergedError
            if a worker dies `TRIES` times without finishing a block
        """
        self._environment = environment(self.store.cache)
        try:
            self._watch(job, tell)
        finally:
            self._stop()

    def _watch(self, job: Job, tell: Tell) -> None:
        sizes = [block.size for block in job.blocks]
        done = self.store.done()
        self._processes = [self._start(number) for number in range(self.count)]
        while True:
            running = [process.poll() is None for process in self._processes]
            now = self.store.done()
            for number in now - done:
                tell(sizes[number])
            done |= now
            left = [set(range(k, len(sizes), self.count)) - done for k in range(self.count)]
            self._look_ready()
            if not any(left):
                return
            for number, waiting in enumerate(left):
                if waiting and not running[number]:
                    self._replace(number, len(waiting))
            time.sleep(POLL)

    def _start(self, number: int) -> subprocess.Popen[bytes]:
        mark(self.store, number).unlink(missing_ok=True)
        words = ["-m", "jbeamshell.sweeping.worker", str(self.store.folder), str(number)]
        with self._log(number).open("wb") as log:
            return subprocess.Popen(
                [sys.executable, *words, str(self.count)],
                env=self._environment,
                stdin=subprocess.PIPE,  # closes with this process, and the worker ends
                stdout=log,
                stderr=log,
            )

    def _replace(self, number: int, left: int) -> None:
        self.lost += 1
        self._deaths[number] = self._deaths[number] + 1 if left == self._left[number] else 1
        self._left[number] = left
        if self._deaths[number] >= TRIES:
            raise UnconvergedError(
                f"worker process {number + 1} of {self.count} died {TRIES} times without "
                f"finishing a block ({self._cause(number)}); finished blocks are kept"
            )
        _close(self._processes[number])
        self._processes[number] = self._start(number)

    def _cause(self, number: int) -> str:
        code = self._processes[number].returncode
        if code < 0:
            return f"killed by signal {-code}; too little memory for {self.count} processes?"
        said = self._log(number).read_text(errors="replace").split("\n")
        return next((line.strip() for line in reversed(said) if line.strip()), f"exit code {code}")

    def _log(self, number: int) -> Path:
        return self.store.folder / f"worker-{number}.log"

    def _look_ready(self) -> None:
        marks = (mark(self.store, number) for number in range(self.count))
        if self._ready is not None and all(place.exists() for place in marks):
            self._ready()
            self._ready = None

    def _stop(self) -> None:
        for process in self._processes:
            with contextlib.suppress(OSError):
                process.terminate()
        for process in self._processes:
            try:
                process.wait(5.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            _close(process)


def _close(process: subprocess.Popen[bytes]) -> None:
    """Close this process's end of a worker's standard input."""
    if process.stdin is not None:
        process.stdin.close()


def mark(store: Store, number: int) -> Path:
    """File whose presence tells that a worker has compiled."""
    return store.folder / f"worker-{number}.ready"


def environment(cache: Path) -> dict[str, str]:
    """Environment of a worker: precision and devices of this process, one thread, a shared cache.

    Parameters
    ----------
    cache : folder for compiled programs, if this process has none
    """
    values, config = dict(os.environ), cast(Any, jax.config)
    values["JAX_ENABLE_X64"] = str(int(config.jax_enable_x64))
    values["JAX_PLATFORMS"] = jax.default_backend()
    # One thread each: those of several processes would take turns on the cores.
    values["PJRT_NPROC"] = values["OMP_NUM_THREADS"] = "1"
    folder = config.jax_compilation_cache_dir
    if folder is None:
        values["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0.5"
    values["JAX_COMPILATION_CACHE_DIR"] = str(cache if folder is None else folder)
    root = str(Path(__file__).parents[2])
    paths = [root, *filter(None, values.get("PYTHONPATH", "").split(os.pathsep))]
    values["PYTHONPATH"] = os.pathsep.join(dict.fromkeys(paths))
    return values


def check_alike(job: Job) -> None:
    """Refuse processes of `jax.distributed` with different sweeps, whose lanes would be mixed up.

    Raises
    ------
    InputError
        if a process has another sweep
    UnconvergedError
        if a process is lost
    """
    from jax.experimental import multihost_utils

    lanes = job.lanes
    about = repr((list(lanes.axes), lanes.paired, job.figures, job.solver, job.dtype, job.scene))
    sums = zlib.crc32(about.encode())
    for numbers in (*lanes.axes.values(), *job.blocks):
        sums = zlib.crc32(numbers.tobytes(), sums)
    try:
        everyone = np.ravel(multihost_utils.process_allgather(np.array([sums], np.uint32)))
    except jax.errors.JaxRuntimeError:
        raise UnconvergedError(
            "jax.distributed: a process was lost before the sweep began: start all of them again"
        ) from None
    (others,) = np.nonzero(everyone != everyone[0])
    if others.size:
        raise InputError(
            f"jax.distributed: process {others[0]} sweeps something else than process 0: "
            "give all of them the same scene, keys, values and figures"
        )


def wait_for_all() -> None:
    """Wait until every process of `jax.distributed` has come here, or one is lost."""
    from jax.experimental import multihost_utils

    with contextlib.suppress(jax.errors.JaxRuntimeError):
        multihost_utils.sync_global_devices("jbeamshell.sweep")


def share_of(job: Job) -> range:
    """Numbers of the blocks of this process of `jax.distributed`."""
    return range(jax.process_index(), len(job.blocks), jax.process_count())


def gathered(job: Job, own: dict[int, Block]) -> dict[int, Block]:
    """Blocks of all processes of `jax.distributed`, the same on each of them."""
    from jax.experimental import multihost_utils

    hands = jax.process_count()
    shares = [range(hand, len(job.blocks), hands) for hand in range(hands)]
    room = max(sum(job.blocks[number].size for number in share) for share in shares)
    rows = np.zeros((len(job.figures) + 1, room), job.dtype)
    for lanes, number in _places(job, shares[jax.process_index()]):
        rows[:-1, lanes], rows[-1, lanes] = own[number]
    everything = np.asarray(multihost_utils.process_allgather(rows))
    return {
        number: Block(everything[hand, :-1, lanes], everything[hand, -1, lanes].astype(np.int8))
        for hand, share in enumerate(shares)
        for lanes, number in _places(job, share)
    }


def _places(job: Job, share: range) -> Iterator[tuple[slice, int]]:
    """Places of the blocks of a share in its row of lanes, and their numbers."""
    begin = 0
    for number in share:
        end = begin + job.blocks[number].size
        yield slice(begin, end), number
        begin = end

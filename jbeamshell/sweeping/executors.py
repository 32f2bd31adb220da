"""Blocks of a sweep on the workers of an executor; those of a lost worker are given out again."""

from __future__ import annotations

import functools
import multiprocessing
import os
import threading
from collections.abc import Generator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from typing import Any, NamedTuple, cast

import jax
import numpy as np

from jbeamshell.common.checks import require, require_count
from jbeamshell.common.errors import InputError, UnconvergedError
from jbeamshell.common.jax_options import FAST_LOOPS, configure, memory, started
from jbeamshell.common.workers import processes, without_main
from jbeamshell.sweeping.job import Job, runner_of
from jbeamshell.sweeping.runner import KEPT, Block, Runner

TRIES = 3  # losses of workers without a finished block in between, after which a sweep gives up
IMPORTS = 4.0  # seconds in which a process imports JAX
MOST_PROCESSES = 10_000
ROOM = 2e9  # bytes of memory that a process may take

Blocks = Generator[tuple[int, Block], None, None]

_compiling = threading.Lock()


class Losses:
    """Count of workers that were lost, in all and since the last finished block."""

    def __init__(self) -> None:
        self.total = self.in_a_row = 0

    def add(self, cause: BaseException) -> None:
        """Count a loss; raises `UnconvergedError` for the last of `TRIES` in a row."""
        self.total += 1
        self.in_a_row += 1
        if self.in_a_row == TRIES:
            raise UnconvergedError(
                f"workers were lost {TRIES} times without a finished block in between "
                f"({_said(cause)}); too little memory for so many?"
            ) from None


# --- in a worker ----------------------------------------------------------------------------------


class Arithmetic(NamedTuple):
    """Options on which the last bits depend, as the process has them that gives out the blocks."""

    x64: bool
    fast_loops: bool


def run_block(about: str, arithmetic: Arithmetic, columns: np.ndarray) -> Block:
    """Figures of a block of lanes; a worker calls this.

    Parameters
    ----------
    about : `Job.description` of the sweep
    arithmetic : options; a worker whose JAX has started keeps its own loops
    columns : (keys, lanes) numbers of the lanes
    """
    with _compiling:  # the threads of a worker share one program
        if not started():
            configure(fast_loops=arithmetic.fast_loops, cache=False)
        with jax.enable_x64(arithmetic.x64):
            runner = _runner(about, arithmetic.x64)
    with jax.enable_x64(arithmetic.x64):
        (block,) = runner([columns])
    return block


@functools.lru_cache(KEPT)
def _runner(about: str, x64: bool) -> Runner:
    runner = runner_of(about, jax.local_devices()[:1])
    runner.compile()
    return runner


# --- in the process that gives out the blocks -----------------------------------------------------


def in_processes(job: Job, numbers: Sequence[int], count: int, losses: Losses) -> Blocks:
    """Blocks by number as processes of this machine finish them; processes that die are replaced.

    Raises
    ------
    UnconvergedError
        if they die `TRIES` times without finishing a block
    """
    left = dict.fromkeys(numbers)
    while left:
        before = losses.total
        try:
            with processes(min(count, len(left)), _environment()) as pool:
                for number, block in _finished(job, list(left), pool, losses, {}):
                    del left[number]
                    yield number, block
        except BrokenExecutor as error:
            if losses.total == before:
                losses.add(error)


def on_executor(job: Job, numbers: Sequence[int], executor: Executor, losses: Losses) -> Blocks:
    """Blocks by number as the workers of a user's executor finish them.

    Raises
    ------
    InputError
        if the executor is shut down, or its workers cannot import this package
    UnconvergedError
        if its workers are lost, or fail
    """
    waiting: dict[Future[Block], int] = {}
    try:
        yield from _finished(job, numbers, executor, losses, waiting)
    except BrokenExecutor as error:
        message = f"executor: its workers died ({_said(error)}): give a new one"
        raise UnconvergedError(message) from None
    finally:
        for future in waiting:
            future.cancel()


def _finished(
    job: Job,
    numbers: Sequence[int],
    executor: Executor,
    losses: Losses,
    waiting: dict[Future[Block], int],
) -> Blocks:
    """Blocks by number as workers finish them; raises `BrokenExecutor` if all workers are gone.

    ``waiting`` holds the numbers of the blocks that are given out.
    """
    about = job.description()
    x64, fast_loops = cast(Any, jax.config).jax_enable_x64, FAST_LOOPS in os.getenv("XLA_FLAGS", "")
    arithmetic = Arithmetic(bool(x64), fast_loops)
    left = list(numbers)

    def sizes(number: int) -> tuple[int, int]:
        return len(job.figures), job.blocks[number].size

    while left or waiting:
        with without_main():  # processes start when they get their first block
            for number in left:
                columns = job.lanes.columns(job.blocks[number])
                waiting[_given(executor, about, arithmetic, columns)] = number
        left, lost, failed = [], [], []
        for future in wait(waiting, return_when=FIRST_COMPLETED).done:
            number = waiting.pop(future)
            try:
                block = future.result()
            except (BrokenExecutor, CancelledError) as error:
                left.append(number)
                lost.append(error)
            except Exception as error:
                failed.append(error)
            else:
                if not (isinstance(block, Block) and block.fits(*sizes(number))):
                    said = f"executor: a worker answered {type(block).__name__}, no block of lanes"
                    raise UnconvergedError(f"{said}: give an executor that returns what it is told")
                losses.in_a_row = 0
                yield number, block
        if failed:
            raise _refusal(failed[0])
        if lost:
            losses.add(lost[0])


def _given(executor: Executor, *block: Any) -> Future[Block]:
    try:
        return executor.submit(run_block, *block)
    except BrokenExecutor:
        raise
    except Exception as error:  # a RuntimeError, or one of the executor's own
        raise InputError(
            f"executor = {executor!r}: takes no blocks ({_said(error)}): "
            "give one that is not shut down"
        ) from None


def _refusal(error: Exception) -> Exception:
    """Error for a worker that cannot run a block; one of this package says it itself."""
    if isinstance(error, InputError | UnconvergedError):
        return error
    chain: BaseException | None = error
    while chain is not None:
        if isinstance(chain, ImportError | AttributeError):
            return InputError(
                f"executor: its workers cannot import what they need ({_said(chain)}): "
                "install this version of jbeamshell there"
            )
        chain = chain.__cause__ or chain.__context__
    return UnconvergedError(f"a worker cannot run its block ({_said(error)})")


def _said(error: BaseException) -> str:
    """Kind and first line of an error."""
    first, *_ = str(error).strip().splitlines() or [""]
    return f"{type(error).__name__}: {first}" if first else type(error).__name__


def check_place(processes: Any, executor: Any, devices: Any) -> None:
    """Raise `InputError` for a place on which blocks cannot run, and for two of them."""
    places = {"processes": processes, "executor": executor, "devices": devices}
    given = [name for name, place in places.items() if place is not None]
    if len(given) > 1:
        raise InputError(f"{' and '.join(given)}: each says where blocks run: give one of them")
    if processes is not None:
        require_count("processes", processes, 1, MOST_PROCESSES)
        possible = processes == 1 or (jax.default_backend() == "cpu" and not _is_worker())
        fix = "are for cores, and cannot be started by a worker: leave them out"
        require("processes", processes, possible, fix)
    if executor is not None:
        fix = (
            "give a concurrent.futures.Executor, such as "
            "distributed.Client(...).get_executor() or mpi4py.futures.MPIPoolExecutor()"
        )
        require("executor", executor, isinstance(executor, Executor), fix)
        context = getattr(executor, "_mp_context", None)  # of a ProcessPoolExecutor
        forks = context is not None and context.get_start_method() == "fork"
        fix = "forks this process, which JAX does not survive: give processes=N instead"
        require("executor", executor, not forks, fix)
    if devices is not None:
        several = isinstance(devices, list | tuple) and len(devices) > 0
        known = several and all(isinstance(device, jax.Device) for device in devices)
        require("devices", devices, known, "give a list such as jax.devices()")


def _is_worker() -> bool:
    """True if this process may not start others."""
    return multiprocessing.current_process().daemon


def processes_that_pay(job: Job, rest_s: float, compile_s: float, blocks: int) -> int:
    """Number of processes that finish the rest of a sweep sooner than this one alone; 1 if none.

    Parameters
    ----------
    rest_s : seconds that this process would still need
    compile_s : seconds that the compilation took here, which every process repeats
    blocks : number of blocks that are left
    """
    alone = _is_worker() or jax.local_device_count() > 1 or jax.default_backend() != "cpu"
    if alone or job.scene is None:
        return 1
    count = max(1, min(_cores(), blocks, int(memory() / ROOM)))
    return count if rest_s * (1.0 - 1.0 / count) > 2.0 * (IMPORTS + compile_s) else 1


def _cores() -> int:
    """Number of cores that this process may use and that others leave free, at least its own."""
    every = os.cpu_count() or 1
    try:
        others = os.getloadavg()[0] - 1.0
        return max(1, min(len(os.sched_getaffinity(0)), int(every - others)))
    except (AttributeError, OSError):  # not on every system
        return every


def _environment() -> dict[str, str]:
    """Variables by which a process of this machine compiles as this one does."""
    folder = cast(Any, jax.config).jax_compilation_cache_dir
    cache = {} if folder is None else {"JAX_COMPILATION_CACHE_DIR": str(folder)}
    return {"JAX_PLATFORMS": "cpu"} | cache

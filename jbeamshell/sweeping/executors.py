"""Blocks of a sweep on the threads of this process, or on the workers of any executor."""

from __future__ import annotations

import contextlib
import functools
import os
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ThreadPoolExecutor,
    wait,
)
from typing import Any, cast

import jax
import numpy as np

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError, UnconvergedError
from jbeamshell.common.jax_options import FAST_LOOPS, configure, started
from jbeamshell.common.threads import on_one_core, on_processor
from jbeamshell.common.workers import without_main
from jbeamshell.sweeping.job import Job, runner_of
from jbeamshell.sweeping.runner import KEPT, Block, Runner

Blocks = Generator[tuple[int, Block], None, None]

_compiling = threading.Lock()


# --- in a worker ----------------------------------------------------------------------------------


@on_one_core
def run_block(about: str, fast_loops: bool, cache: bool, columns: np.ndarray) -> Block:
    """Figures of a block of lanes; a worker calls this.

    Parameters
    ----------
    about : `Job.description` of the sweep
    fast_loops : how loops are compiled, on which the last bits depend; a worker whose JAX has
        started keeps its own
    cache : True to keep compiled programs in the machine's folder, see `jbeamshell.configure`
    columns : (keys, lanes) numbers of the lanes
    """
    with _compiling:  # the threads of a worker share one program
        if not started():
            configure(fast_loops=fast_loops, cache=cache)
        with jax.enable_x64(True):
            runner = _runner(about)
    return _run(runner, columns)


@functools.lru_cache(KEPT)
def _runner(about: str) -> Runner:
    runner = runner_of(about)
    runner.compile()
    return runner


@on_one_core
def _run(runner: Runner, columns: np.ndarray) -> Block:
    with jax.enable_x64(True):  # each thread has its own
        return runner(columns)


# --- in the process that gives out the blocks -----------------------------------------------------


def blocks_of(job: Job, numbers: Sequence[int], executor: Executor | None) -> Blocks:
    """Blocks by number, as they are finished; without an executor by a thread for each core.

    Raises
    ------
    InputError
        if the executor's workers cannot import this package, or have another version
    UnconvergedError
        if the executor takes no blocks, or its workers die or fail
    """
    if not numbers:
        return
    if executor is None:
        runner = job.runner()
        runner.compile()
        cores = _cores() if on_processor() else 1
        with ThreadPoolExecutor(cores) as threads:
            yield from _finished(job, numbers, threads, functools.partial(_run, runner))
        return
    fast_loops = FAST_LOOPS in os.getenv("XLA_FLAGS", "")
    cache = bool(cast(Any, jax.config).jax_compilation_cache_dir)  # as this process has it
    task = functools.partial(run_block, job.description(), fast_loops, cache)
    try:
        yield from _finished(job, numbers, executor, task)
    except Exception as error:
        raise _refusal(error) from None


def _finished(
    job: Job, numbers: Sequence[int], executor: Executor, task: Callable[[np.ndarray], Block]
) -> Blocks:
    waiting: dict[Future[Block], int] = {}
    try:
        with without_main():  # processes start when they get their first block
            for number in numbers:
                waiting[executor.submit(task, job.columns(number))] = number
        while waiting:
            done = wait(waiting, return_when=FIRST_COMPLETED).done
            for future in sorted(done, key=_has_failed):  # so that what is done is kept
                number, block = waiting.pop(future), future.result()
                if not (isinstance(block, Block) and block.fits(*job.sizes(number))):
                    said = f"executor: a worker answered {type(block).__name__}, no block of lanes"
                    raise UnconvergedError(f"{said}: give an executor that returns what it is told")
                yield number, block
    finally:
        for future in waiting:
            future.cancel()


def _has_failed(future: Future[Block]) -> bool:
    return future.cancelled() or future.exception() is not None


def _refusal(error: Exception) -> Exception:
    """Error for an executor that runs no blocks; one of this package says it itself."""
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
    if isinstance(error, BrokenExecutor):
        return UnconvergedError(f"executor: its workers died ({_said(error)}): give a new one")
    return UnconvergedError(f"executor: cannot run a block ({_said(error)})")


def _said(error: BaseException) -> str:
    """Kind and first line of an error."""
    first, *_ = str(error).strip().splitlines() or [""]
    return f"{type(error).__name__}: {first}" if first else type(error).__name__


def check_executor(executor: Any) -> None:
    """Raise `InputError` for what is no executor, or one whose processes JAX would hang in."""
    fix = (
        "give a concurrent.futures.Executor, such as "
        "distributed.Client(...).get_executor() or mpi4py.futures.MPIPoolExecutor()"
    )
    require("executor", executor, executor is None or isinstance(executor, Executor), fix)
    context = getattr(executor, "_mp_context", None)  # of a ProcessPoolExecutor
    forks = context is not None and context.get_start_method() == "fork"
    fix = 'forks this process, which JAX does not survive: give mp_context=get_context("spawn")'
    require("executor", executor, not forks, fix)


def _cores() -> int:
    """Number of cores that this process may use."""
    with contextlib.suppress(AttributeError):  # not on every system
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1

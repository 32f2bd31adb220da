"""Sweeps: figures of many scenes at once, over any of a scene's numbers.

`sweep` runs them in this process, in several of this machine, or on the workers of any executor.
Finished blocks are kept on disk if a file is named.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
import os
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import jax
from numpy.typing import ArrayLike

from jbeamshell.common.checks import check_words, require
from jbeamshell.common.errors import InputError, UnconvergedError, warn_of_doubts
from jbeamshell.common.files import as_path
from jbeamshell.common.precision import doubled, is_single
from jbeamshell.common.progress import counting, in_notebook
from jbeamshell.common.threads import in_one_lapack_thread
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.scene import Scene
from jbeamshell.solving.response import pinned
from jbeamshell.sweeping.executors import (
    Blocks,
    Losses,
    check_place,
    in_processes,
    on_executor,
    processes_that_pay,
)
from jbeamshell.sweeping.job import Job
from jbeamshell.sweeping.lanes import Lanes as Lanes
from jbeamshell.sweeping.lanes import Outcome as Outcome
from jbeamshell.sweeping.lanes import check_size, lanes_of
from jbeamshell.sweeping.results import Sweep as Sweep
from jbeamshell.sweeping.runner import Block, check_figures
from jbeamshell.sweeping.store import Store

FIGURES = (
    *("dissipation", "dissipation_ratio", "secant_stiffness", "loss_factor"),
    "dissipation_error",  # which says what lanes to rely on, see `Sweep.doubtful`
)
PARTS = ".parts"  # suffix of the folder of finished blocks, beside the file

Progress = Callable[[int, int], None]


@in_one_lapack_thread
def sweep(
    scene: Scene,
    over: Mapping[str, ArrayLike],
    figures: Sequence[str] = FIGURES,
    *,
    paired: bool = False,
    out: str | os.PathLike[str] | None = None,
    processes: int | None = None,
    executor: Executor | None = None,
    devices: Sequence[Any] | None = None,
    solver: Newton | None = None,
    progress: Progress | None = None,
) -> Sweep:
    """Figures of the last cycle of many strips that differ in some numbers; each is a lane.

    Lanes are sorted by their estimated cost and dealt into blocks of equal cost.  On a core they
    run one after the other, in one compiled loop.  On the contact line, lanes that differ in their
    amplitude or pressure only share a body, and what their load paths have in common.  A lane that
    fails is solved again alone, with its long load steps divided.  A lane outside the model's
    domain is marked and not run.  Neither disturbs the others.

    Blocks run in this process.  If the rest takes long enough, they go on in one process for each
    core; or they run where ``processes`` or ``executor`` says.  The numbers are the same to the
    last bit.  Only this process writes files, and blocks of a worker that dies are given out again.

    Parameters
    ----------
    scene : scene with all that is not varied
    over : values (n,) by the dotted key of a number
    figures : attributes of `jbeamshell.History` that are numbers of a cycle or of every step; the
        sweep takes the last
    paired : True if the keys' values go together, row by row, instead of as a product
    out : FILE.csv for the table.  Finished blocks are kept in FILE.csv.parts until it is written;
        the same sweep to the same file goes on from them
    processes : number of processes of this machine that share the lanes; 1 is this one, and None
        as many as pay
    executor : `concurrent.futures.Executor` whose workers share the lanes, on any machines that
        have this version of the package, such as ``distributed.Client(address).get_executor()``
        of dask or ``mpi4py.futures.MPIPoolExecutor()``
    devices : devices of this process on which blocks run side by side; None is all local ones
    solver : settings of Newton's method
    progress : function that is called with the numbers of lanes done so far and to be run in all;
        None shows a bar where a person watches

    Returns
    -------
    Sweep
        arrays with one axis for every key.

    Raises
    ------
    InputError
        if the axes, figures or the file make no sweep, or one too large for memory; if the
        executor is none or shut down, or its workers cannot import this package
    UnconvergedError
        if workers keep dying; a lane that fails does not raise, see ``Sweep.status``

    Examples
    --------
    ::

        over = {"strip.height_ratio": np.geomspace(0.02, 0.4, 32), "load.amplitude": [0.5, 1.0]}
        result = jb.sweep(jb.Scene(), over, processes=2, out="sweep.csv")
        result["dissipation"]  # (32, 2)
    """
    begun = time.perf_counter()
    place = _Place(processes, executor, devices)
    with contextlib.ExitStack() as stack:
        names, lanes = _lanes_of(scene, over, figures, paired)
        if is_single(lanes.scene):
            stack.enter_context(jax.enable_x64(True))
            lanes = dataclasses.replace(lanes, scene=doubled(lanes.scene))
        job = _job(lanes, names, solver)
        check_place(processes, executor, devices)
        table = None if out is None else _check_out(out)
        store = None if table is None else Store(f"{table}{PARTS}")
        if store is not None:
            stack.enter_context(store.opened(job.description(), lanes.axes))
        told = stack.enter_context(counting(progress, "sweep", "lane"))
        result = _run(job, store, place, _Watch(begun, told))
        if store is not None and table is not None:
            store.publish(result, table)
            store.remove()
    warn_of_doubts(result.doubts, stacklevel=3)
    return result


def _lanes_of(
    scene: Scene, over: Mapping[str, ArrayLike], figures: Sequence[str], paired: bool
) -> tuple[tuple[str, ...], Lanes]:
    """Names of the figures, and lanes with the settings that serve all of them."""
    names = (figures,) if isinstance(figures, str) else figures
    if names is FIGURES and isinstance(scene, Scene) and scene.load.kind == "moment":
        names = tuple(name for name in FIGURES if name != "dissipation_ratio")  # no bar beside it
    check_words("figures", names)
    require("scene", scene, isinstance(scene, Scene), "give a jbeamshell.Scene")
    lanes = lanes_of(scene, over, paired)
    check_size(lanes.size, len(names))
    return tuple(names), dataclasses.replace(lanes, scene=pinned(scene, names, lanes.value))


def _job(lanes: Lanes, figures: tuple[str, ...], solver: Newton | None) -> Job:
    fix = "give a jbeamshell.Newton"
    require("solver", solver, solver is None or isinstance(solver, Newton), fix)
    check_figures(lanes.scene, tuple(lanes.axes), figures, solver)
    return Job(lanes, figures, solver)


def _check_out(out: str | os.PathLike[str]) -> Path:
    table = as_path(out)
    require("out", str(out), table.suffix.lower() == ".csv", "end the name in .csv")
    require("out", str(out), not os.path.isdir(table), "is a folder: name a file")
    require("out", str(out), os.path.isdir(table.parent), f"there is no folder {table.parent}")
    fix = f"the folder {table.parent} cannot be written to: name another"
    require("out", str(out), os.access(table.parent, os.W_OK | os.X_OK), fix)
    return table


class _Watch:
    """Clock and progress of a sweep: its begin, the end of compilation, and lanes done."""

    def __init__(self, begun: float, progress: Progress) -> None:
        self.begun = begun
        self.compiled_at = 0.0
        self.done = self.total = 0
        self._progress = progress

    @property
    def compile_s(self) -> float:
        """Seconds until the program was compiled; where others do that, until the first block."""
        return max(self.compiled_at - self.begun, 0.0)

    def start(self, done: int, total: int) -> None:
        self.done, self.total = done, total
        self.tell(0)

    def compiled(self) -> None:
        self.compiled_at = self.compiled_at or time.perf_counter()

    def tell(self, lanes: int) -> None:
        self.done += lanes
        self._progress(self.done, self.total)


@dataclasses.dataclass(frozen=True)
class _Place:
    """Place where the blocks of a sweep run; see `sweep`."""

    processes: int | None
    executor: Executor | None
    devices: Sequence[Any] | None

    def blocks(self, job: Job, numbers: list[int], watch: _Watch, losses: Losses) -> Blocks:
        """Blocks by number, as they are finished."""
        if not numbers:
            return
        if self.executor is not None:
            yield from on_executor(job, numbers, self.executor, losses)
        elif self.processes is not None and self.processes > 1:
            yield from in_processes(job, numbers, self.processes, losses)
        else:
            yield from self._here(job, numbers, watch, losses)

    def _here(self, job: Job, numbers: list[int], watch: _Watch, losses: Losses) -> Blocks:
        """Blocks of this process, which leaves the rest to several as soon as that pays."""
        runner = job.runner(self.devices)
        compile_s = runner.compile()
        watch.compiled()
        free = self.processes is None and self.devices is None
        # Blocks cost about the same; the shortest holds least that is done once, such as compiling.
        begun, shortest = time.perf_counter(), math.inf
        for done, (number, block) in enumerate(job.run(numbers, runner), 1):
            shortest = min(shortest, time.perf_counter() - begun)
            yield number, block
            left, begun = numbers[done:], time.perf_counter()
            rest_s = shortest * len(left)
            count = processes_that_pay(job, rest_s, compile_s, len(left)) if free else 1
            if count > 1 and done > 1:
                yield from in_processes(job, left, count, losses)
                return


def _run(job: Job, store: Store | None, place: _Place, watch: _Watch) -> Sweep:
    found: dict[int, Block] = {}
    if store is not None:
        found = job.stored(store)
    before, losses = _lanes(found), Losses()
    notes = [f"{before:,} lanes were done before"] if before else []
    watch.start(before, sum(block.size for block in job.blocks))
    missing = [number for number in range(len(job.blocks)) if number not in found]
    try:
        with contextlib.closing(place.blocks(job, missing, watch, losses)) as blocks:
            for number, block in blocks:
                watch.compiled()
                if store is not None:
                    store.save(number, block)
                found[number] = block
                watch.tell(block.status.size)
    except (KeyboardInterrupt, UnconvergedError, InputError) as error:
        said = str(error) or "interrupted"
        if store is not None:
            kept = f"{store.folder} keeps what is done, and the same sweep goes on from there"
            raise type(error)(f"{said}; {kept}") from None
        if not found:
            raise
        if not (isinstance(error, KeyboardInterrupt) and in_notebook()):
            kept = "nothing is kept: give out= (--out on the command line), a file, to go on later"
            raise type(error)(f"{said}; {kept}") from None
        notes.append(
            f"{said} after {watch.done:,} of {watch.total:,} lanes; the others are not_run"
        )
        warnings.warn(f"sweep {notes[-1]}", stacklevel=3)
    if losses.total:
        notes.append(f"workers that were lost: {losses.total}, their blocks given out again")
    values, status = job.collected(found)
    lanes = job.lanes
    return Sweep(
        lanes.scene,
        lanes.axes,
        lanes.paired,
        values,
        status,
        wall_s=time.perf_counter() - watch.begun,
        compile_s=watch.compile_s,
        computed=_lanes(found) - before,
        notes=tuple(notes),
    )


def _lanes(blocks: Mapping[int, Block]) -> int:
    return sum(block.status.size for block in blocks.values())

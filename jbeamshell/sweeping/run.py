"""Sweeps: figures of many scenes at once, over any of a scene's numbers.

`sweep` runs them on all local devices, in several processes of this machine, or as one of the
processes of `jax.distributed`.  Finished blocks are kept on disk if a file is named.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
from numpy.typing import ArrayLike

from jbeamshell.common.checks import check_words, require
from jbeamshell.common.errors import UnconvergedError
from jbeamshell.common.files import as_path
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.scene import Scene
from jbeamshell.sweeping.job import Job
from jbeamshell.sweeping.lanes import Lanes as Lanes
from jbeamshell.sweeping.lanes import Outcome as Outcome
from jbeamshell.sweeping.lanes import check_size, lanes_of
from jbeamshell.sweeping.processes import Crew, check_alike, gathered, share_of, wait_for_all
from jbeamshell.sweeping.results import Sweep as Sweep
from jbeamshell.sweeping.runner import Block, check_figures
from jbeamshell.sweeping.store import Store

FIGURES = ("dissipation", "dissipation_ratio", "secant_stiffness", "loss_factor")
MOST_PROCESSES = 10_000
PARTS = ".parts"  # suffix of the folder of finished blocks, beside the file
LOST = "a process was lost: its lanes that were not on disk were run by the others"

Progress = Callable[[int, int], None]


def sweep(
    scene: Scene,
    over: Mapping[str, ArrayLike],
    figures: Sequence[str] = FIGURES,
    *,
    paired: bool = False,
    out: str | os.PathLike[str] | None = None,
    processes: int = 1,
    devices: Sequence[Any] | None = None,
    solver: Newton | None = None,
    progress: Progress | None = None,
) -> Sweep:
    """Figures of the last cycle of many strips that differ in some numbers; each is a lane.

    Lanes are sorted by their estimated cost and dealt into blocks of equal cost.  On a core they
    run one after the other, in one compiled loop.  A lane that fails is solved again alone, with
    its long load steps divided.  A lane outside the model's domain is marked and not run.  Neither
    disturbs the others.

    If `jax.distributed` is initialised, every process makes this same call, runs its part of the
    lanes, and gets the whole result.

    Parameters
    ----------
    scene : scene with all that is not varied
    over : values (n,) by the dotted key of a number
    figures : attributes of `jbeamshell.History` that are numbers of a cycle or of every step; the
        sweep takes the last
    paired : True if the keys' values go together, row by row, instead of as a product
    out : FILE.csv for the table.  Finished blocks are kept in FILE.csv.parts until it is written;
        the same sweep to the same file goes on from them
    processes : number of processes of this machine that share the lanes; one that dies is replaced
    devices : devices of this process on which blocks run side by side; None is all local ones
    solver : settings of Newton's method
    progress : function that is called with the numbers of lanes done so far and to be run in all

    Returns
    -------
    Sweep
        arrays with one axis for every key.

    Raises
    ------
    InputError
        if the axes, figures or the file make no sweep, or one too large for memory
    UnconvergedError
        if a worker process keeps dying; a lane that fails does not raise, see ``Sweep.status``

    Examples
    --------
    ::

        over = {"strip.height_ratio": np.geomspace(0.02, 0.4, 32), "load.amplitude": [0.5, 1.0]}
        result = jb.sweep(jb.Scene(), over, processes=2, out="sweep.csv")
        result["dissipation"]  # (32, 2)
    """
    watch = _Watch(progress)
    job = _job(scene, over, figures, paired, solver)
    _check_processes(processes, devices)
    table = None if out is None else _check_out(out)
    if table is not None:
        store = Store(f"{table}{PARTS}")
        try:
            result = _run(job, store, processes, devices, watch)
        except (KeyboardInterrupt, UnconvergedError) as error:
            said = str(error) or "interrupted"
            raise type(error)(
                f"{said}; {store.folder} keeps what is done, and the same sweep goes on from there"
            ) from None
        if jax.process_index() == 0:
            store.publish(result, table)
        if jax.process_count() > 1 and LOST not in result.notes:
            wait_for_all()
        if jax.process_index() == 0 or LOST not in result.notes:
            store.remove()
        return result
    if processes > 1:
        with tempfile.TemporaryDirectory(prefix="jbeamshell-sweep-") as folder:
            return _run(job, Store(folder), processes, devices, watch)
    return _run(job, None, processes, devices, watch)


def _job(
    scene: Scene,
    over: Mapping[str, ArrayLike],
    figures: Sequence[str],
    paired: bool,
    solver: Newton | None,
) -> Job:
    names = [figures] if isinstance(figures, str) else figures
    check_words("figures", names)
    require("scene", scene, isinstance(scene, Scene), "give a jbeamshell.Scene")
    fix = "give a jbeamshell.Newton"
    require("solver", solver, solver is None or isinstance(solver, Newton), fix)
    lanes = lanes_of(scene, over, paired)
    check_size(lanes.size, len(names))
    check_figures(scene, tuple(lanes.axes), tuple(names), solver)
    return Job(lanes, tuple(names), solver)


def _check_processes(processes: int, devices: Sequence[Any] | None) -> None:
    whole = isinstance(processes, int) and not isinstance(processes, bool)
    fix = "must be a whole number, 1 or more"
    require("processes", processes, whole and 1 <= processes <= MOST_PROCESSES, fix)
    if processes > 1:
        on_cores = jax.default_backend() == "cpu"
        fix = "is for cores only: other devices work side by side anyway; leave it out"
        require("processes", processes, on_cores, fix)
        fix = "does not go with jax.distributed, which has its own processes: leave it out"
        require("processes", processes, jax.process_count() == 1, fix)
        fix = "does not go with processes, which choose theirs: leave it out"
        require("devices", devices, devices is None, fix)
    if devices is not None:
        known = isinstance(devices, list | tuple) and all(
            isinstance(d, jax.Device) for d in devices
        )
        require("devices", devices, known and len(devices) > 0, "give a list such as jax.devices()")


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

    def __init__(self, progress: Progress | None) -> None:
        self.begun = self.compiled_at = time.perf_counter()
        self.done = self.total = 0
        self._progress = progress

    def start(self, done: int, total: int) -> None:
        self.done, self.total = done, total
        self.tell(0)

    def compiled(self) -> None:
        self.compiled_at = time.perf_counter()

    def tell(self, lanes: int) -> None:
        self.done += lanes
        if self._progress is not None:
            self._progress(self.done, self.total)


def _run(
    job: Job, store: Store | None, processes: int, devices: Sequence[Any] | None, watch: _Watch
) -> Sweep:
    share, hands = range(len(job.blocks)), jax.process_count()
    if hands > 1:
        check_alike(job)
        share = share_of(job)
    found: dict[int, Block] = {}
    if store is not None:
        store.open(job.description(), job.lanes.axes)
        found = job.stored(share, store)
    before = _lanes(found)
    watch.start(before, job.size(share))
    notes = [f"{before:,} lanes were done before"] if before else []
    if processes > 1 and store is not None and len(found) < len(share):
        crew = Crew(store, min(processes, len(share)), watch.compiled)
        crew.finish(job, watch.tell)
        found = job.stored(share, store)
        notes += [f"worker processes that died: {crew.lost}, replaced"] if crew.lost else []
    if len(found) < len(share):
        runner = job.runner(devices)
        runner.compile()
        watch.compiled()
        found = job.run(share, runner, store, watch.tell, found)
    if hands > 1:
        try:
            found = gathered(job, found)
        except jax.errors.JaxRuntimeError:
            notes.append(LOST)
            everything = range(len(job.blocks))
            if store is not None:
                found |= job.stored(everything, store)
            watch.start(_lanes(found), job.size(everything))
            found = job.run(everything, job.runner(devices), store, watch.tell, found)
    values, status = job.collected(found)
    lanes = job.lanes
    return Sweep(
        lanes.scene,
        lanes.axes,
        lanes.paired,
        values,
        status,
        wall_s=time.perf_counter() - watch.begun,
        compile_s=watch.compiled_at - watch.begun,
        computed=_lanes(found) - before,
        notes=tuple(notes),
    )


def _lanes(blocks: Mapping[int, Block]) -> int:
    return sum(block.status.size for block in blocks.values())

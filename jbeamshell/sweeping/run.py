"""Sweeps: figures of many scenes at once, over any of a scene's numbers.

`sweep` runs them in this process, or on the workers of any executor.  Finished blocks are kept on
disk if a file is named.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING

import jax
import numpy as np
from numpy.typing import ArrayLike

from jbeamshell.common.checks import check_words, require
from jbeamshell.common.errors import InputError, UnconvergedError, warn_of_doubts
from jbeamshell.common.files import as_path
from jbeamshell.common.precision import doubled, is_single
from jbeamshell.common.progress import counting, in_notebook
from jbeamshell.common.threads import on_one_core
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.planning import turning
from jbeamshell.scene.scene import Scene
from jbeamshell.solving.response import pinned
from jbeamshell.sweeping.executors import blocks_of, check_executor
from jbeamshell.sweeping.job import Job
from jbeamshell.sweeping.lanes import Lanes, check_size, lanes_of
from jbeamshell.sweeping.results import dataset, publish
from jbeamshell.sweeping.runner import Block, check_figures
from jbeamshell.sweeping.store import Store

if TYPE_CHECKING:
    import xarray

FIGURES = (
    *("dissipation", "dissipation_ratio", "secant_stiffness", "loss_factor"),
    "dissipation_error",  # which says what lanes to rely on
)
PARTS = ".parts"  # suffix of the folder of finished blocks, beside the file

Progress = Callable[[int, int], None]


@on_one_core
def sweep(
    scene: Scene,
    over: Mapping[str, ArrayLike],
    figures: Sequence[str] = FIGURES,
    *,
    paired: bool = False,
    out: str | os.PathLike[str] | None = None,
    executor: Executor | None = None,
    solver: Newton | None = None,
    progress: Progress | None = None,
) -> xarray.Dataset:
    """Figures of the last cycle of many strips that differ in some numbers; each is a lane.

    Lanes are sorted by their estimated cost and dealt into blocks of equal cost.  Blocks run in
    this process, one on each core at a time, or on the workers of ``executor``; the numbers are the
    same to the last bit.  In a block lanes run one after the other, in one compiled loop.  On the
    contact line, lanes that differ in their amplitude or pressure only share a body, and what their
    load paths have in common.  A lane that fails is solved again alone, with its long load steps
    divided.  A lane outside the model's domain is marked and not run.  Neither disturbs the others.

    Parameters
    ----------
    scene : scene with all that is not varied
    over : values (n,) by the dotted key of a number
    figures : attributes of `jbeamshell.History` that are numbers of a cycle or of every step; the
        sweep takes the last
    paired : True if the keys' values go together, row by row, instead of as a product
    out : FILE.csv for the table.  Finished blocks are kept in FILE.csv.parts until it is written;
        the same sweep to the same file goes on from them
    executor : `concurrent.futures.Executor` whose workers share the lanes, on any machines that
        have this version of the package: threads or processes of this machine,
        ``distributed.Client(address).get_executor()`` of dask or
        ``mpi4py.futures.MPIPoolExecutor()``; None is a thread for each core of this process
    solver : settings of Newton's method
    progress : function that is called with the numbers of lanes done so far and to be run in all;
        None shows a bar where a person watches

    Returns
    -------
    xarray.Dataset
        with a dimension for every key, or ``lane`` if they are paired.  Its variables are the
        figures, NaN where there is none; ``status``, codes of `jbeamshell.sweeping.Outcome` whose
        meanings are in its attributes; and ``doubtful``, True for lanes not to rely on.  These have
        no equilibrium, or were not run; or the dissipation's estimated error is above 2 % and
        ``model.tolerance``, which is known if ``"dissipation_error"`` is among the figures.  Where
        a lane loses less than 1e-4 of what a bar does, the error is over that 1e-4, if
        ``"dissipation_ratio"`` is among the figures too.  Under force control the coordinate
        ``amplitude_over_height`` is A/(mu F_N L/2)/eta, on which the dissipation ratio mostly
        depends.  ``units`` are attributes of the variables.  Attributes of the set are a summary,
        doubts, which are warned of too, notes, the plan, the scene in TOML and the version.

    Raises
    ------
    InputError
        if the axes, figures or the file make no sweep, or one too large for memory; if the executor
        is none, or its workers cannot import this package
    UnconvergedError
        if the executor's workers die; a lane that fails does not raise

    Examples
    --------
    ::

        over = {"strip.height_ratio": np.geomspace(0.02, 0.4, 32), "load.amplitude": [0.5, 1.0]}
        result = jb.sweep(jb.Scene(), over, out="sweep.csv")
        result["dissipation"].sel({"load.amplitude": 0.5}).plot()
        result.to_netcdf("sweep.nc")  # xarray.open_dataset reads it
    """
    check_executor(executor)
    with contextlib.ExitStack() as stack:
        names, lanes = _lanes_of(scene, over, figures, paired)
        if is_single(lanes.scene):
            stack.enter_context(jax.enable_x64(True))
            scene, lanes = doubled(scene), dataclasses.replace(lanes, scene=doubled(lanes.scene))
        fix = "give a jbeamshell.Newton"
        require("solver", solver, solver is None or isinstance(solver, Newton), fix)
        check_figures(lanes.scene, tuple(lanes.axes), names, solver)
        job = Job(lanes, scene, names, solver)
        table = None if out is None else _check_out(out)
        store = None if table is None else Store(f"{table}{PARTS}", job.mark())
        if store is not None:
            stack.enter_context(store.opened())
        told = stack.enter_context(counting(progress, "sweep", "lane"))
        result = _run(job, store, executor, told)
        if store is not None and table is not None:
            publish(result, store.folder, table)
            store.remove()
    warn_of_doubts(filter(None, [result.attrs["doubts"]]))
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


def _check_out(out: str | os.PathLike[str]) -> Path:
    table = as_path(out)
    require("out", str(out), table.suffix.lower() == ".csv", "end the name in .csv")
    require("out", str(out), not os.path.isdir(table), "is a folder: name a file")
    require("out", str(out), os.path.isdir(table.parent), f"there is no folder {table.parent}")
    fix = f"the folder {table.parent} cannot be written to: name another"
    require("out", str(out), os.access(table.parent, os.W_OK | os.X_OK), fix)
    return table


def _run(
    job: Job, store: Store | None, executor: Executor | None, told: Progress
) -> xarray.Dataset:
    found = {} if store is None else _stored(job, store)
    before, total = _lanes(found), sum(block.size for block in job.blocks)
    notes = [f"{before:,} lanes were done before"] if before else []
    turns = turning(job.open, job.lanes.value) & ~job.outside
    if exact := int(np.sum(turns)) if job.lanes.scene.plan.elastic else 0:
        notes.append(f"{exact:,} lanes need exact rotations: they are beamshells in load steps")
    told(before, total)
    try:
        missing = [number for number in range(len(job.blocks)) if number not in found]
        blocks = blocks_of(job, missing, executor)
        with contextlib.closing(blocks):
            for number, block in blocks:
                if store is not None:
                    store.save(number, block)
                found[number] = block
                told(_lanes(found), total)
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
        done = f"{said} after {_lanes(found):,} of {total:,} lanes; the others are not_run"
        notes.append(done)
        warnings.warn(f"sweep {done}", stacklevel=3)
    return dataset(job.lanes, *job.collected(found), notes)


def _stored(job: Job, store: Store) -> dict[int, Block]:
    """Blocks that are in the store, by number."""
    numbers = range(len(job.blocks))
    loaded = {number: store.load(number, *job.sizes(number)) for number in numbers}
    return {number: block for number, block in loaded.items() if block is not None}


def _lanes(blocks: Mapping[int, Block]) -> int:
    return sum(block.status.size for block in blocks.values())

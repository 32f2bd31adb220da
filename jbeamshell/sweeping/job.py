"""Sweep as a job: lanes dealt into blocks, blocks run and stored, results collected."""

from __future__ import annotations

import dataclasses
import functools
import json
import tomllib
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from typing import Any

import jax
import numpy as np

from jbeamshell.common.errors import InputError
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.toml import scene_from_values, scene_to_toml
from jbeamshell.sweeping.lanes import Lanes, Outcome
from jbeamshell.sweeping.runner import BLOCK, Block, Runner, shared_keys, width_of_chunks
from jbeamshell.sweeping.store import Store

BLOCKS = 32  # least number of blocks of a large sweep, for equal shares of all processes
LEAST = 8  # least lanes of a block that is worth a file

Tell = Callable[[int], None]


@dataclasses.dataclass(frozen=True)
class Job:
    """Sweep to be done.

    Attributes
    ----------
    lanes : lanes of the sweep
    figures : attributes of `jbeamshell.History`
    solver : settings of Newton's method; None is the default
    """

    lanes: Lanes
    figures: tuple[str, ...]
    solver: Newton | None = None

    @property
    def dtype(self) -> np.dtype:
        """Precision of the scene's numbers."""
        return np.dtype(self.lanes.scene.strip.length.dtype)

    @functools.cached_property
    def scene(self) -> str | None:
        """TOML of what is not varied; None if the scene has a function of the user's own."""
        try:
            return scene_to_toml(self.lanes.scene)
        except InputError:
            return None

    @functools.cached_property
    def outside(self) -> np.ndarray:
        """True for lanes outside the model's domain, an array of the lanes' shape."""
        return self.lanes.outside()

    @functools.cached_property
    def blocks(self) -> list[np.ndarray]:
        """Flat numbers of the lanes of every block, without those outside the domain.

        Lanes are sorted by difficulty, or by what those of a chunk must share, and cut into
        chunks.  Every block gets chunks of all ranks, so that all blocks cost about the same.
        """
        inside = np.flatnonzero(~self.outside)
        order = inside[np.argsort(self._rank[inside], kind="stable")]
        width = width_of_chunks(self.lanes.scene, tuple(self.lanes.axes))
        chunks = -(-order.size // width)
        least = -(-LEAST // width)
        largest = min(max(-(-chunks // BLOCKS), least), BLOCK // width)
        count = -(-chunks // largest)
        rows = np.arange(width)
        numbers = (
            (np.arange(b, chunks, count)[:, None] * width + rows).ravel() for b in range(count)
        )
        return [order[n[n < order.size]] for n in numbers]

    @property
    def _rank(self) -> np.ndarray:
        """Rank of every lane in the order in which chunks are cut, (lanes,)."""
        shared = shared_keys(self.lanes.scene, tuple(self.lanes.axes))
        if not shared:
            return self.lanes.difficulty.ravel()
        columns = self.lanes.columns(np.arange(self.lanes.size))[shared]
        return np.unique(columns, axis=1, return_inverse=True)[1].ravel()

    def runner(self, devices: Sequence[Any] | None = None) -> Runner:
        """Runner with the model of this sweep, to be compiled."""
        lanes = self.lanes
        return Runner(lanes.scene, tuple(lanes.axes), self.figures, self.solver, devices)

    def size(self, share: Sequence[int]) -> int:
        """Number of lanes of these blocks."""
        return sum(self.blocks[number].size for number in share)

    def run(
        self,
        share: Sequence[int],
        runner: Runner,
        store: Store | None,
        tell: Tell,
        known: Mapping[int, Block],
    ) -> dict[int, Block]:
        """Run blocks and store each as it finishes.

        Parameters
        ----------
        share : numbers of the blocks
        runner : compiled model
        store : folder for finished blocks; None keeps them in memory only
        tell : is called with the number of lanes of every block that is finished
        known : blocks by number that are not run again

        Returns
        -------
        dict
            blocks by number, with the known ones.
        """
        found = dict(known)
        missing = [number for number in share if number not in found]
        abreast = len(runner.devices)
        for first in range(0, len(missing), abreast):
            numbers = missing[first : first + abreast]
            batches = [self.lanes.columns(self.blocks[number]) for number in numbers]
            for number, block in zip(numbers, runner(batches), strict=True):
                if store is not None:
                    store.save(number, block)
                found[number] = block
                tell(block.status.size)
        return found

    def stored(self, share: Sequence[int], store: Store) -> dict[int, Block]:
        """Blocks of a share that are in the store, by number."""
        done = store.done()
        figures = len(self.figures)
        loaded = {n: store.load(n, figures, self.blocks[n].size) for n in share if n in done}
        return {number: block for number, block in loaded.items() if block is not None}

    def collected(self, blocks: Mapping[int, Block]) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Figures by name and codes of `Outcome` of all lanes, arrays of the lanes' shape."""
        values = np.full((len(self.figures), self.lanes.size), np.nan, self.dtype)
        status = np.full(self.lanes.size, Outcome.OUTSIDE, np.int8)
        for number, block in blocks.items():
            lanes = self.blocks[number]
            values[:, lanes], status[lanes] = block
        shape = self.lanes.shape
        named = dict(zip(self.figures, values.reshape(-1, *shape), strict=True))
        return named, status.reshape(shape)

    # --- on paper -------------------------------------------------------------------------------

    def description(self) -> str:
        """Text that identifies the sweep, without the axes' values."""
        if self.scene is None:
            raise InputError(
                "out, processes: a scene with a function of your own cannot be put on disk: "
                "sweep it without them and write the table with to_csv"
            )
        width = width_of_chunks(self.lanes.scene, tuple(self.lanes.axes))
        about = {
            "version": version("jbeamshell"),
            "scene": self.scene,
            "keys": list(self.lanes.axes),
            "paired": self.lanes.paired,
            "figures": list(self.figures),
            "dtype": self.dtype.name,
            "solver": None if self.solver is None else dataclasses.asdict(self.solver),
            "layout": [BLOCKS, BLOCK, LEAST, width],
        }
        return json.dumps(about)


def read_job(store: Store) -> Job:
    """Job of the sweep for which a store was opened."""
    text, axes = store.read()
    about = json.loads(text)
    tables = tomllib.loads(about["scene"])
    flat = {f"{part}.{name}": v for part, table in tables.items() for name, v in table.items()}
    scene = jax.tree.map(lambda leaf: leaf.astype(about["dtype"]), scene_from_values(flat))
    solver = None if about["solver"] is None else Newton(**about["solver"])
    lanes = Lanes(scene, dict(zip(about["keys"], axes, strict=True)), about["paired"])
    return Job(lanes, tuple(about["figures"]), solver)

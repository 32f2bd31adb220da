"""Sweep as a job: lanes dealt into blocks, and their results collected."""

from __future__ import annotations

import dataclasses
import functools
import json
import tomllib
from collections.abc import Mapping
from importlib.metadata import version

import jax
import numpy as np

from jbeamshell.common.arrays import check_sum
from jbeamshell.common.errors import InputError
from jbeamshell.contact_line.interpolation import HEIGHT, POISSON
from jbeamshell.contact_line.shared import shares
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.toml import scene_from_values, scene_to_toml
from jbeamshell.sweeping.lanes import Lanes, Outcome
from jbeamshell.sweeping.runner import (
    BLOCK,
    BLOCKS,
    Block,
    Chunks,
    Runner,
    chunks_of,
    shared_keys,
)

LEAST = 8  # least lanes of a block that is worth a file
MANY_BODIES = 32  # lanes from which on interpolated bodies are quicker than bodies of their own


@dataclasses.dataclass(frozen=True)
class Job:
    """Sweep to be done.

    Attributes
    ----------
    lanes : lanes of the sweep, whose scene has the settings that serve all of them
    open : scene with the settings as they were given
    figures : attributes of `jbeamshell.History`
    solver : settings of Newton's method; None is the default
    """

    lanes: Lanes
    open: Scene
    figures: tuple[str, ...]
    solver: Newton | None = None

    @property
    def dtype(self) -> np.dtype:
        """Precision of the scene's numbers."""
        return np.dtype(self.lanes.scene.strip.length.dtype)

    @functools.cached_property
    def scenes(self) -> list[str]:
        """TOML of what is not varied, with settings for all and open; empty with own functions."""
        try:
            return [scene_to_toml(scene) for scene in (self.lanes.scene, self.open)]
        except InputError:
            return []

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
        width = self.chunks.width
        chunks = -(-order.size // width)
        least = -(-LEAST // width)
        largest = min(max(-(-chunks // BLOCKS), least), BLOCK // width)
        count = -(-chunks // largest)
        rows = np.arange(width)
        numbers = (
            (np.arange(b, chunks, count)[:, None] * width + rows).ravel() for b in range(count)
        )
        return [order[n[n < order.size]] for n in numbers]

    @functools.cached_property
    def chunks(self) -> Chunks:
        """Chunks of lanes that advance together."""
        inside = self._body[~self.outside.ravel()]
        scene, keys, ranges = self.lanes.scene, tuple(self.lanes.axes), self.ranges
        together = ranges is not None and shares(scene, keys, self.figures, ranges)
        return chunks_of(scene, np.unique(inside, return_counts=True)[1], together)

    @functools.cached_property
    def ranges(self) -> dict[str, tuple[float, float]] | None:
        """Least and most height ratio and Poisson's ratio; None for too few lanes to share."""
        inside = ~self.outside
        if np.count_nonzero(inside) < MANY_BODIES or self.lanes.scene.strip.layers is not None:
            return None
        values = {
            key: np.broadcast_to(np.asarray(self.lanes.value(key), float), inside.shape)[inside]
            for key in (HEIGHT, POISSON)
        }
        return {key: (float(own.min()), float(own.max())) for key, own in values.items()}

    @property
    def _rank(self) -> np.ndarray:
        """Rank of every lane in the order in which chunks are cut, (lanes,)."""
        alike = self.chunks.alike and self.chunks.width > 1
        return self._body if alike else self.lanes.difficulty.ravel()

    @functools.cached_property
    def _body(self) -> np.ndarray:
        """Number of the condensed body that each lane has, (lanes,)."""
        shared = shared_keys(self.lanes.scene, tuple(self.lanes.axes))
        columns = self.lanes.columns(np.arange(self.lanes.size))[shared]
        return np.unique(columns, axis=1, return_inverse=True)[1].ravel()

    def columns(self, number: int) -> np.ndarray:
        """Numbers of the lanes of a block, (keys, lanes)."""
        return self.lanes.columns(self.blocks[number])

    def sizes(self, number: int) -> tuple[int, int]:
        """Numbers of figures and lanes of a block."""
        return len(self.figures), self.blocks[number].size

    def runner(self) -> Runner:
        """Runner with the model of this sweep, to be compiled."""
        scenes, keys = (self.lanes.scene, self.open), tuple(self.lanes.axes)
        return Runner(scenes, keys, self.figures, self.chunks, self.solver, ranges=self.ranges)

    def collected(self, blocks: Mapping[int, Block]) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Figures by name and codes of `Outcome` of all lanes, arrays of the lanes' shape."""
        values = np.full((len(self.figures), self.lanes.size), np.nan, self.dtype)
        status = np.where(self.outside, Outcome.OUTSIDE, Outcome.NOT_RUN).astype(np.int8).ravel()
        for number, block in blocks.items():
            lanes = self.blocks[number]
            values[:, lanes], status[lanes] = block
        shape = self.lanes.shape
        named = dict(zip(self.figures, values.reshape(-1, *shape), strict=True))
        return named, status.reshape(shape)

    # --- on paper -------------------------------------------------------------------------------

    def mark(self) -> str:
        """Check sum that identifies the sweep, with the axes' values."""
        return check_sum(self.lanes.axes, self.description())

    def description(self) -> str:
        """Text from which a worker makes the runner."""
        if not self.scenes:
            raise InputError(
                "out, executor: a scene with a function of your own cannot be written down: sweep "
                "it without them"
            )
        about = {
            "version": version("jbeamshell"),
            "scenes": self.scenes,
            "keys": list(self.lanes.axes),
            "paired": self.lanes.paired,
            "figures": list(self.figures),
            "dtype": self.dtype.name,
            "solver": None if self.solver is None else dataclasses.asdict(self.solver),
            "ranges": self.ranges,
            "layout": [BLOCKS, BLOCK, LEAST, *self.chunks],
        }
        return json.dumps(about)


def runner_of(text: str) -> Runner:
    """Runner of the sweep with this description; raises `InputError` for one of another version."""
    about = json.loads(text)
    here = version("jbeamshell")
    if about["version"] != here:
        raise InputError(
            f"executor: its workers have jbeamshell {here}, this process {about['version']}: "
            "install the same version"
        )
    scene, own = (_scene_of(text, about["dtype"]) for text in about["scenes"])
    solver = None if about["solver"] is None else Newton(**about["solver"])
    *_, width, alike = about["layout"]
    ranges = about["ranges"] and {key: tuple(ends) for key, ends in about["ranges"].items()}
    asked = about["keys"], about["figures"], Chunks(width, alike), solver
    return Runner((scene, own), *asked, ranges=ranges)


def _scene_of(text: str, dtype: str) -> Scene:
    """Scene of a TOML text, its numbers in a precision."""
    tables = tomllib.loads(text)
    flat = {f"{part}.{name}": v for part, table in tables.items() for name, v in table.items()}
    scene: Scene = jax.tree.map(lambda leaf: leaf.astype(dtype), scene_from_values(flat))
    return scene

"""Template of scenes: what a compiled program knows of a scene, without the numbers it takes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from jax import Array

from jbeamshell.scene.scene import Scene


class Template(NamedTuple):
    """Scene without its numbers, so that scenes of one template share compiled programs.

    Attributes
    ----------
    tree : structure of the scene
    dtype : name of the numbers' type
    tables : tables by their place, which stay in the program because their rows may have a
        meaning; no traced ones
    """

    tree: Any
    dtype: str
    tables: tuple[tuple[int, str, tuple[int, ...], bytes], ...]

    @staticmethod
    def of(scene: Scene) -> tuple[Template, list[Array]]:
        """Template of a scene, and the numbers that it takes."""
        leaves, tree = jax.tree.flatten(scene)
        dtype = scene.strip.length.dtype
        tables, numbers = [], []
        for place, leaf in enumerate(leaves):
            number = np.ndim(leaf) == 0 and getattr(leaf, "dtype", None) == dtype
            if isinstance(leaf, jax.core.Tracer) or number:
                numbers.append(leaf)
            else:
                table = np.asarray(leaf)
                tables.append((place, table.dtype.name, table.shape, table.tobytes()))
        return Template(tree, dtype.name, tuple(tables)), numbers

    @property
    def numbers(self) -> int:
        """Count of the numbers that it takes."""
        return int(self.tree.num_leaves) - len(self.tables)

    def scene(self, numbers: Sequence[Any]) -> Scene:
        """Scene with these numbers."""
        leaves = list(numbers)
        for place, dtype, shape, data in self.tables:
            leaves.insert(place, np.frombuffer(data, dtype).reshape(shape))
        scene: Scene = jax.tree.unflatten(self.tree, leaves)
        return scene

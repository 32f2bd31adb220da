"""Search space of a fit: one axis for every value to be found, shared or of one specimen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.identify.models import Model
from jbeamshell.identify.parameters import RIG, Bijection, Parameter


class SearchSpace(NamedTuple):
    """Unbounded search space of a fit of one specimen or several, with n axes.

    Attributes
    ----------
    keys : (k,) dotted keys of the parameters
    names : (n,) names of the axes: the key, followed by the specimen's label in brackets if every
        specimen has a value of its own
    bijections : (n,) maps from the axes to the values
    table : (specimens, k) axis of each key of each specimen
    parameters : (n,) parameter behind each axis
    """

    keys: tuple[str, ...]
    names: tuple[str, ...]
    bijections: tuple[Bijection, ...]
    table: NDArray[np.int64]
    parameters: tuple[Parameter, ...]

    def values(self, point: ArrayLike) -> NDArray[np.float64]:
        """Parameters (n,) at a point (n,) of the search space."""
        pairs = zip(self.bijections, np.asarray(point), strict=True)
        return np.array([bijection.value(p) for bijection, p in pairs])

    def slopes(self, point: ArrayLike) -> NDArray[np.float64]:
        """Derivatives (n,) of the parameters with respect to the point (n,)."""
        pairs = zip(self.bijections, np.asarray(point), strict=True)
        return np.array([bijection.slope(p) for bijection, p in pairs])

    def point(self, values: ArrayLike) -> NDArray[np.float64]:
        """Point (n,) of the search space at given parameters (n,)."""
        pairs = zip(self.bijections, np.asarray(values), strict=True)
        return np.array([bijection.point(value) for bijection, value in pairs])

    def of(self, values: ArrayLike, specimen: int) -> dict[str, float]:
        """Values of one specimen's scene by key."""
        own = np.asarray(values)[self.table[specimen]]
        pairs = zip(self.keys, own.tolist(), strict=True)
        return {key: value for key, value in pairs if key not in RIG}

    def named(self, values: ArrayLike) -> dict[str, float]:
        """Values (n,) by the names of their axes."""
        return dict(zip(self.names, np.asarray(values).tolist(), strict=True))

    def boxed(self) -> tuple[SearchSpace, NDArray[np.float64]]:
        """Space on the same scales without bounds, and the bounds as a box (n, 2) in it."""
        pairs = [bijection.boxed() for bijection in self.bijections]
        free, boxes = zip(*pairs, strict=True)
        return self._replace(bijections=free), np.array(boxes)


def search_space(
    free: Sequence[Parameter], scenes: Mapping[str, Model]
) -> tuple[SearchSpace, dict[str, Model]]:
    """Search space of several specimens' parameters, and their scenes at its start.

    Parameters
    ----------
    free : parameters to fit, no key twice
    scenes : scene of each specimen by its label

    Raises
    ------
    InputError
        if a key is not a single number of a scene, if a start lies out of bounds, or if the scenes
        start a shared parameter at different values
    """
    given = {p.key: p.start for p in free if p.start is not None and p.key not in RIG}
    started = {label: scene.replace(given) for label, scene in scenes.items()}
    names: list[str] = []
    owners: list[Parameter] = []
    bijections: list[Bijection] = []
    columns: list[list[int]] = []
    for parameter in free:
        starts = [_start(scene, parameter) for scene in started.values()]
        if not parameter.each and len(set(starts)) > 1:
            low, high = min(starts), max(starts)
            raise InputError(
                f"free {parameter.key!r}: is shared, but the specimens start from {low:g} to "
                f"{high:g}: give one start, or each=True"
            )
        several = parameter.each and len(started) > 1
        labels = list(started) if several else [""]
        first = len(names)
        names += [f"{parameter.key}[{label}]" if label else parameter.key for label in labels]
        bijections += [parameter.bijection(start) for start in starts[: len(labels)]]
        owners += [parameter] * len(labels)
        columns.append([first + (i if several else 0) for i in range(len(started))])
    keys = tuple(parameter.key for parameter in free)
    table = np.array(columns).T
    return SearchSpace(keys, tuple(names), tuple(bijections), table, tuple(owners)), started


def _start(scene: Model, parameter: Parameter) -> float:
    key = parameter.key
    start: Any = parameter.start if key in RIG else scene.get(key)
    if start is None:
        raise InputError(f"free {key!r}: the scene has no value for it; give a start")
    if np.ndim(start) > 0:
        raise InputError(f"free {key!r}: is a table in this scene; only a single number can be fit")
    if not np.isfinite(start):
        raise InputError(f"free {key!r}: is 'sharp' in this scene; give a number such as 16")
    spread = -np.inf < parameter.bounds[0] < 0.0  # finite bounds around 0 give the search its scale
    if float(start) == 0.0 and not spread:
        raise InputError(f"free {key!r}: is 0 in this scene; give another number to start from")
    return float(start)

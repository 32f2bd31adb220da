"""Search space of a fit: one axis for every value to be found, shared or of one specimen."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike, NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.identify.models import Model
from jbeamshell.identify.parameters import RIG, Coordinate, Parameter
from jbeamshell.identify.specimens import Case


class SearchSpace(NamedTuple):
    """Unbounded search space of a fit of one specimen or several, with n axes.

    Attributes
    ----------
    keys : (k,) dotted keys of the parameters
    names : (n,) names of the axes: the key, followed by the specimen's label in brackets if every
        specimen has a value of its own
    coordinates : (n,) coordinate of each axis
    table : (specimens, k) axis of each key of each specimen
    parameters : (n,) parameter behind each axis
    """

    keys: tuple[str, ...]
    names: tuple[str, ...]
    coordinates: tuple[Coordinate, ...]
    table: NDArray[np.int64]
    parameters: tuple[Parameter, ...]

    def at(self, point: Any) -> tuple[Any, Any]:
        """Values (n,) at a point (n,), and their derivatives (n,); both may be traced."""
        pairs = [one.at(point[axis]) for axis, one in enumerate(self.coordinates)]
        stack = jnp.stack if isinstance(point, Array) else np.array
        values, slopes = zip(*pairs, strict=True)
        return stack(values), stack(slopes)

    def values(self, point: ArrayLike) -> NDArray[np.float64]:
        """Values (n,) at a point (n,)."""
        found: NDArray[np.float64] = self.at(np.asarray(point, dtype=float))[0]
        return found

    def slopes(self, point: ArrayLike) -> NDArray[np.float64]:
        """Derivatives (n,) of the values with respect to the point (n,)."""
        found: NDArray[np.float64] = self.at(np.asarray(point, dtype=float))[1]
        return found

    def point(self, values: ArrayLike) -> NDArray[np.float64]:
        """Point (n,) of given values (n,)."""
        pairs = zip(self.coordinates, np.asarray(values), strict=True)
        return np.array([one.of(x) for one, x in pairs])

    def bounds_at(self, point: ArrayLike) -> list[float | None]:
        """Bounds (n,) at which the values of a point ended; None for those that lie inside."""
        pairs = zip(self.coordinates, self.values(point).tolist(), strict=True)
        return [one.bound_at(x) for one, x in pairs]

    def of(self, values: ArrayLike, specimen: int) -> dict[str, float]:
        """Values of one specimen's scene by key."""
        own = np.asarray(values)[self.table[specimen]]
        pairs = zip(self.keys, own.tolist(), strict=True)
        return {key: value for key, value in pairs if key not in RIG}

    def named(self, values: ArrayLike) -> dict[str, float]:
        """Values (n,) by the names of their axes."""
        return dict(zip(self.names, np.asarray(values).tolist(), strict=True))


def search_space(
    free: Sequence[Parameter], cases: Sequence[Case]
) -> tuple[SearchSpace, list[Case]]:
    """Search space of several specimens' parameters, and the cases at its start.

    Raises
    ------
    InputError
        if a key is not a single number of a scene, if a start lies out of bounds, or if the scenes
        start a shared parameter at different values
    """
    given = {p.key: p.start for p in free if p.start is not None and p.key not in RIG}
    started = [case._replace(model=case.model.replace(given)) for case in cases]
    names: list[str] = []
    owners: list[Parameter] = []
    coordinates: list[Coordinate] = []
    columns: list[list[int]] = []
    for parameter in free:
        starts = [_start(case.model, parameter) for case in started]
        if not parameter.each and len(set(starts)) > 1:
            low, high = min(starts), max(starts)
            raise InputError(
                f"free {parameter.key!r}: is shared, but the specimens start from {low:g} to "
                f"{high:g}: give one start, or each=True"
            )
        several = parameter.each and len(started) > 1
        labels = [case.label for case in started] if several else [""]
        first = len(names)
        names += [f"{parameter.key}[{label}]" if label else parameter.key for label in labels]
        coordinates += [parameter.coordinate(start) for start in starts[: len(labels)]]
        owners += [parameter] * len(labels)
        columns.append([first + (i if several else 0) for i in range(len(started))])
    keys = tuple(parameter.key for parameter in free)
    table = np.array(columns).T
    return SearchSpace(keys, tuple(names), tuple(coordinates), table, tuple(owners)), started


def _start(model: Model, parameter: Parameter) -> float:
    key = parameter.key
    start: Any = parameter.start if key in RIG else model.get(key)
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

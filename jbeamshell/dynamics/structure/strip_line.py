"""Backbones of a strip's pull and push: the corners of its network's lines, or load steps."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from jbeamshell.common.jax_options import ONCE
from jbeamshell.condensed.network import Network, Sliders
from jbeamshell.quasistatic.solver import solve
from jbeamshell.scene.scene import Scene

POINTS = 48  # of a backbone that is walked
SMALLEST_FORCE = 1e-2  # its first point, over the largest force
BELOW = 1.0 - 1e-6  # thresholds nearer to the largest force are left out


def mean_of(pull: Any, push: Any) -> tuple[Any, Any]:
    """Mean of two displacements, and the largest difference from it over the mean."""
    mean = 0.5 * (pull + push)
    return mean, jnp.max(jnp.abs(0.5 * (pull - push) / mean))


def slider_line(scene: Scene, force: Array, soft: bool) -> tuple[Network, Array, Array, Array]:
    """Network, backbones (2, k + 1) of pull and push, and their count of points below the force.

    The points are the means of the thresholds, and the force; those beyond are laid evenly on the
    straight line from the last one below it.  The displacements are NaN where the slip zones are
    not nested.
    """
    network = Network.of(scene, soft)
    ways = jnp.asarray([1.0, -1.0])
    sides = jax.vmap(lambda way: network.sliders(network.rest, way))(ways)
    levels = jnp.mean(sides.force, axis=0)[1:]
    below = levels < BELOW * force
    count, last = jnp.sum(below), jnp.max(jnp.where(below, levels, 0.0), initial=0.0)
    number = jnp.arange(levels.size)
    part = (number + 1 - count) / (levels.size + 1 - count)

    def points(inside: Array, begin: Array, end: Array) -> Array:
        return jnp.append(jnp.where(number < count, inside, begin + (end - begin) * part), end)

    def line(side: Sliders) -> Array:
        return points(*map(side.displacement_after, (levels, last, force)))

    f, u = points(levels, last, force), jax.vmap(line)(sides)
    nested = jax.vmap(lambda way: network.branch(network.rest, way * force)[2])(ways)
    rising = jnp.all(jnp.diff(f, prepend=0.0) > 0.0)
    return network, jnp.where(jnp.all(nested) & rising, u, jnp.nan), f, count


slider_line_once = jax.jit(slider_line, static_argnums=2, compiler_options=ONCE)


def walked_line(
    scene: Scene, force: float, width: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], float, NDArray[np.float64]]:
    """Backbone of load steps, its asymmetry, and the displacements (2, k) of pull and push."""
    levels = np.geomspace(SMALLEST_FORCE * force, force, POINTS)
    ways = (1.0, -1.0)
    sides = [way * np.asarray(solve(scene, way * levels).displacement)[-POINTS:] for way in ways]
    mean, asymmetry = mean_of(*sides)
    u, f = _softening(mean, width * levels)
    kept = np.isin(mean, u)
    return u, f, float(asymmetry), np.stack(sides)[:, kept]


def walked_forces(scene: Scene, path: NDArray[np.float64]) -> Array:
    """Forces (T,) per width of a scene on its contact line, walked event by event."""
    size = max(float(np.max(np.abs(path), initial=0.0)), np.finfo(float).tiny)
    driven = scene.replace({"load.control": "displacement", "load.amplitude": size})
    return solve(driven, path).force[-path.size :]


def _softening(
    u: NDArray[np.float64], f: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points of the concave hull of a backbone; sliders cannot stiffen."""
    kept = [(0.0, 0.0)]
    for point in zip(u, f, strict=True):
        while len(kept) > 1 and _slope(kept[-2], kept[-1]) <= _slope(kept[-1], point):
            kept.pop()
        kept.append(point)
    x, y = np.array(kept[1:]).T
    return x, y


def _slope(a: tuple[float, float], b: tuple[float, float]) -> float:
    return (b[1] - a[1]) / (b[0] - a[0])

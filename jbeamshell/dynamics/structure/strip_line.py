"""Backbones of a strip: the corners of its network's lines, or nearest to its steady cycles."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import NDArray

from jbeamshell.common.checks import is_traced, require
from jbeamshell.common.jax_options import ONCE
from jbeamshell.condensed.network import Network, Response, Sliders
from jbeamshell.dynamics.steady_cycles import SteadyCycles
from jbeamshell.quasistatic.solver import solve
from jbeamshell.scene.scene import Scene

# Amplitudes of steady cycles, over the largest
AMPLITUDES = np.append(np.geomspace(0.05, 0.4, 16), np.linspace(0.4, 1.0, 17)[1:])
LEAST = 1e-7  # energy of a cycle that matters, over F u
BELOW = 1.0 - 1e-6  # thresholds nearer to the largest force are left out


def mean_of(pull: Any, push: Any) -> tuple[Any, Any]:
    """Mean of two displacements, and the largest difference from it over the mean."""
    mean = 0.5 * (pull + push)
    return mean, jnp.max(jnp.abs(0.5 * (pull - push) / mean))


def slider_line(scene: Scene, force: Array, soft: bool) -> tuple[Network, Array, Array, Array]:
    """Network, backbones (2, k + 1) of pull and push, and their count of points below the force.

    The points are the means of the thresholds, and the force; those beyond are laid evenly on the
    straight line from the last one below it.  The displacements are NaN where the slip zones are
    not nested, and for a joint with bearings.
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
    series = scene.contact.bearing_stiffness is None  # a bearing is no slider
    return network, jnp.where(jnp.all(nested) & rising & series, u, jnp.nan), f, count


slider_line_once = jax.jit(slider_line, static_argnums=2, compiler_options=ONCE)


def cycled_line(scene: Scene, force: Array, width: Any) -> tuple[Array, Array, Array, Array]:
    """Backbone whose loops by Masing's rule are nearest to a scene's steady cycles.

    A slider in series with compliance c_i and threshold F_i adds c_i (F - F_i) to the displacement
    at an amplitude F, and 4 c_i F_i (F - F_i) to the energy of a cycle.  The c_i >= 0 that are
    nearest to both at all amplitudes, in relative squares, need no further condition.  Derivatives
    take the amplitudes as fixed: they sample the backbone, and it is the same for others.

    Returns
    -------
    (k,) displacements and forces, the asymmetry of first loading, and the displacements (2, k) of
    pull and push in it; NaN where a traced scene has no equilibrium
    """
    levels = lax.stop_gradient(force) * jnp.asarray(AMPLITUDES)
    throw = not is_traced(scene, force, jnp.zeros(()))
    ways = (1.0, -1.0)
    sides = [way * solve(scene, way * levels, throw=throw).displacement for way in ways]
    sides = [side[-levels.size :] for side in sides]
    cycles = SteadyCycles.of(scene, levels)
    u, loss = cycles.displacement, cycles.dissipation
    d = jnp.maximum(loss, LEAST * levels * u)
    thresholds = jnp.append(0.0, levels[:-1])
    beyond = jnp.maximum(levels[:, None] - thresholds, 0.0)
    rows = jnp.vstack([beyond / u[:, None], 4.0 * thresholds * beyond / d[:, None]])
    scale = jnp.max(rows, axis=0)
    parts = not_negative(rows / scale, jnp.append(jnp.ones(u.size), loss / d))
    return beyond @ (parts / scale), width * levels, mean_of(*sides)[1], jnp.stack(sides)


def not_negative(matrix: Array, target: Array) -> Array:
    """Least-squares solution (k,) that is not negative, with derivatives; NaN for NaN.

    Parameters
    ----------
    matrix : (rows, k) of full rank
    target : (rows,)
    """
    count, given = matrix.shape[1], map(lax.stop_gradient, (matrix, target))
    shape = jax.ShapeDtypeStruct((count,), bool)
    active = jax.pure_callback(_active, shape, *given, vmap_method="sequential")
    # The others are zero, each by a row of its own, so that the factorisation keeps its rank.
    whole = jnp.vstack([jnp.where(active, matrix, 0.0), jnp.diag(jnp.where(active, 0.0, 1.0))])
    q, r = jnp.linalg.qr(whole)
    return jax.scipy.linalg.solve_triangular(r, q.T @ jnp.append(target, jnp.zeros(count)))


def _active(matrix: Any, target: Any) -> NDArray[np.bool_]:
    """True for the positive entries of the solution, by Lawson and Hanson's method."""
    from scipy.optimize import nnls  # slow to import

    rows, wanted = np.asarray(matrix, float), np.asarray(target, float)
    if not (np.all(np.isfinite(rows)) and np.all(np.isfinite(wanted))):
        return np.ones(rows.shape[1], bool)
    return np.asarray(nnls(rows, wanted)[0] > 0.0)


def walked_forces(scene: Scene, path: NDArray[np.float64]) -> Array:
    """Forces (T,) per width of a scene on its contact line, walked event by event."""
    size = max(float(np.max(np.abs(path), initial=0.0)), np.finfo(float).tiny)
    driven = scene.replace({"load.control": "displacement", "load.amplitude": size})
    return solve(driven, path).force[-path.size :]


def network_forces(network: Network, path: NDArray[np.float64]) -> Array:
    """Forces (T,) per width of a network on a path (T,) of displacements."""
    found = _along(network, jnp.asarray(path))
    reached, limit = jnp.max(jnp.abs(found.state.force), initial=0.0), network.gross_slip
    fix = f"must stay below gross slip, mu F_N L = {float(limit):.6g} per width"
    require("force on the path", float(reached), bool(reached < limit), fix)
    first = int(np.argmin(found.valid))
    nested = bool(np.all(np.asarray(found.valid)))
    fix = "slip zones are not nested from here on: take jbeamshell.condensed.solve"
    require(f"path[{first}]", path[first], nested, fix)
    return found.state.force


@jax.jit
def _along(network: Network, path: Array) -> Response:
    return network.along(path)

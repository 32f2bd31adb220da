"""Backbones of a strip: the corners of its network's lines, or nearest to its steady cycles."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import NDArray

from jbeamshell.common.checks import is_traced, require
from jbeamshell.common.failed import nan_unless
from jbeamshell.common.jax_options import ONCE
from jbeamshell.contact_line.network import Network, Response, Sliders
from jbeamshell.scene.scene import Scene
from jbeamshell.solving.solve import run
from jbeamshell.solving.steady_cycles import steady_cycles

# Amplitudes of steady cycles, over the largest
AMPLITUDES = np.append(np.geomspace(0.05, 0.4, 16), np.linspace(0.4, 1.0, 17)[1:])
LEAST = 1e-7  # energy of a cycle that matters, over F u
ROUNDING = 10.0  # slope of the squares below which another entry is not tried, over rounding
BELOW = 1.0 - 1e-6  # thresholds nearer to the largest force are left out


def slider_line(scene: Scene, force: Array) -> tuple[Network, tuple[Array, ...]]:
    """Network and backbone of a scene.

    The backbone is the displacements (2, k + 1) of pull and push, the forces (k + 1,), and the
    count of points below the force.  The points are the means of the thresholds, and the force;
    those beyond are laid evenly on the straight line from the last one below it.  The displacements
    are NaN where the slip zones are not nested, and for a joint with bearings.
    """
    network = Network.of(scene)
    ways = jnp.asarray([1.0, -1.0])
    branches = jax.vmap(lambda way: network.sliders(network.rest, way))(ways)
    levels = jnp.mean(branches.force, axis=0)[1:]
    below = levels < BELOW * force
    count = jnp.sum(below)
    last = jnp.where(count > 0, levels[jnp.maximum(count - 1, 0)], 0.0)
    number = jnp.arange(levels.size)
    part = (number + 1 - count) / (levels.size + 1 - count)

    def points(inside: Array, begin: Array, end: Array) -> Array:
        return jnp.append(jnp.where(number < count, inside, begin + (end - begin) * part), end)

    def line(side: Sliders) -> Array:
        return points(*map(side.displacement_after, (levels, last, force)))

    f, u = points(levels, last, force), jax.vmap(line)(branches)
    nested = jax.vmap(lambda way: network.branch(network.rest, way * force)[2])(ways)
    rising = jnp.all(jnp.diff(f, prepend=0.0) > 0.0)
    series = scene.member.bearing_stiffness is None  # a bearing is no slider
    return network, (nan_unless(jnp.all(nested) & rising & series, u), f, count)


slider_line_once = jax.jit(slider_line, compiler_options=ONCE)


def cycled_line(scene: Scene, force: Array) -> tuple[Array, Array, Array]:
    """Backbone whose loops by Masing's rule are nearest to a scene's steady cycles.

    A slider in series with compliance c_i and threshold F_i adds c_i (F - F_i) to the displacement
    at an amplitude F, and 4 c_i F_i (F - F_i) to the energy of a cycle.  The c_i >= 0 that are
    nearest to both at all amplitudes, in relative squares, need no further condition.

    Returns
    -------
    (k,) displacements and forces, and the displacements (2, k) of a first pull and push; NaN where
    a traced scene has no equilibrium
    """
    levels = force * jnp.asarray(AMPLITUDES)
    throw = not is_traced(scene, force, jnp.zeros(()))
    ways = (1.0, -1.0)
    sides = [way * run(scene, way * levels, throw=throw).displacement for way in ways]
    sides = [side[-levels.size :] for side in sides]
    cycles = steady_cycles(scene, levels)
    u, loss = cycles.displacement, cycles.dissipation
    d = jnp.maximum(loss, LEAST * levels * u)
    thresholds = jnp.append(0.0, levels[:-1])
    beyond = jnp.maximum(levels[:, None] - thresholds, 0.0)
    rows = jnp.vstack([beyond / u[:, None], 4.0 * thresholds * beyond / d[:, None]])
    # Compiled twice, a largest number may differ by rounding from all, and its derivative is NaN.
    scale = lax.stop_gradient(jnp.max(rows, axis=0))
    parts = not_negative(rows / scale, jnp.append(jnp.ones(u.size), loss / d))
    return beyond @ (parts / scale), levels, jnp.stack(sides)


def not_negative(matrix: Array, target: Array) -> Array:
    """Least-squares solution (k,) that is not negative, with derivatives; NaN for NaN.

    Parameters
    ----------
    matrix : (rows, k) of full rank
    target : (rows,)
    """
    fixed, wanted = lax.stop_gradient((matrix, target))
    active = _active if is_traced(matrix, target, jnp.zeros(())) else _active_once
    return _among(matrix, target, active(fixed, wanted))


def _among(matrix: Array, target: Array, active: Array) -> Array:
    """Least-squares solution (k,) whose other entries than the active ones are zero."""
    count = matrix.shape[1]
    # The others are zero, each by a row of its own, so that the factorisation keeps its rank.
    whole = jnp.vstack([jnp.where(active, matrix, 0.0), jnp.diag(jnp.where(active, 0.0, 1.0))])
    q, r = jnp.linalg.qr(whole)
    return jax.scipy.linalg.solve_triangular(r, q.T @ jnp.append(target, jnp.zeros(count)))


def _active(matrix: Array, target: Array) -> Array:
    """True for the positive entries (k,) of the solution, by Lawson and Hanson's method (1974)."""
    count = matrix.shape[1]
    least = ROUNDING * jnp.finfo(matrix.dtype).eps * jnp.linalg.norm(target)
    State = tuple[Array, Array, Array]

    def pull(x: Array) -> Array:
        return matrix.T @ (target - matrix @ x)

    def open_(state: State) -> Array:
        x, active, turn = state
        wanted = jnp.any(jnp.where(active, 0.0, pull(x)) > least)
        return wanted & (turn < 3 * count)

    def more(state: State) -> State:
        x, active, turn = state
        active = active.at[jnp.argmax(jnp.where(active, -jnp.inf, pull(x)))].set(True)

        def negative(inner: State) -> Array:
            _, active, s = inner
            return jnp.any(active & (s <= 0.0))

        def less(inner: State) -> State:
            x, active, s = inner
            out = active & (s <= 0.0)
            parts = jnp.where(out, x / jnp.where(out, x - s, 1.0), jnp.inf)
            part = jnp.min(parts)
            x = x + part * (s - x)
            active = active & ~(out & (parts <= part))
            x = jnp.where(active, x, 0.0)
            return x, active, _among(matrix, target, active)

        begin = x, active, _among(matrix, target, active)
        _, active, x = lax.while_loop(negative, less, begin)
        return x, active, turn + 1

    start = jnp.zeros(count, matrix.dtype), jnp.zeros(count, bool), jnp.zeros((), int)
    return lax.while_loop(open_, more, start)[1]


_active_once = jax.jit(_active)


def walked_forces(scene: Scene, path: NDArray[np.float64]) -> Array:
    """Forces (T,) per width of a scene on its contact line, walked event by event."""
    size = max(float(np.max(np.abs(path), initial=0.0)), np.finfo(float).tiny)
    driven = scene.replace({"load.control": "displacement", "load.amplitude": size})
    return run(driven, path).force[-path.size :]


def network_forces(network: Network, path: NDArray[np.float64]) -> Array:
    """Forces (T,) per width of a network on a path (T,) of displacements."""
    found = _along(network, jnp.asarray(path))
    reached, limit = jnp.max(jnp.abs(found.state.force), initial=0.0), network.gross_slip
    fix = f"must stay below gross slip, mu F_N L = {float(limit):.6g} per width"
    require("force on the path", float(reached), bool(reached < limit), fix)
    first = int(np.argmin(found.valid))
    nested = bool(np.all(np.asarray(found.valid)))
    fix = "slip zones are not nested from here on: take jbeamshell.contact_line.solve"
    require(f"path[{first}]", path[first], nested, fix)
    return found.state.force


@jax.jit
def _along(network: Network, path: Array) -> Response:
    return network.along(path)

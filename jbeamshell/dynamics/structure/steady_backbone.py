"""Backbone of sliders whose loops are nearest to the steady cycles of a scene; its own paths."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import NDArray

from jbeamshell.common.checks import is_traced
from jbeamshell.scene.scene import Scene
from jbeamshell.solving.solve import run
from jbeamshell.solving.steady_cycles import steady_cycles

# Amplitudes of steady cycles, over the largest; every second one is that of a slider.  Where D
# rises with the power n of the force, the chord between two sliders that are apart by a factor r is
# off by n (n - 1) ln(r)^2 / 16 to both sides: above .08 .02 % for Goodman's n = 3, and 1.1 % for
# 17, as where short slip is just beginning; below it .2 % for 3 and 1.4 % for 7.
AMPLITUDES = np.append(np.geomspace(0.02, 0.08, 41)[:-1], np.geomspace(0.08, 1.0, 199))
SLIDERS = AMPLITUDES[::2].size
LEAST = 1e-12  # energy of a cycle that matters, over F u
ROUNDING = 10.0  # slope of the squares below which another entry is not tried, over rounding


def steady_backbone(scene: Scene, force: Array) -> tuple[Array, Array, Array]:
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
    sides = [way * run(scene, way * levels[::2], throw=throw).displacement for way in ways]
    sides = [side[-SLIDERS:] for side in sides]
    cycles = steady_cycles(scene, levels)
    u, loss = cycles.displacement, cycles.dissipation
    # Losses of small loads that are but noise, such as negative ones, weigh little.
    d = jnp.maximum(lax.cummax(jnp.abs(loss)), LEAST * levels * u)
    corners = levels[::2]
    thresholds = jnp.append(0.0, corners[:-1])
    beyond = jnp.maximum(levels[:, None] - thresholds, 0.0)
    rows = jnp.vstack([beyond / u[:, None], 4.0 * thresholds * beyond / d[:, None]])
    # Compiled twice, a largest number may differ by rounding from all, and its derivative is NaN.
    scale = lax.stop_gradient(jnp.max(rows, axis=0))
    parts = not_negative(rows / scale, jnp.append(jnp.ones(u.size), loss / d))
    return (beyond @ (parts / scale))[::2], corners, jnp.stack(sides)


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
    gram, right = matrix.T @ matrix, matrix.T @ target  # rounding may cost an entry next to zero
    least = ROUNDING * jnp.finfo(matrix.dtype).eps * jnp.linalg.norm(target)
    State = tuple[Array, Array, Array]

    def pull(x: Array) -> Array:
        return right - gram @ x

    def among(active: Array) -> Array:
        part = jnp.where(active & active[:, None], gram, jnp.eye(count, dtype=gram.dtype))
        return jnp.linalg.solve(part, jnp.where(active, right, 0.0))

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
            return x, active, among(active)

        begin = x, active, among(active)
        _, active, x = lax.while_loop(negative, less, begin)
        return x, active, turn + 1

    start = jnp.zeros(count, matrix.dtype), jnp.zeros(count, bool), jnp.zeros((), int)
    return lax.while_loop(open_, more, start)[1]


_active_once = jax.jit(_active)


def walked_forces(scene: Scene, path: NDArray[np.float64]) -> Array:
    """Forces (T,) of a scene on its contact line, walked event by event."""
    size = max(float(np.max(np.abs(path), initial=0.0)), np.finfo(float).tiny)
    driven = scene.replace({"load.control": "displacement", "load.amplitude": size})
    return run(driven, path).force[-path.size :]

"""Load steps of a contact on a face as a program of JAX, of which numbers may be traced."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax

from jbeamshell.bodies.face import Face, Sticking
from jbeamshell.bodies.face_path import (
    MOST_CYCLES,
    Path,
    Steps,
    cycle_of,
    ends,
    first_steps,
    nothing_yet,
    pressed,
    steps_of,
)


@eqx.filter_jit
def traced_levels(
    face: Face, loads: Array, half: int | None, frictional: bool, driven: bool
) -> tuple[Steps, Array]:
    """Levels of a path, and the number of cycles until it is steady.

    There always are `MOST_CYCLES`: those after the first steady one are not taken, and the path
    rests at its amplitude before the first of the others.

    Parameters
    ----------
    face : bodies and points
    loads, half, frictional, driven : as `jbeamshell.bodies.face_path.levels_of` takes them
    """
    bodies = face, Sticking.of(lax.stop_gradient(face))
    begin, start = nothing_yet(face), jnp.zeros(())
    if half is None:
        last, path = first_steps(loads, frictional, driven)
        begun, _ = steps_of(bodies, begin, start, path)
        others = jax.tree.map(lambda a: a[last:], begun)
        return _joined(pressed(begun, last), others), jnp.asarray(0)
    rise, length = 1 + half // 2, 2 * half
    # Each loop compiles for seconds: that of the pressing and the rise takes the cycles too.
    rests = jnp.broadcast_to(loads[rise - 1], (length, loads.shape[1]))
    last, path = first_steps(jnp.concatenate([loads[:rise], rests]), frictional, driven)
    path = jax.tree.map(lambda a: a[:length], path)
    cycle = cycle_of(loads[rise : rise + length], driven)
    begun, taken, count = _until_steady(bodies, (begin, start), (path, cycle))
    rising = jax.tree.map(lambda a: a[last : last + rise - 1], begun)
    return _joined(pressed(begun, last), rising, taken), count


def _joined(*parts: Steps) -> Steps:
    """Steps one after the other."""
    found: Steps = jax.tree.map(lambda *a: jnp.concatenate(a), *parts)
    return found


def _until_steady(
    bodies: tuple[Face, Sticking],
    begin: tuple[Steps, Array],
    paths: tuple[Path, Path],
) -> tuple[Steps, Steps, Array]:
    """Levels up to the first cycle, levels of all cycles, and the number of those that were taken.

    Parameters
    ----------
    begin : level before the pressing, and displacement of the load
    paths : up to the first cycle, and of each cycle, with as many steps
    """
    length = len(paths[0].rub)
    first, cycle = (jax.tree.map(jnp.asarray, path) for path in paths)

    def go(
        carry: tuple[Steps, Array, Array], number: Array
    ) -> tuple[tuple[Steps, Array, Array], tuple[Steps, Array]]:
        before, start, steady = carry

        def taken() -> tuple[Steps, Array]:
            path = jax.tree.map(lambda a, b: jnp.where(number == 0, a, b), first, cycle)
            return steps_of(bodies, jax.tree.map(lambda a: a[-1], before), start, path)

        now, start = lax.cond(steady, lambda: (before, start), taken)
        last = ends(jax.tree.map(lambda a: a[-1], before), now) & (number > 0)
        return (now, start, steady | last), (now, steady)

    still = jax.tree.map(lambda a: jnp.broadcast_to(a, (length, *a.shape)), begin[0])
    carry = still, begin[1], jnp.asarray(False)
    _, (blocks, copied) = lax.scan(go, carry, jnp.arange(1 + MOST_CYCLES))
    count = jnp.sum(~copied) - 1
    # Those that were taken come last: the last cycle of a traced path is that of a plain one.
    number = 1 + jnp.arange(MOST_CYCLES) - (MOST_CYCLES - count)
    rests = (number < 1).reshape(-1, 1)

    def in_order(levels: Array) -> Array:
        chosen = levels[jnp.maximum(number, 0)]
        resting = rests.reshape(-1, *[1] * (levels.ndim - 1))
        chosen = jnp.where(resting, levels[0, -1], chosen)
        return chosen.reshape(-1, *levels.shape[2:])

    return jax.tree.map(lambda a: a[0], blocks), jax.tree.map(in_order, blocks), count

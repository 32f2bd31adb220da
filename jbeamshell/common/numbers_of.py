"""NumPy or JAX, by the arrays that are given.

What is found once for a scene takes JAX a second to compile and NumPy some milliseconds.  Code that
takes its functions from `numbers_of` (``xp``, the usual name) runs in both: in JAX within a
transformation, in NumPy elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jbeamshell.common.checks import is_traced

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")


def numbers_of(*values: object) -> Any:
    """Module of array functions: `jax.numpy` if any array of some pytrees is JAX's, else NumPy."""
    if all(isinstance(value, np.ndarray | np.generic) for value in values):  # soon known
        return np
    return jnp if any(isinstance(leaf, jax.Array) for leaf in jax.tree.leaves(values)) else np


def plain(tree: T) -> T:
    """Pytree with arrays of NumPy in place of JAX's; as it is if one of them is traced."""
    if is_traced(tree):
        return tree
    found: T = jax.tree.map(lambda a: np.asarray(a) if isinstance(a, jax.Array) else a, tree)
    return found


def put(array: Any, place: Any, values: Any) -> Any:
    """Copy of an array with values at a place, an index."""
    if numbers_of(array, values) is jnp:
        return jnp.asarray(array).at[place].set(values)
    copy = np.array(array)
    copy[place] = values
    return copy


def pad(array: Any, *widths: tuple[int, int]) -> Any:
    """Array with zeros around it, so many before and after it along each axis."""
    if numbers_of(array) is jnp:
        return jnp.pad(array, widths)
    # NumPy's own takes ten times as long.
    axes = list(zip(array.shape, widths, strict=True))
    wide = np.zeros([size + sum(width) for size, width in axes], array.dtype)
    wide[tuple(slice(before, before + size) for size, (before, _) in axes)] = array
    return wide


def summed(values: Any, places: Any, size: int) -> Any:
    """Sums (..., size) of the values (..., *places.shape) that have the same place."""
    shape = *values.shape[: values.ndim - places.ndim], size
    if numbers_of(values) is jnp:
        return jnp.zeros(shape).at[..., places].add(values)
    rows = values.reshape(-1, places.size)
    sums = [np.bincount(places.ravel(), row, minlength=size) for row in rows]
    return np.stack(sums).reshape(shape)


def cond(holds: Any, one: Callable[[], T], other: Callable[[], T]) -> T:
    """Value of one function where a truth holds, else of the other; see `jax.lax.cond`."""
    if numbers_of(holds) is jnp:
        found: T = lax.cond(holds, one, other)
        return found
    return one() if holds else other()


def scan(
    step: Callable[[Any, Any], tuple[Any, Any]], carry: Any, inputs: Any, *, reverse: bool = False
) -> tuple[Any, Any]:
    """Last carry of a loop over inputs, and what its steps gave, stacked; see `jax.lax.scan`.

    Parameters
    ----------
    step : function of the carry and of one input, which returns the next carry and what is stacked
    carry, inputs : pytrees, the latter of arrays (steps, ...)
    reverse : True to start with the last input
    """
    if numbers_of(carry, inputs) is jnp:
        return lax.scan(step, carry, inputs, reverse=reverse)
    leaves, tree = jax.tree.flatten(inputs)
    order, made = range(len(leaves[0])), []
    for i in reversed(order) if reverse else order:
        carry, out = step(carry, jax.tree.unflatten(tree, [leaf[i] for leaf in leaves]))
        made.append(out)
    return carry, jax.tree.map(lambda *parts: np.stack(parts), *(made[::-1] if reverse else made))


def while_loop(unfinished: Callable[[Any], Any], step: Callable[[Any], Any], start: Any) -> Any:
    """Last state of a loop that starts with ``start``; see `jax.lax.while_loop`."""
    if numbers_of(start) is jnp:
        return lax.while_loop(unfinished, step, start)
    while unfinished(start):
        start = step(start)
    return start


def without_slopes(values: T) -> T:
    """Pytree of numbers whose derivatives are zero; see `jax.lax.stop_gradient`."""
    return values if numbers_of(values) is np else jax.tree.map(lax.stop_gradient, values)


def quiet(function: Callable[P, R]) -> Callable[P, R]:
    """Function in which NumPy does not warn of overflow and of 0/0, as JAX does not."""
    return np.errstate(all="ignore")(function)

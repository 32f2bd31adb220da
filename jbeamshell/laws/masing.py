r"""Masing's law: loops are the backbone doubled, along any history (Masing 1926, Madelung 1905).

A branch that starts at the turn (u_k, F_k) is F = F_k + 2 f((u - u_k)/2) of the backbone f.  Where
it meets the turn before, both turns are forgotten, and the branch before them goes on.  A branch
that passes the mirror image of the first turn goes on along the backbone.  The memory is thus the
list of the turns that are not forgotten.

Parallel Jenkins elements are such a law for any distribution of their slip (Iwan 1966).

References
----------
Iwan, W. D. (1966). A distributed-element model for hysteresis and its steady-state dynamic
    response. J. Appl. Mech. 33, 893-900.
Madelung, E. (1905). Ueber Magnetisierung durch schnellverlaufende Stroeme. Ann. Phys. 17, 861-890.
Masing, G. (1926). Eigenspannungen und Verfestigung beim Messing. Proc. 2nd Int. Congress of
    Applied Mechanics, Zurich, 332-335.
"""

from __future__ import annotations

import abc
from collections.abc import Callable
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced
from jbeamshell.laws.law import Law, as_path

SIZES = 8  # depths of the memory are multiples of this, so that paths share a compiled program


class Memory(NamedTuple):
    """Turns of a path that are not forgotten, with its present point.

    Attributes
    ----------
    along : (depth,) driven column at the turns; those from ``held`` on are not used
    answer : (depth,) answering column there
    held : number of turns
    sense : sense of the present branch, 1 or -1
    now : driven and answering column of the present point
    """

    along: Array
    answer: Array
    held: Array
    sense: Array
    now: tuple[Array, Array]

    @classmethod
    def at_rest(cls, depth: int, like: Array) -> Memory:
        """Memory of a joint that has never been loaded."""
        zero = jnp.zeros((), like.dtype)
        empty = jnp.zeros(depth, like.dtype)
        return cls(empty, empty, jnp.zeros((), int), zero, (zero, zero))

    def moved(self, target: Array, backbone: Callable[[Array], Array]) -> Memory:
        """Memory after a straight way to a target of the driven column."""
        here, answer = self.now
        way = jnp.sign(target - here)
        way = jnp.where(way == 0.0, self.sense, way)
        turned = way * self.sense < 0.0
        place = jnp.arange(self.along.size)
        new = turned & (place == self.held)
        along, answers = jnp.where(new, here, self.along), jnp.where(new, answer, self.answer)
        # Mirror image of the first turn, beyond which the path is on the backbone again.
        before = jnp.concatenate([-along[:1], along[:-1]])
        facing = (place < self.held + turned) & (way * (before - along) > 0.0)
        inside = facing & (way * (target - before) < 0.0)
        count = jnp.max(jnp.where(inside, place + 1, 0))
        last = jnp.maximum(count - 1, 0)
        half = jnp.where(count > 0, 0.5 * (target - along[last]), target)
        doubled = answers[last] + 2.0 * backbone(half)
        reached = jnp.where(count > 0, doubled, backbone(half))
        return Memory(along, answers, count, way, (target, reached))


def along_path(points: Array, backbone: Callable[[Array], Array], depth: int) -> Array:
    """Answering column (T,) on a path (T,) of the driven one, from rest, by Masing's rule.

    Parameters
    ----------
    points : (T,) path
    backbone : answer on first loading
    depth : most turns that are remembered
    """

    def go(memory: Memory, target: Array) -> tuple[Memory, Array]:
        moved = memory.moved(target, backbone)
        return moved, moved.now[1]

    return lax.scan(go, Memory.at_rest(depth, points), points)[1]


class MasingLaw(Law):
    """Law that follows Masing's rule; a subclass implements `backbone` and `work`."""

    masing: ClassVar[bool] = True
    by_force: ClassVar[bool] = True

    @abc.abstractmethod
    def work(self, u: ArrayLike) -> Array:
        """Work on first loading, the integral of the backbone from 0 to u; any shape."""

    def dissipation(self, amplitude: ArrayLike) -> Array:
        """Energy lost per steady cycle at a displacement amplitude; any shape.

        It is D = 8 W(U) - 4 U F(U), of the loop that Masing's rule makes of the backbone.
        """
        size = jnp.abs(jnp.asarray(amplitude))
        return 8.0 * self.work(size) - 4.0 * size * self.backbone(size)

    def path_forces(self, path: ArrayLike) -> Array:
        """Forces (T,) on a path (T,) of displacements, exact, from rest."""
        points = as_path(path)
        return _forces(self, points, _depth(points))

    def path_displacements(self, path: ArrayLike) -> Array:
        """Displacements (T,) on a path (T,) of forces, exact, from rest.

        Raises
        ------
        InputError
            for a force that is the law's `capacity` or more; traced, it gives NaN
        """
        points = as_path(path)
        self._below_capacity(points)
        return _displacements(self, points, _depth(points))


@eqx.filter_jit
def _forces(law: MasingLaw, points: Array, depth: int) -> Array:
    return along_path(points, law.backbone, depth)


@eqx.filter_jit
def _displacements(law: MasingLaw, points: Array, depth: int) -> Array:
    return along_path(points, lambda force: jnp.sign(force) * law.displacement(force), depth)


def _depth(points: Array) -> int:
    """Most turns that a path from rest can have to remember, of few different sizes."""
    if is_traced(points):
        return points.size
    ways = np.sign(np.diff(np.asarray(points), prepend=0.0))
    ways = ways[ways != 0.0]
    turns = int(np.sum(ways[1:] != ways[:-1]))
    return SIZES * (turns // SIZES + 1)

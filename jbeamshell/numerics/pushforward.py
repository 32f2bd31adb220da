"""Derivatives of loops, forward and reverse, as one linear operation of JAX.

A loop that ends when it is done has no reverse derivative in JAX.  Where a second function says the
same with loops of known length, that one's derivatives stand for it.  They are two linear
operations, each the transpose of the other.  In a batch each lane runs for itself, because a loop
of lanes in step does all branches of all lanes; tangents of one lane go side by side.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
from jax import Array
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir
from jaxtyping import PyTree

Function = Callable[[PyTree, PyTree], PyTree]


class Rule(NamedTuple):
    """Derivatives of a function that are known.

    Attributes
    ----------
    forward : tangents of the value, (at, beside, change of ``at``)
    backward : cotangents of ``at``, (at, beside, cotangents of the value)
    shapes : structure of the value with its shapes, (at, beside)
    """

    forward: Callable[[PyTree, PyTree, PyTree], PyTree]
    backward: Callable[[PyTree, PyTree, PyTree], PyTree]
    shapes: Function


def pushforward(function: Function | Rule, at: PyTree, beside: PyTree, change: PyTree) -> PyTree:
    """Change of function(at, beside) for a change of ``at``; linear in the change.

    Parameters
    ----------
    function : function of two pytrees of arrays, the first of which holds real numbers; it has
        derivatives of both modes, or is a `Rule`, and is the same object from call to call
    at, beside : its arguments
    change : change of ``at``
    """
    points, tree = jax.tree.flatten((at, beside))
    tangents, inner = jax.tree.flatten(change)
    along = _Along(function, tree, inner, jax.tree.structure(at), len(points))
    changes = _linear.bind(*points, *tangents, rule=along)
    return jax.tree.unflatten(along.structure(points), changes)


@dataclasses.dataclass(frozen=True)
class _Along:
    """Linear function of tangents at some points, or its transpose.

    Attributes
    ----------
    function : see `pushforward`
    tree : structure of all points
    inner : structure of the tangents
    first : structure of the points with tangents
    count : number of the points
    back : True for the transpose
    """

    function: Function | Rule
    tree: Any
    inner: Any
    first: Any
    count: int
    back: bool = False

    def structure(self, points: Sequence[Array]) -> Any:
        """Structure of the function's value."""
        given = self._given(points)
        if isinstance(self.function, Rule):
            return jax.tree.structure(self.function.shapes(*given))
        return jax.tree.structure(jax.eval_shape(self.function, *given))

    def __call__(self, *arrays: Array) -> list[Array]:
        points, linear = arrays[: self.count], arrays[self.count :]
        at, beside = self._given(points)

        rule = self.function
        if isinstance(rule, Rule):
            if self.back:
                out = jax.tree.structure(rule.shapes(at, beside))
                return jax.tree.leaves(rule.backward(at, beside, jax.tree.unflatten(out, linear)))
            change = jax.tree.unflatten(self.inner, linear)
            return jax.tree.leaves(rule.forward(at, beside, change))

        def value(at: PyTree) -> PyTree:
            return rule(at, beside)

        if self.back:
            out, pull = jax.vjp(value, at)
            (change,) = pull(jax.tree.unflatten(jax.tree.structure(out), linear))
            return jax.tree.leaves(change)
        return jax.tree.leaves(jax.jvp(value, (at,), (jax.tree.unflatten(self.inner, linear),))[1])

    def _given(self, points: Sequence[Array]) -> tuple[PyTree, PyTree]:
        at, beside = jax.tree.unflatten(self.tree, points)
        return at, beside


_linear = Primitive("jbeamshell_pushforward")
_linear.multiple_results = True


@_linear.def_impl
def _impl(*arrays: Array, rule: _Along) -> list[Array]:
    return rule(*arrays)


@_linear.def_abstract_eval
def _abstract(*arrays: Any, rule: _Along) -> list[Any]:
    shapes = [jax.ShapeDtypeStruct(a.shape, a.dtype) for a in arrays]
    return [jax.core.ShapedArray(a.shape, a.dtype) for a in jax.eval_shape(rule, *shapes)]


def _transpose(cotangents: Sequence[Any], *arrays: Any, rule: _Along) -> list[Any]:
    """Cotangents of the linear arguments; the points have none."""
    points, linear = arrays[: rule.count], arrays[rule.count :]
    full = [ad.instantiate_zeros(c) for c in cotangents]
    back = _linear.bind(*points, *full, rule=dataclasses.replace(rule, back=not rule.back))
    # A tangent that is known, such as a zero, has no cotangent.
    back = [b if ad.is_undefined_primal(a) else None for a, b in zip(linear, back, strict=True)]
    return [None] * rule.count + back


def _batch(arrays: Sequence[Array], axes: Sequence[Any], *, rule: _Along) -> tuple[Any, Any]:
    """Lanes one after the other; tangents at the same points, and those of a rule, side by side."""
    lanes = [axis is not None for axis in axes]
    moved = [
        jax.numpy.moveaxis(array, axis, 0) if lane else array
        for array, axis, lane in zip(arrays, axes, lanes, strict=True)
    ]
    if isinstance(rule.function, Rule) or not any(lanes[: rule.count]):
        outs = jax.vmap(rule, in_axes=[0 if lane else None for lane in lanes])(*moved)
        return outs, [0] * len(outs)
    mapped = [array for array, lane in zip(moved, lanes, strict=True) if lane]

    def one(some: list[Array]) -> list[Array]:
        own = iter(some)
        whole = [next(own) if lane else array for array, lane in zip(moved, lanes, strict=True)]
        return _linear.bind(*whole, rule=rule)

    outs = jax.lax.map(one, mapped)
    return outs, [0] * len(outs)


ad.primitive_transposes[_linear] = _transpose
batching.primitive_batchers[_linear] = _batch
mlir.register_lowering(_linear, mlir.lower_fun(_impl, multiple_results=True))

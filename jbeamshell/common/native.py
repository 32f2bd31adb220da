"""Functions compiled to one native function of a CPU."""

from __future__ import annotations

import functools
from collections.abc import Callable, Hashable
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jax.experimental.xla_metadata import set_xla_metadata
from jax.flatten_util import ravel_pytree

from jbeamshell.common.checks import is_staged, is_traced
from jbeamshell.common.small import SOONEST, known_options, quick_options
from jbeamshell.common.threads import on_one_core, on_processor

# The compiler's mark for a call that becomes one function; compilers that do not know it ignore it.
MARK = {"inlineable": "false", "xla_cpu_small_call": "true"}
REFUSED = ("custom_call", "stablehlo.sort", "stablehlo.fft")  # operations that need the runtime
MOST_ARRAYS = 16  # that are given to a native function: some twenty end the process (jaxlib 0.10)


def one_call(function: Callable[..., Any], *given: Any) -> Any:
    """Value of a function, marked for the compiler as one call; many arrays go in as one vector.

    A program may have one such call: two of them get the same name, and do not link (jaxlib 0.10).

    Raises
    ------
    jax.errors.JaxRuntimeError
        when the program is compiled, if the compiler cannot do an operation in a native function
    """
    arrays, static = eqx.partition(given, eqx.is_array)
    arrays, unpack = ravel_pytree(arrays) if _many(arrays) else (arrays, lambda packed: packed)
    called = jax.jit(lambda arrays: function(*eqx.combine(unpack(arrays), static)))
    leaves, tree = jax.tree.flatten(called(arrays))
    leaves[0] = set_xla_metadata(leaves[0], **MARK)  # marks the call that makes the leaf
    return jax.tree.unflatten(tree, leaves)


def _many(arrays: Any) -> bool:
    return len(jax.tree.leaves(arrays)) > MOST_ARRAYS


class Program:
    """Function with one program for values of one kind, whose loops are native calls.

    It is compiled with few optimisations, in less than half the time.  Native calls make up for
    them: with all optimisations a run takes two fifths of the time, but hundreds of runs to make up
    for the compilation.  What the compiler cannot do in native calls it calls operation by
    operation, with all optimisations.  Within a JAX transformation the function is an ordinary
    compiled one, because JAX takes compiler options for whole programs only.

    Parameters
    ----------
    function : function of pytrees of arrays and static values, and of ``native``: True where its
        loops may be marked as one call each, see `one_call`
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._inside = eqx.filter_jit(functools.partial(function, native=False))
        self._refused: set[Hashable] = set()  # kinds of values whose loops cannot be one call each

    def __call__(self, *given: Any, native: bool = True) -> Any:
        """Value of the function.

        Parameters
        ----------
        given : arguments of the function
        native : False where its loops are known not to fit in native calls
        """
        if is_staged() or is_traced(given):
            return self._inside(*given)
        leaves, tree = jax.tree.flatten(given)
        arrays = [leaf for leaf in leaves if _is_array(leaf)]
        static = tuple(None if _is_array(leaf) else leaf for leaf in leaves)
        kind = tree, static, tuple((array.shape, array.dtype) for array in arrays)
        if native and kind not in self._refused and on_processor():
            try:
                return self._compiled[True](arrays, tree, static)
            except jax.errors.JaxRuntimeError:  # the compiler refuses an operation
                self._refused.add(kind)
        return self._compiled[False](arrays, tree, static)

    @functools.cached_property
    def _compiled(self) -> dict[bool, Any]:
        """Compiled functions of arrays, structure and static values, by ``native``."""

        def made(native: bool) -> Any:
            def flat(arrays: list[Any], tree: Any, static: tuple[Hashable, ...]) -> Any:
                rest = iter(arrays)
                leaves = [next(rest) if leaf is None else leaf for leaf in static]
                return self._function(*jax.tree.unflatten(tree, leaves), native=native)

            flat.__name__ = self._function.__name__
            options = known_options(SOONEST) if native else quick_options(vectors=True)
            return jax.jit(flat, static_argnums=(1, 2), compiler_options=options)

        return {native: made(native) for native in (True, False)}


def _is_array(leaf: Any) -> bool:
    return isinstance(leaf, np.ndarray | jax.Array)


class Native:
    """Function of numbers that runs as one native function on a CPU, if the compiler can do it.

    Otherwise each of its operations is a call of its own.  The calls take turns on several threads,
    which costs more time than the arithmetic of a strip of a few dozen nodes.

    Attributes
    ----------
    ordinary : compiled function
    whole : same function, marked for the compiler as one call
    fits : True if the compiler takes ``whole``; None before the first call

    Parameters
    ----------
    function : function of JAX arrays
    worth : False to use ``ordinary`` always
    """

    def __init__(self, function: Callable[..., Any], *, worth: bool = True) -> None:
        self.ordinary = jax.jit(function)
        self.whole = jax.jit(functools.partial(one_call, function))
        self.fits = None if worth else False

    def now(self, *given: Any) -> Any | None:
        """Value for numbers; None if a JAX transformation asks with traced values."""
        if is_traced(given):
            return None
        if not is_staged():
            return self._value(*given)
        # Elsewhere each operation on constants would be compiled and run by itself.
        with jax.ensure_compile_time_eval():  # now, while another function is traced
            return self._value(*given)

    def _value(self, *given: Any) -> Any:
        if self.fits is None:
            self.fits = _may_fit(self.whole, given)
        if self.fits:
            try:
                return self.whole(*given)
            except jax.errors.JaxRuntimeError:  # the compiler refuses an operation
                self.fits = False
        return self._called(*given)

    @on_one_core
    def _called(self, *given: Any) -> Any:
        return jax.block_until_ready(self.ordinary(*given))


def _may_fit(whole: Any, given: tuple[Any, ...]) -> bool:
    """True if the program runs on a CPU and needs no runtime."""
    if not on_processor():
        return False
    text = whole.lower(*given).as_text()
    return not any(word in text for word in REFUSED)

"""Functions with two programs: one that compiles fast, and one that runs fast."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Hashable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np

from jbeamshell.common.checks import is_staged, is_traced
from jbeamshell.common.small import QUICK, VECTORS, known_options

# Compiler options of the two programs; the loops of the second stay vectorised.
COMPILED_FAST = QUICK | {VECTORS: 0}
RUNS_FAST = {name: value for name, value in QUICK.items() if name != VECTORS}


class _Program(NamedTuple):
    """Program of a function for values of one kind.

    Attributes
    ----------
    tree : structure of the arguments
    static : leaves that are no arrays, None in place of the others
    shapes : shape and type of each array
    """

    tree: Any
    static: tuple[Hashable, ...]
    shapes: tuple[Hashable, ...]


class TwoPrograms:
    """Function that compiles fast for its first runs, and runs fast where it runs often.

    The first program is compiled with few optimisations, which takes about half the time; its loops
    are native calls, which makes up for them.  Once its runs have taken as long as the first call
    with its compilation, the function is compiled again with all optimisations.  The values of both
    agree but for rounding.  What the compiler cannot do in native calls has all optimisations from
    the beginning.  Within a JAX transformation it is an ordinary compiled function, because JAX
    takes compiler options for whole programs only.

    Parameters
    ----------
    function : function of pytrees of arrays and static values, and of ``native``: True where its
        loops may be marked as one call each, see `jbeamshell.common.native.one_call`
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._inside = eqx.filter_jit(functools.partial(function, native=False))
        self._patience: dict[_Program, float] = {}  # seconds left for runs of the first program
        self._refused: set[_Program] = set()  # programs whose loops cannot be one call each

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
        shapes = tuple((array.shape, array.dtype) for array in arrays)
        program, arguments = _Program(tree, static, shapes), (arrays, tree, static)
        if not native or program in self._refused or jax.default_backend() != "cpu":
            return self._compiled["ordinary"](*arguments)
        patience = self._patience.get(program)
        if patience is not None and patience < 0.0:
            return self._compiled["often"](*arguments)
        began = time.perf_counter()
        try:
            found = jax.block_until_ready(self._compiled["first"](*arguments))
        except jax.errors.JaxRuntimeError:  # the compiler cannot do an operation in a native call
            self._refused.add(program)
            return self._compiled["ordinary"](*arguments)
        took = time.perf_counter() - began
        self._patience[program] = took if patience is None else patience - took
        return found

    @functools.cached_property
    def _compiled(self) -> dict[str, Any]:
        fast, full = known_options(COMPILED_FAST), known_options(RUNS_FAST)
        first = self._made(fast, native=True)
        often = first if fast == full else self._made(full, native=True)
        return {"first": first, "often": often, "ordinary": self._made(full, native=False)}

    def _made(self, options: dict[str, Any] | None, native: bool) -> Any:
        def flat(arrays: list[Any], tree: Any, static: tuple[Hashable, ...]) -> Any:
            rest = iter(arrays)
            leaves = [next(rest) if leaf is None else leaf for leaf in static]
            return self._function(*jax.tree.unflatten(tree, leaves), native=native)

        flat.__name__ = self._function.__name__
        return jax.jit(flat, static_argnums=(1, 2), compiler_options=options)


def _is_array(leaf: Any) -> bool:
    return isinstance(leaf, np.ndarray | jax.Array)

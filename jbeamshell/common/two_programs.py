"""Functions with two programs: one that compiles fast, and one that runs fast."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Hashable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np

from jbeamshell.common.checks import in_transformation, is_traced
from jbeamshell.common.small import QUICK, VECTORS, known_options

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

    The first program is compiled with few optimisations, which takes about half the time.  Once its
    runs have taken as long as the first call with its compilation, the function is compiled again
    with all of them: nobody waits much longer than with the better of the two.  Within a JAX
    transformation it is an ordinary compiled function, because JAX takes compiler options for whole
    programs only.

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

    def __call__(self, *given: Any) -> Any:
        """Value of the function."""
        if in_transformation() or is_traced(given):
            return self._inside(*given)
        leaves, tree = jax.tree.flatten(given)
        arrays = [leaf for leaf in leaves if _is_array(leaf)]
        static = tuple(None if _is_array(leaf) else leaf for leaf in leaves)
        shapes = tuple((array.shape, array.dtype) for array in arrays)
        program = _Program(tree, static, shapes)
        patience = self._patience.get(program)
        if patience is not None and patience < 0.0:
            return self._run(program, arrays, often=True)
        began = time.perf_counter()
        found = jax.block_until_ready(self._run(program, arrays, often=False))
        took = time.perf_counter() - began
        self._patience[program] = took if patience is None else patience - took
        return found

    def _run(self, program: _Program, arrays: list[Any], often: bool) -> Any:
        native = jax.default_backend() == "cpu" and program not in self._refused
        given = arrays, program.tree, program.static
        try:
            return self._compiled[often, native](*given)
        except jax.errors.JaxRuntimeError:  # the compiler cannot do an operation in one call
            if not native:
                raise
            self._refused.add(program)
            return self._compiled[often, False](*given)

    @functools.cached_property
    def _compiled(self) -> dict[tuple[bool, bool], Any]:
        """Compiled functions by often and native."""
        first, often = known_options(COMPILED_FAST), known_options(RUNS_FAST)
        made = {(False, native): self._made(first, native) for native in (False, True)}
        if often == first:
            return made | {(True, native): made[False, native] for native in (False, True)}
        return made | {(True, native): self._made(often, native) for native in (False, True)}

    def _made(self, options: dict[str, Any] | None, native: bool) -> Any:
        def flat(arrays: list[Any], tree: Any, static: tuple[Hashable, ...]) -> Any:
            rest = iter(arrays)
            leaves = [next(rest) if leaf is None else leaf for leaf in static]
            return self._function(*jax.tree.unflatten(tree, leaves), native=native)

        flat.__name__ = self._function.__name__
        return jax.jit(flat, static_argnums=(1, 2), compiler_options=options)


def _is_array(leaf: Any) -> bool:
    return isinstance(leaf, np.ndarray | jax.Array)

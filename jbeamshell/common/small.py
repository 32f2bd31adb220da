"""Small programs: functions that take much longer to compile than to run."""

from __future__ import annotations

import functools
from collections.abc import Callable, Hashable
from typing import Any

import equinox as eqx
import jax
import numpy as np

from jbeamshell.common.checks import is_staged
from jbeamshell.common.numbers_of import numbers_of

QUICK = {"xla_cpu_use_fusion_emitters": False}
LEVEL = "xla_backend_optimization_level"


@functools.cache
def quick_options(level: int = 1) -> dict[str, Any] | None:
    """Compiler options for a small program: half the time to compile, the same time to run.

    Parameters
    ----------
    level : 0 for a program that is run a few times: it compiles in a third of the time again, and
        runs for twice as long

    Returns
    -------
    dict, or None
        options that this release of JAX knows; None where the whole process compiles with fewer
        optimisations anyway
    """
    config: Any = jax.config
    if config.values["jax_disable_most_optimizations"]:
        return None
    wanted = QUICK | {LEVEL: level}
    return {name: value for name, value in wanted.items() if _is_known(name, value)}


@functools.cache
def _is_known(name: str, value: Any) -> bool:
    """True if the compiler takes an option; it is asked by a program of no operation."""
    try:
        jax.jit(lambda: 0.0, compiler_options={name: value}).lower().compile()
    except jax.errors.JaxRuntimeError:
        return False
    return True


def always(_: object) -> bool:
    """True: what NumPy computes for all its arrays."""
    return True


class Small:
    """Function that is compiled as a small program where all its arrays are numbers.

    Within a transformation it is an ordinary compiled function, because JAX takes compiler options
    for whole programs only.

    Parameters
    ----------
    function : function of a pytree of arrays and of further arguments, which are static
    level : see `quick_options`
    by_numpy : True for what NumPy computes without a program, if all its arrays are NumPy's
    """

    def __init__(
        self,
        function: Callable[..., Any],
        level: int = 1,
        by_numpy: Callable[[Any], bool] = lambda _: False,
    ) -> None:
        self._function, self._level, self._by_numpy = function, level, by_numpy
        self._inside = eqx.filter_jit(function)

    def __call__(self, given: Any, *static: Hashable) -> Any:
        """Value of the function."""
        leaves, tree = jax.tree.flatten(given)
        if not is_staged():
            if numbers_of(*leaves) is np and self._by_numpy(given):
                with np.errstate(all="ignore"):  # JAX says nothing of 0/0 and overflow either
                    return self._function(given, *static)
            if all(map(_is_number, leaves)):
                return self._quick(leaves, tree, static)
        return self._inside(given, *static)

    @functools.cached_property
    def _quick(self) -> Any:
        def flat(leaves: list[Any], tree: Any, static: tuple[Hashable, ...]) -> Any:
            return self._function(jax.tree.unflatten(tree, leaves), *static)

        flat.__name__ = self._function.__name__
        return jax.jit(flat, static_argnums=(1, 2), compiler_options=quick_options(self._level))


def _is_number(leaf: Any) -> bool:
    return isinstance(leaf, np.ndarray | np.generic | jax.Array) and not isinstance(
        leaf, jax.core.Tracer
    )

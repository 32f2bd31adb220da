"""Double precision for a calculation whose numbers are given in single precision."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from jbeamshell.common.checks import is_staged, is_traced

P = ParamSpec("P")
R = TypeVar("R")


def in_double(function: Callable[P, R], within: Callable[P, R] | None = None) -> Callable[P, R]:
    """Function that computes in double precision, and rounds if it is given single precision.

    Within a transformation the precision stays as it is, because JAX has one for a whole program.
    Elsewhere what is rounded comes as arrays of NumPy.

    Parameters
    ----------
    function : function of pytrees, which returns a pytree
    within : function that is taken within a transformation; None is the same one
    """
    usual = within or function

    @functools.wraps(function)
    def precise(*given: P.args, **options: P.kwargs) -> R:
        if is_staged() or is_traced(given, options):
            return usual(*given, **options)
        if not is_single(given, options):
            return function(*given, **options)
        with jax.enable_x64(True):
            found = jax.device_get(function(*doubled(given), **doubled(options)))
        return rounded(found)

    return precise


def is_single(*trees: object) -> bool:
    """True if any array of the trees is in single precision, or plain numbers would become so."""
    leaves = jax.tree.leaves(trees)
    if any(_is_array(leaf) and leaf.dtype == np.float32 for leaf in leaves):
        return True
    return bool(jnp.result_type(float) == np.float32)


def doubled(tree: Any) -> Any:
    """Pytree with its floating-point arrays in double precision, as arrays of NumPy."""
    return jax.tree.map(_double, tree)


def _double(leaf: Any) -> Any:
    floating = _is_array(leaf) and jnp.issubdtype(leaf.dtype, jnp.floating)
    return np.asarray(leaf, np.float64) if floating else leaf


def rounded(tree: Any) -> Any:
    """Pytree of NumPy with its double precision rounded to single precision."""
    return jax.tree.map(_round, tree)


def _round(leaf: Any) -> Any:
    double = _is_array(leaf) and leaf.dtype == np.float64
    return leaf.astype(np.float32) if double else leaf


def _is_array(leaf: Any) -> bool:
    return isinstance(leaf, np.ndarray | jax.Array)

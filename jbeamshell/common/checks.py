"""Checks of input: conversion to floating-point leaves, and messages with key, value and fix."""

from __future__ import annotations

import contextlib
import functools
import math
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.errors import InputError

TINY = np.finfo(float).tiny  # ``low=-TINY`` in `require_number` includes zero
MOST_SHOWN = 100  # numbers of an array that a message shows

NUMBER = "must be a number"
POSITIVE = "must be a positive number"
NOT_NEGATIVE = "must be a number, not negative"


def as_leaf(value: Any, key: str = "value", fix: str = NUMBER) -> Array:
    """Floating-point leaf from a number or nested lists of them; JAX arrays keep their precision.

    Raises
    ------
    InputError
        naming the key, the value and the fix, for anything else
    """
    if isinstance(value, jax.Array) and value.dtype in (jnp.float32, jnp.float64):
        return value
    if type(value) is float:
        config: Any = jax.config
        sign = math.copysign(1.0, value)  # of zero, which is equal to minus zero
        return _leaf_of(value, sign, jnp.result_type(float), config.jax_default_device)
    require(key, value, is_numeric(value), fix)
    traced = any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(value))
    # Inside jit, plain numbers stay concrete, so that they can be checked.
    concrete = contextlib.nullcontext() if traced else jax.ensure_compile_time_eval()
    try:
        with concrete:
            made = value if traced else np.asarray(value, jnp.result_type(float))
            return jnp.asarray(made, dtype=jnp.result_type(float))
    except (ValueError, OverflowError):  # rows of different length; whole numbers beyond any float
        raise InputError(f"{key} = {shown(value)}: {fix}") from None


@functools.lru_cache(maxsize=1024)
def _leaf_of(value: float, sign: float, dtype: Any, device: Any) -> Array:
    """Leaf of a number; JAX takes longer to make one than most checks do."""
    with jax.ensure_compile_time_eval():
        return jnp.asarray(np.asarray(value, dtype))  # of a plain number JAX compiles it


def is_numeric(value: Any) -> bool:
    """True if a value is a number, or an array or list of numbers; words and truths are none."""
    if isinstance(value, list | tuple):
        return all(map(is_numeric, value))
    if np.ma.is_masked(value):
        return False
    if isinstance(value, np.ndarray | np.generic | jax.Array):
        return value.dtype.kind in "fiu" or jnp.issubdtype(value.dtype, jnp.floating)
    return isinstance(value, int | float) and not isinstance(value, bool)


def as_words(value: Any) -> Any:
    """Tuple of a list of words; anything else as `as_plain` gives it."""
    return tuple(map(as_plain, value)) if isinstance(value, list | tuple) else as_plain(value)


def as_plain(value: Any) -> Any:
    """Plain Python value of a NumPy scalar; text in place of arrays, which checks then refuse."""
    if isinstance(value, np.generic):
        return value.item()
    return shown(value) if any(map(eqx.is_array, jax.tree.leaves(value))) else value


def require(key: str, value: Any, holds: bool, fix: str) -> None:
    """Raise `InputError` naming the key, the value and the fix unless the condition holds."""
    if not holds:
        raise InputError(f"{key} = {shown(value)}: {fix}")


def shown(value: Any) -> str:
    """Value as a message shows it, in one piece of text."""
    if isinstance(value, jax.core.Tracer):
        return "a traced value"
    if isinstance(value, jax.Array | np.ndarray):
        if value.size > MOST_SHOWN:
            return f"an array of shape {value.shape}"
        value = np.asarray(value).tolist()
    try:
        return repr(value)
    except (ValueError, RecursionError):  # such as a whole number of thousands of digits
        return f"a {type(value).__name__} too long to show"


def require_number(
    key: str, value: Any, fix: str = POSITIVE, low: float = 0.0, high: float = np.inf
) -> None:
    """Raise `InputError` unless a value is one number between low and high, both excluded.

    Traced values pass: they have no number yet.
    """
    if isinstance(value, jax.core.Tracer):
        return
    number = np.asarray(value)
    require(key, value, number.ndim == 0, f"give one number, not an array of shape {number.shape}")
    require(key, value, bool(np.isfinite(number) and low < number < high), fix)


def require_finite(key: str, values: Any) -> None:
    """Raise `InputError` unless all of an array's numbers are finite; traced ones pass."""
    if not is_traced(values):
        fix = "holds NaN or infinity: give finite numbers"
        require(key, values, bool(np.all(np.isfinite(np.asarray(values)))), fix)


def whole_numbers(key: str, values: Any) -> np.ndarray:
    """Whole numbers of a table, which may hold them as floats, such as nodes.

    Raises
    ------
    InputError
        naming the first value that is no whole number
    """
    table = np.asarray(values)
    numeric = table.dtype.kind in "iuf"
    require(key, f"of type {table.dtype}", numeric, "must hold whole numbers")
    with np.errstate(invalid="ignore"):  # NaN and infinity
        found = table.astype(np.int64)
    wrong = table[found != table]
    require(key, wrong[:1], not wrong.size, "must be whole numbers, as nodes and directions are")
    return found


def check_words(key: str, words: Any) -> None:
    """Raise `InputError` unless a value is a list of words."""
    several = isinstance(words, list | tuple) and all(isinstance(word, str) for word in words)
    require(key, words, several, "give a list of words")


def require_choice(key: str, value: Any, choices: Sequence[Any]) -> None:
    """Raise `InputError` with the choices unless a value is one of them."""
    known = not isinstance(value, jax.Array | np.ndarray) and value in choices
    require(key, value, known, "choose " + " or ".join(map(repr, choices)))


def require_count(key: str, value: Any, low: int, high: int = 10**6) -> None:
    """Raise `InputError` unless a value is a whole number from low to high, both included."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    require(key, value, whole and low <= value <= high, f"must be a whole number, {low} to {high}")


def is_traced(*trees: object) -> bool:
    """True if any leaf of the trees is traced by a JAX transformation."""
    return any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(trees))


@functools.cache
def _one() -> jax.Array:
    with jax.ensure_compile_time_eval():
        return jnp.ones(())


@jax.jit
def _same(number: jax.Array) -> jax.Array:
    return number


def is_staged() -> bool:
    """True inside a function that JAX stages out now, such as by jit, even if no number is traced.

    What a compiled function gives is traced there; elsewhere it is a number.
    """
    return isinstance(_same(_one()), jax.core.Tracer)

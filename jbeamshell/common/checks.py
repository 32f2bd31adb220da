"""common.checks."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.errors import InputError

TINY = np.finfo(float).tiny

MOST_SHOWN = 100  # numbers of an array in a message

NUMBER = "must be a number"
POSITIVE = "must be a positive number"
NOT_NEGATIVE = "must be a number, not negative"


def as_leaf(value: Any, key: str = "value", fix: str = NUMBER) -> Array:
    """A floating-point leaf from numbers or nested lists of them; arrays keep their precision."""
    if isinstance(value, jax.Array) and value.dtype in (jnp.float32, jnp.float64):
        return value
    require(key, value, is_numeric(value), fix)
    traced = any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(value))
    # Plain numbers stay concrete inside jit too, where they must still be checked.
    concrete = contextlib.nullcontext() if traced else jax.ensure_compile_time_eval()
    try:
        with concrete:
            return jnp.asarray(value, dtype=jnp.result_type(float))
    except (ValueError, OverflowError):  # rows of different length; whole numbers beyond any float
        raise InputError(f"{key} = {shown(value)}: {fix}") from None


def is_numeric(value: Any) -> bool:
    """Whether there are only numbers in a value, words and truths being none."""
    if isinstance(value, list | tuple):
        return all(map(is_numeric, value))
    if np.ma.is_masked(value):
        return False
    if isinstance(value, np.ndarray | np.generic | jax.Array):
        return value.dtype.kind in "fiu" or jnp.issubdtype(value.dtype, jnp.floating)
    return isinstance(value, int | float) and not isinstance(value, bool)


def number_leaf(key: str, default: float, fix: str = NUMBER) -> Any:
    """Field of a module that holds a number; see `as_leaf`."""
    convert = functools.partial(as_leaf, key=key, fix=fix)
    return eqx.field(converter=convert, default=default)


def static_word(default: Any) -> Any:
    """Field of a module that holds a word or a count, which is no leaf."""
    return eqx.field(static=True, default=default, converter=as_plain)


def as_words(value: Any) -> Any:
    """A list of words as a tuple."""
    return tuple(map(as_plain, value)) if isinstance(value, list | tuple) else as_plain(value)


def as_plain(value: Any) -> Any:
    """A word or a number as Python has it; with arrays it is neither, as the check will find."""
    if isinstance(value, np.generic):
        return value.item()
    return shown(value) if any(map(eqx.is_array, jax.tree.leaves(value))) else value


def require(key: str, value: Any, holds: bool, fix: str) -> None:
    """Raise `InputError` naming the key, the value and the fix unless the condition holds."""
    if not holds:
        raise InputError(f"{key} = {shown(value)}: {fix}")


def shown(value: Any) -> str:
    """A value as messages have it."""
    if isinstance(value, jax.core.Tracer):
        return "a traced value"
    if isinstance(value, jax.Array | np.ndarray):
        if value.size > MOST_SHOWN:
            return f"an array of shape {value.shape}"
        value = np.asarray(value).tolist()
    try:
        return repr(value)
    except (ValueError, RecursionError):  # Python writes no whole number of thousands of digits
        return f"a {type(value).__name__} too long to show"


def require_number(
    key: str, value: Any, fix: str = POSITIVE, low: float = 0.0, high: float = np.inf
) -> None:
    """A single number strictly between low and high; traced values are left to the solver."""
    if isinstance(value, jax.core.Tracer):
        return
    number = np.asarray(value)
    require(key, value, number.ndim == 0, f"give one number, not an array of shape {number.shape}")
    require(key, value, bool(np.isfinite(number) and low < number < high), fix)


def check_words(key: str, words: Any) -> None:
    """Raise `InputError` unless it is a list of words."""
    several = isinstance(words, list | tuple) and all(isinstance(word, str) for word in words)
    require(key, words, several, "give a list of words")


def require_choice(key: str, value: Any, choices: Sequence[Any]) -> None:
    """Raise `InputError` with the choices unless the value is one of them."""
    known = not isinstance(value, jax.Array | np.ndarray) and value in choices
    require(key, value, known, "choose " + " or ".join(map(repr, choices)))


def require_count(key: str, value: Any, low: int, high: int = 10**6) -> None:
    """Raise `InputError` unless it is a whole number from low to high."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    require(key, value, whole and low <= value <= high, f"must be a whole number, {low} to {high}")


def is_traced(*trees: object) -> bool:
    """Whether any leaf is traced."""
    return any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(trees))

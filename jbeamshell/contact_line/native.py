"""The walk in C (walk.c) and its derivatives (slopes.c), as operations of JAX.

The library is built when jbeamshell is installed, if there is a C compiler.  Without it the walk in
JAX stands in, which says the same more slowly.
"""

from __future__ import annotations

import ctypes
import functools
import os
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.jax_options import WALK
from jbeamshell.common.numbers_of import numbers_of
from jbeamshell.contact_line.body import Body
from jbeamshell.contact_line.contact_state import ContactState
from jbeamshell.numerics.pushforward import Rule, pushforward

TARGET, PATH = "jbeamshell_walk", "jbeamshell_path"
LIBRARY = Path(__file__).with_name("libwalk.so")
FORWARD, BACKWARD = "jbeamshell_slopes_forward", "jbeamshell_slopes_backward"
REALS = 6  # of the levels' arrays, the first, have derivatives

Numbers = tuple[Array, ...]
Flags = tuple[Array, Array]


class Levels(NamedTuple):
    """Levels of a path: see `walk.Level`, whose state is apart here."""

    v: Array
    r_t: Array
    r_n: Array
    displacement: Array
    lift: Array
    slip_work: Array
    slipping: Array
    settled: Array


@functools.cache
def library() -> ctypes.CDLL | None:
    """Library of the walk in C; None if it was not built, cannot be loaded or is not wanted."""
    if os.environ.get(WALK) == "jax":
        return None
    try:
        found = ctypes.CDLL(str(LIBRARY))
    except OSError:
        return None
    return found if hasattr(found, PATH) else None  # another version's may have none


def in_words() -> str:
    """Line that says where this process walks load paths, and why, without starting JAX."""
    if library() is not None:
        return "load paths are walked in C"
    reason = f"{LIBRARY.name} cannot be loaded: install jbeamshell anew"
    if not LIBRARY.exists():
        reason = "there was no C compiler when jbeamshell was installed"
    if os.environ.get(WALK) == "jax":
        reason = f"{WALK} = jax"
    return f"load paths are walked in JAX, more slowly ({reason})"


def serves(*values: object) -> bool:
    """True if the walk in C is there, and JAX takes it if any of some arrays is JAX's."""
    return library() is not None and (numbers_of(*values) is np or is_taken())


@functools.cache
def is_taken() -> bool:
    """True if JAX takes the walk in C."""
    found = library()
    jax.devices("cpu")  # a target that is refused before JAX has started ends it
    try:
        for target in (TARGET, FORWARD, BACKWARD):
            handler = jax.ffi.pycapsule(getattr(found, target))
            jax.ffi.register_ffi_target(target, handler, platform="cpu")
    except Exception as error:  # a release of JAX that refuses the handler may raise anything
        words = f"load paths are walked in JAX, more slowly: it refuses the walk in C ({error})"
        warnings.warn(words, RuntimeWarning, stacklevel=2)
        return False
    return True


def arguments(
    body: Body, friction: ArrayLike, start: ContactState, forces: ArrayLike, lift: ArrayLike
) -> Numbers:
    """Numbers of a path in the order of walk.c, without its flags."""
    xp = numbers_of(*jax.tree.leaves((body, friction, start)), forces, lift)
    matrix = xp.block([[body.K_tt, body.K_tn], [body.K_tn.T, body.K_nn]])
    pull = xp.concatenate([body.f_t, body.f_n])
    reactions = xp.concatenate([start.r_t, start.r_n])
    begin = xp.stack([start.force, start.displacement])
    given = matrix, pull, body.x, friction, body.c, start.v, reactions, lift, begin, forces
    return tuple(xp.asarray(each, float) for each in given)


def levels(given: Numbers, turns: ArrayLike | tuple[bool, ...], rounded: bool) -> Levels:
    """Levels of a path, see `walk.walk`; first derivatives are exact, forward and reverse.

    Parameters
    ----------
    given : `arguments`
    turns : (levels,) True where the load has turned
    rounded : True to read the spline of the events
    """
    xp = numbers_of(*given)
    beside = xp.asarray(turns, bool), xp.asarray(rounded)
    return _levels_at_once(given, beside) if xp is np else _levels(given, beside)


def _levels_at_once(given: Numbers, beside: Flags) -> Levels:
    """Levels of a path outside of JAX."""
    found, inputs = library(), [np.ascontiguousarray(each) for each in (*given, *beside)]
    assert found is not None
    made: list[Any] = [np.empty(shape.shape, shape.dtype) for shape in _shapes(given)]
    n, m, places, count = (given[place].size for place in (7, 1, 2, 9))
    pointers = [
        (ctypes.c_void_p * len(arrays))(*(array.ctypes.data for array in arrays))
        for arrays in (inputs, made)
    ]
    if not getattr(found, PATH)(m - n, n, places, count, *pointers):
        raise MemoryError("no memory for the walk of a load path")
    return Levels(*made)


@jax.custom_jvp
def _levels(given: Numbers, beside: Flags) -> Levels:
    call = jax.ffi.ffi_call(TARGET, _shapes(given), vmap_method="expand_dims")
    return Levels(*call(*given, *beside))


@_levels.defjvp
def _levels_jvp(primals, tangents):  # type: ignore[no-untyped-def]
    given, beside = primals
    found = _levels(given, beside)
    slopes = pushforward(RULE, given, beside, tangents[0])
    none = (np.zeros(a.shape, jax.dtypes.float0) for a in (found.slipping, found.settled))
    return found, Levels(*slopes, *none)


def _forward(given: Numbers, beside: Flags, change: Numbers) -> list[Array]:
    call = jax.ffi.ffi_call(FORWARD, _real_shapes(given, beside), vmap_method="expand_dims")
    return list(call(*given, *beside, *change))


def _backward(given: Numbers, beside: Flags, levels: list[Array]) -> Numbers:
    made = [jax.ShapeDtypeStruct(a.shape, a.dtype) for a in given]
    call = jax.ffi.ffi_call(BACKWARD, made, vmap_method="expand_dims")
    return tuple(call(*given, *beside, *levels))


def _real_shapes(given: Numbers, _: Flags) -> list[jax.ShapeDtypeStruct]:
    return _shapes(given)[:REALS]


RULE = Rule(_forward, _backward, _real_shapes)


def _shapes(given: Numbers) -> list[jax.ShapeDtypeStruct]:
    n, m, count = given[7].size, given[1].size, given[9].size
    k = m - n
    reals = (count, k), (count, k), (count, n), (count,), (count, n), (count,)
    flags = (count, k), (count,)
    made = [jax.ShapeDtypeStruct(shape, float) for shape in reals]
    return made + [jax.ShapeDtypeStruct(shape, bool) for shape in flags]

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
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.jax_options import WALK
from jbeamshell.contact_line.body import Body
from jbeamshell.contact_line.contact_state import ContactState
from jbeamshell.numerics.pushforward import Rule, pushforward

TARGET = "jbeamshell_walk"
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
        return ctypes.CDLL(str(LIBRARY))
    except OSError:
        return None


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


@functools.cache
def serves() -> bool:
    """True if the walk in C is there and JAX takes it."""
    found = library()
    if found is None:
        return False
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
    matrix = jnp.block([[body.K_tt, body.K_tn], [body.K_tn.T, body.K_nn]])
    pull = jnp.concatenate([body.f_t, body.f_n])
    reactions = jnp.concatenate([start.r_t, start.r_n])
    begin = jnp.stack([start.force, start.displacement])
    given = matrix, pull, body.x, friction, body.c, start.v, reactions, lift, begin, forces
    return tuple(jnp.asarray(each, float) for each in given)


@jax.custom_jvp
def levels(given: Numbers, beside: Flags) -> Levels:
    """Levels of a path, see `walk.walk`; first derivatives are exact, forward and reverse.

    Parameters
    ----------
    given : `arguments`
    beside : turns (levels,), and True to read the spline of the events
    """
    call = jax.ffi.ffi_call(TARGET, _shapes(given), vmap_method="expand_dims")
    return Levels(*call(*given, *beside))


@levels.defjvp
def _levels_jvp(primals, tangents):  # type: ignore[no-untyped-def]
    given, beside = primals
    found = levels(given, beside)
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

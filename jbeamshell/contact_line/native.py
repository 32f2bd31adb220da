"""The walk in C (walk.c): its library, as one operation of JAX and for arrays of NumPy.

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
from jbeamshell.contact_line.events import MOST_VERTICES, Record
from jbeamshell.contact_line.native_replay import BACKWARD, FORWARD
from jbeamshell.contact_line.polygon import MOST_EVENTS, Corners, Known, Slip

TARGET = "jbeamshell_walk"
LIBRARY = Path(__file__).with_name("libwalk.so")
REALS = 10  # of the arguments; the others are flags


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
) -> tuple[Array, ...]:
    """Numbers of a path in the order of walk.c, without its flags."""
    matrix = jnp.block([[body.K_tt, body.K_tn], [body.K_tn.T, body.K_nn]])
    pull = jnp.concatenate([body.f_t, body.f_n])
    reactions = jnp.concatenate([start.r_t, start.r_n])
    begin = jnp.stack([start.force, start.displacement])
    given = matrix, pull, body.x, friction, body.c, start.v, reactions, lift, begin, forces
    return tuple(jnp.asarray(each, float) for each in given)


def levels(given: tuple[Array, ...], turns: tuple[bool, ...], rounded: bool) -> Levels:
    """Levels of a path, see `walk.walk`."""
    return Levels(*_called(given, turns, rounded, _shapes(given)))


def recorded(
    given: tuple[Array, ...], turns: tuple[bool, ...], rounded: bool
) -> tuple[Levels, Known]:
    """Levels of a path, and what was found of each of the two parts (branches, 2) of a branch."""
    n, m = given[7].size, given[1].size
    k, parts = m - n, 2 * sum(turns)
    events, vertices = MOST_EVENTS * n, MOST_VERTICES * n
    sizes = (
        *((events, 5), (events,), (3,), (vertices, 4), (k, 5)),
        *((vertices,), (vertices, m), (n,)),
    )
    kinds = jnp.int32, float, jnp.int32, jnp.int32, jnp.int32, float, float, jnp.int32
    more = [
        jax.ShapeDtypeStruct((parts, *size), kind) for size, kind in zip(sizes, kinds, strict=True)
    ]
    found = _called(given, turns, rounded, [*_shapes(given), *more])
    rows, tau, counts, corners, slip, at, change, lifted = (
        a.reshape(-1, 2, *a.shape[1:]) for a in found[len(Levels._fields) :]
    )
    number, count, ended = jnp.moveaxis(counts, -1, 0)
    before, after, node, way = jnp.moveaxis(corners, -1, 0)
    side, stuck, opened, later, later_side = jnp.moveaxis(slip, -1, 0)
    known = Known(
        at,
        change,
        lifted != 0,
        Corners(before, after, node, way != 0, count),
        Slip(
            side.astype(float),
            stuck != 0,
            opened != 0,
            later,
            later_side.astype(float),
            ended != 0,
        ),
        Record(rows, tau, number),
    )
    return Levels(*found[: len(Levels._fields)]), known


def _shapes(given: tuple[Array, ...]) -> list[jax.ShapeDtypeStruct]:
    n, m, count = given[7].size, given[1].size, given[9].size
    k = m - n
    reals = (count, k), (count, k), (count, n), (count,), (count, n), (count,)
    flags = (count, k), (count,)
    made = [jax.ShapeDtypeStruct(shape, float) for shape in reals]
    return made + [jax.ShapeDtypeStruct(shape, bool) for shape in flags]


def _called(
    given: tuple[Array, ...],
    turns: tuple[bool, ...],
    rounded: bool,
    shapes: list[jax.ShapeDtypeStruct],
) -> list[Array]:
    call = jax.ffi.ffi_call(TARGET, shapes, vmap_method="expand_dims")
    return list(call(*given, np.asarray(turns), np.asarray(rounded)))

"""Derivatives of the vertices of a branch by the replay in C (replay.c), as operations of JAX."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import Array

from jbeamshell.contact_line.events import MOST_VERTICES, Record, Search
from jbeamshell.contact_line.tableau import Branch
from jbeamshell.numerics.pushforward import Rule

FORWARD, BACKWARD = "jbeamshell_replay_forward", "jbeamshell_replay_backward"

At = tuple[Branch, Search]
Beside = tuple[Array, Record]
Vertices = tuple[Array, Array]


def _forward(at: At, beside: Beside, change: At) -> Vertices:
    made = jax.tree.leaves(_shapes(at, beside))
    call = jax.ffi.ffi_call(FORWARD, made, vmap_method="expand_dims")
    tau, changes = call(*_numbers(at), *_events(beside), *_numbers(change))
    return tau, changes


def _backward(at: At, beside: Beside, vertices: Vertices) -> At:
    numbers = _numbers(at)
    made = [jax.ShapeDtypeStruct(a.shape, a.dtype) for a in numbers]
    call = jax.ffi.ffi_call(BACKWARD, made, vmap_method="expand_dims")
    matrix, pull, friction, r_0, lift, extra, back = call(*numbers, *_events(beside), *vertices)
    return Branch(matrix, pull, friction, r_0, lift), Search(extra, back)


def _shapes(at: At, _: Beside) -> tuple[jax.ShapeDtypeStruct, jax.ShapeDtypeStruct]:
    m, most = at[0].pull.size, MOST_VERTICES * at[0].lift.size
    return jax.ShapeDtypeStruct((most,), float), jax.ShapeDtypeStruct((most, m), float)


def _numbers(at: At) -> list[Array]:
    (matrix, pull, friction, r_0, lift), (extra, back) = at
    return [matrix, pull, friction, r_0, lift, extra, back]


def _events(beside: Beside) -> tuple[Array, ...]:
    opened, record = beside
    return opened, record.events.astype(jnp.int32), record.tau, record.number.astype(jnp.int32)


RULE = Rule(_forward, _backward, _shapes)

"""Joints of a structure as arrays of sliders and springs."""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from jbeamshell.dynamics.structure.joint import Joint


class Laws(NamedTuple):
    """Joints of a structure: s sliders at most and a spring each.

    Attributes
    ----------
    springs, limits : (J, s) stiffnesses and limits of the sliders; zeros fill short rows
    stuck : (J,) stiffness with all sliders stuck
    remaining : (J,) spring that never slips
    """

    springs: Array
    limits: Array
    stuck: Array
    remaining: Array


@eqx.filter_jit
def laws_of(joints: list[Joint]) -> Laws:
    """Arrays of joints; their numbers may be traced."""
    most = max((joint.springs.size for joint in joints), default=0)

    def rows(values: list[Array]) -> Array:
        filled = [jnp.pad(row, (0, most - row.size)) for row in values]
        return jnp.stack(filled) if filled else jnp.zeros((0, most))

    def column(values: list[Array]) -> Array:
        return jnp.stack(values) if values else jnp.zeros(0)

    return Laws(
        rows([joint.springs for joint in joints]),
        rows([joint.limits for joint in joints]),
        column([joint.stiffness for joint in joints]),
        column([joint.spring for joint in joints]),
    )

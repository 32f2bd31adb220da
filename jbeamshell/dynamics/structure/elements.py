"""Joints of a structure as one stack of sliders and springs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from jbeamshell.common.precision import in_double
from jbeamshell.dynamics.structure.joint import Joint
from jbeamshell.laws.parallel_iwan import ParallelIwan


class Elements(ParallelIwan):
    """Joints of a structure, J laws of s sliders at most and a spring each.

    `line`, `tangent`, `loss` and `harmonic` take displacements (..., J).

    Attributes
    ----------
    stiffnesses, ends : (J, s) stiffnesses of the sliders, and displacements at which they slip;
        those of zero stiffness fill short rows
    remaining : (J,) spring that never slips
    """

    heading: ClassVar[str] = "elements"

    stiffnesses: Array
    ends: Array
    remaining: Array

    @property
    def springs(self) -> Array:
        """Stiffnesses (J, s) of the sliders."""
        return self.stiffnesses

    @property
    def slips(self) -> Array:
        """Displacements (J, s) at which the sliders slip on first loading."""
        return self.ends

    @property
    def spring(self) -> Array:
        """Stiffnesses (J,) of the springs."""
        return self.remaining


def elements_of(joints: Sequence[Joint]) -> Elements:
    """Elements of joints, whose numbers may be traced."""
    return _stacked([joint.but(scene=None, sides=None) for joint in joints])


@in_double
@eqx.filter_jit
def _stacked(joints: list[Joint]) -> Elements:
    most = max((joint.springs.size for joint in joints), default=0)

    def rows(values: list[Array], filling: float) -> Array:
        filled = [jnp.pad(row, (0, most - row.size), constant_values=filling) for row in values]
        return jnp.stack(filled) if filled else jnp.zeros((0, most))

    return Elements(
        rows([joint.springs for joint in joints], 0.0),
        rows([joint.slips for joint in joints], 1.0),
        jnp.stack([joint.spring for joint in joints]) if joints else jnp.zeros(0),
    )

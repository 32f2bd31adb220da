"""Force elements of structures as arrays: sliders, springs, and cubic springs."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import TINY, as_leaf, require_number
from jbeamshell.dynamics.structure.joint import Joint


class CubicSpring(eqx.Module):
    """Elastic spring k u + c u^3 between two degrees of freedom, such as a membrane.

    Attributes
    ----------
    stiffness : k, not negative
    cubic : c; stiffens if positive

    Raises
    ------
    InputError
        for a stiffness that is negative, or no number

    Examples
    --------
    >>> float(CubicSpring(1.0, 0.5).backbone(2.0))
    6.0
    """

    stiffness: Array
    cubic: Array

    def __init__(self, stiffness: Any, cubic: Any) -> None:
        self.stiffness = as_leaf(stiffness, "spring.stiffness")
        self.cubic = as_leaf(cubic, "spring.cubic")
        require_number("spring.stiffness", self.stiffness, "must not be negative", low=-TINY)

    @property
    def reach(self) -> Array:
        """Largest displacement at which the spring is known: infinite."""
        return jnp.asarray(jnp.inf)

    def backbone(self, u: ArrayLike) -> Array:
        """Force; any shape."""
        size = jnp.asarray(u)
        return self.stiffness * size + self.cubic * size**3


class Laws(NamedTuple):
    """Force elements of a structure: s sliders at most, a spring and a cubic spring each.

    Attributes
    ----------
    springs, limits : (J, s) stiffnesses and limits of the sliders; zeros fill short rows
    stuck : (J,) stiffness with all sliders stuck
    remaining, cubic : (J,) spring that never slips, and coefficient of u^3
    """

    springs: Array
    limits: Array
    stuck: Array
    remaining: Array
    cubic: Array


@eqx.filter_jit
def laws_of(elements: list[Joint | CubicSpring]) -> Laws:
    """Arrays of the elements; their numbers may be traced."""
    rows = [_row(element) for element in elements]
    most = max((row[0].size for row in rows), default=0)

    def padded(place: int) -> Array:
        filled = [jnp.pad(row[place], (0, most - row[place].size)) for row in rows]
        return jnp.stack(filled) if filled else jnp.zeros((0, most))

    def column(place: int) -> Array:
        return jnp.stack([row[place] for row in rows]) if rows else jnp.zeros(0)

    return Laws(padded(0), padded(1), column(2), column(3), column(4))


def _row(element: Joint | CubicSpring) -> tuple[Array, Array, Array, Array, Array]:
    """Springs and limits of the sliders, stuck stiffness, remaining spring, cubic coefficient."""
    if isinstance(element, CubicSpring):
        return jnp.zeros(0), jnp.zeros(0), element.stiffness, element.stiffness, element.cubic
    return element.springs, element.limits, element.stiffness, element.spring, jnp.zeros(())

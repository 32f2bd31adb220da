"""Doubt about fitted values that no material and no surface has: a unit of the data is wrong.

A loop in a wrong unit has the shape of a right one.  Where a stiffness is free, that takes the
whole factor, and the misfit tells nothing.
"""

from __future__ import annotations

from jbeamshell.identify.bijection import Bijection
from jbeamshell.identify.search_space import SearchSpace
from jbeamshell.identify.starts import FRICTIONS, STIFFNESS
from jbeamshell.measured.findings import TOO_LARGE, TOO_SMALL, TOO_SOFT, TOO_STIFF, UNIT_ERROR

FRICTION = "contact.friction"
START = "if all are right, start nearer"


def doubt_of_units(space: SearchSpace, values: list[float]) -> list[str]:
    """Sentences on values that a wrong unit explains; none if all may be right.

    Parameters
    ----------
    space : search space, n axes
    values : (n,) fitted values
    """
    stiff: list[str] = []
    slippery: list[str] = []
    for name, one, bijection, value in zip(
        space.names, space.parameters, space.bijections, values, strict=True
    ):
        if one.key in STIFFNESS and (side := _beyond(bijection, value)):
            units = TOO_STIFF if side > 0 else TOO_SOFT
            stiff.append(f"{name} = {value:.4g}, {_far(bijection, value)}: {units}; {START}")
        elif one.key == FRICTION and not FRICTIONS[0] <= value <= FRICTIONS[1]:
            units = TOO_LARGE if value > FRICTIONS[1] else TOO_SMALL
            slippery.append(f"{name} = {value:.4g}, which no surface has: {units}")
    # A stiffness tells which of the two units is wrong.
    return stiff or slippery


def _beyond(bijection: Bijection, value: float) -> int:
    """1 if a stiffness ended far above its start or at its upper bound, -1 below, 0 for neither."""
    bound, ratio = bijection.bound_at(value), value / bijection.start
    if bound is not None:
        return 1 if bound == bijection.high else -1
    return (ratio > UNIT_ERROR) - (ratio < 1.0 / UNIT_ERROR)


def _far(bijection: Bijection, value: float) -> str:
    """Distance of a value from its start, in words."""
    if bijection.bound_at(value) is not None:
        return "at its bound"
    ratio = value / bijection.start
    factor, side = (ratio, "above") if ratio > 1.0 else (1.0 / ratio, "below")
    return f"{factor:.4g} times {side} its start, which no other material explains"

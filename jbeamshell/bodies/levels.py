"""Levels of the contact of two bodies: what a solver finds at each load of its path."""

from __future__ import annotations

from typing import NamedTuple

from jax import Array


class Levels(NamedTuple):
    """Contact under the pressing alone, then at the loads of a path.

    Attributes
    ----------
    loads, displacements : (levels + 1, m) loads, and the displacements conjugate to them since the
        pressing
    slip : (levels + 1, n) since the pressing; (levels + 1, n, 2) on a face
    gap : (levels + 1, n)
    friction_force : (levels + 1, n) or (levels + 1, n, 2) nodal forces of friction on what is below
    normal_force : (levels + 1, n) nodal forces
    slipping : (levels + 1, n) True for nodes that slip at the end of the step
    slip_work : (levels + 1,) work of friction in the step
    sound : (levels + 1,) True where this and all levels before it have an equilibrium
    error : (levels + 1,) force out of balance, over the largest one of a node
    iterations : (levels + 1,) of Newton's method; 0 where events are walked
    """

    loads: Array
    displacements: Array
    slip: Array
    gap: Array
    friction_force: Array
    normal_force: Array
    slipping: Array
    slip_work: Array
    sound: Array
    error: Array
    iterations: Array


class Found(NamedTuple):
    """Outcome of a solver of contacts.

    Attributes
    ----------
    levels : all that the path has
    cycles : number of cycles until the loop is steady, of a path that goes on until it is
    coarse : levels in half as many load steps, every second one; None where events are walked, and
        where they are of no use
    coarser : the same on a coarser mesh of a face; None where there is none
    """

    levels: Levels
    cycles: Array | int
    coarse: Levels | None = None
    coarser: Levels | None = None

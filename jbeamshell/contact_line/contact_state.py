"""State of a contact at a load, and the one under the pressures alone."""

from __future__ import annotations

from typing import NamedTuple

from jax import Array

from jbeamshell.contact_line.body import Body


class ContactState(NamedTuple):
    """Contact at a load, n nodes: slip v since the pressure, nodal forces, load, displacement."""

    v: Array
    r_t: Array
    r_n: Array
    force: Array
    displacement: Array


def pressed(body: Body) -> ContactState:
    """Contact under the pressures alone."""
    return ContactState(0.0 * body.f_t, body.t_0, body.r_0, body.c * 0.0, body.c * 0.0)

r"""Stiffness of a strip with linear strains, entry by entry.

An element of length h has, for the fields i and j of its ends a and b, the stiffness

    K = h c M_ss + c' M_sd + c'' M_ds + c''' M_dd/h,

where M is the Hessian of the section's strain energy in its fields s and their slopes d, and the c
are integrals of the element's shapes.  The squeeze strain of the beamshell is taken at the nodes,
and `squeeze_at_even_force` is the stiffness against its difference between them.  Each entry of a
block is an array over the nodes; further axes are lanes: strips that are solved together.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.mechanics.section_form import squeeze_at_even_force
from jbeamshell.quasistatic.system import PSI, System, V, W

Blocks = list[list[Array]]  # m x m entries, (n, ...) each


class Band(NamedTuple):
    """Residual of a strip as a linear function of its unknowns, in units of mu F_N L.

    Attributes
    ----------
    lower, diagonal, upper : blocks of a node's rows in the columns of the node before, its own and
        the next one
    normal : (3, m) entries (n, ...): reaction per unknown, likewise
    rubbing : (n, ...) residual along v per traction
    """

    lower: Blocks
    diagonal: Blocks
    upper: Blocks
    normal: Blocks
    rubbing: Array


def band(system: System, section: Array, rough: bool) -> Band:
    """Band of a strip, with its supports with or without friction.

    Parameters
    ----------
    system : its arrays may have lanes behind their nodes
    section : (2, m, 2, m, ...) stiffness of the section, see `System.section_stiffness`
    rough : True if there is friction
    """
    active, supports = system.model.active, system.supports(rough)
    (own, onward), (back, end) = _elements(system, section)
    none = jnp.zeros_like(own[:, :, :1])
    middle = jnp.append(none, end, 2) + jnp.append(own, none, 2)
    near = jnp.append(none, back, 2), middle, jnp.append(onward, none, 2)

    def blocks(rows: Array, held: bool) -> Blocks:
        """Blocks of active fields; ``held`` is True for those that have the supports."""
        found = []
        for i in active:
            scale = system.residual_scale(i)
            row = [scale * rows[i, j] for j in active]
            for place, field in supports:
                if field == i:
                    here, stiffness = node(system.x, place), scale * supports[place, field]
                    fixed = [stiffness if held and i == j else 0.0 for j in active]
                    row = [jnp.where(here, a, b) for a, b in zip(fixed, row, strict=True)]
            found.append(row)
        return found

    normal = [[rows[W, j] / system.tributary for j in active] for rows in near]
    rubbing = system.residual_scale(V) * system.tributary
    if (0, V) in supports:
        rubbing = jnp.where(node(system.x, 0), 0.0, rubbing)
    lower, diagonal, upper = map(blocks, near, (False, True, False))
    return Band(lower, diagonal, upper, normal, rubbing)


def _elements(system: System, section: Array) -> Array:
    """Stiffness (2, 2, m, m, elements, ...) of the elements.

    Its axes are the end at which a force acts, the end of the field that causes it, and the two
    fields.
    """
    rule = system.element_rule
    given = section[:, :, :, :, None]  # the axis of the elements

    def integral(one: np.ndarray, other: np.ndarray) -> Array:
        found = np.einsum("q,qa,qb->ab", rule.weights, one, other).astype(section.dtype)
        return jnp.asarray(found.reshape(*found.shape, *[1] * (given.ndim - 2)))

    ss = integral(rule.values, rule.values) * given[0, :, 0]
    sd = integral(rule.values, rule.slopes) * given[0, :, 1]
    ds = integral(rule.slopes, rule.values) * given[1, :, 0]
    dd = integral(rule.slopes, rule.slopes) * given[1, :, 1]
    if system.section is None:
        apart = rule.squeeze - rule.values
        free = integral(apart, apart)[:, :, 0, 0] * squeeze_at_even_force(given)
        ss = ss.at[:, :, PSI, PSI].add(free)
    return ss * system.lengths + (sd + ds) + dd * (1.0 / system.lengths)


def node(x: Array, node: int) -> np.ndarray:
    """True at one node, in an array over the nodes."""
    here = np.zeros(x.shape[0], bool)
    here[node] = True
    return here.reshape(-1, *[1] * (x.ndim - 1))


def unheld(system: System, rough: bool, load: list[Array]) -> list[Array]:
    """Load, m entries (n, ...), without the part that acts on fields held at the ends."""
    free = list(load)
    for place, field in system.supports(rough):
        if field in system.model.active:
            i = system.model.active.index(field)
            free[i] = jnp.where(node(system.x, place), 0.0, free[i])
    return free


def times(rows: Sequence[Sequence[Array]], change: Sequence[Array]) -> Array:
    """Product (n, ...) of rows of a band and the unknowns, m arrays (n, ...)."""
    none = jnp.zeros_like(change[0][:1])
    near = (
        [jnp.append(none, each[:-1], 0) for each in change],
        change,
        [jnp.append(each[1:], none, 0) for each in change],
    )
    parts = [
        a * x
        for row, columns in zip(rows, near, strict=True)
        for a, x in zip(row, columns, strict=True)
    ]
    return sum(parts[1:], parts[0])

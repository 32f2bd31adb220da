r"""Stiffness of a strip with linear strains, entry by entry.

An element of length h has, for the fields i and j of its ends a and b, the stiffness

    K = h c M_ss + c' M_sd + c'' M_ds + c''' M_dd/h,

where M is the Hessian of the section's strain energy in its fields s and their slopes d, and the c
are integrals of the element's shapes.  Each entry of a block is an array over the nodes; further
axes are lanes: strips that are solved together.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.quasistatic.system import System, V, W

Blocks = list[list[Array]]  # m x m entries, (n, ...) each


class Band(NamedTuple):
    """Residual of a strip as a linear function of its unknowns, in units of mu F_N L.

    Attributes
    ----------
    lower, diagonal, upper : blocks of a node's rows in the columns of the node before, its own and
        the next one
    normal : (3, m) entries (n, ...): reaction per unknown, likewise
    rubbing : (n, ...) residual along v per traction
    held : fields that are held at X = 0
    """

    lower: Blocks
    diagonal: Blocks
    upper: Blocks
    normal: Blocks
    rubbing: Array
    held: tuple[int, ...]


def band(system: System, section: Array, rough: bool) -> Band:
    """Band of a strip, with its supports with or without friction.

    Parameters
    ----------
    system : its arrays may have lanes behind their nodes
    section : (2, m, 2, m, ...) stiffness of the section, see `System.section_stiffness`
    rough : True if there is friction
    """
    h, supports = system.lengths, system.supports(rough)
    none, one = jnp.zeros_like(h[:1]), jnp.ones_like(h)
    powers = [h, one, 1.0 / h]
    before, after = (
        [jnp.append(*pair, 0) for pair in zip(a, b, strict=True)]
        for a, b in (([none] * 3, powers), (powers, [none] * 3))
    )

    def rows(near: tuple[list[Array], list[Array], Array]) -> tuple[Blocks, ...]:
        return _rows(system, section, supports, *near)

    near = before, after, system.tributary
    # For one strip its nodes form a vector; for several strips the lanes do, node by node.
    lower, diagonal, upper, normal = rows(near) if h.ndim == 1 else lax.map(rows, near)
    rubbing = system.residual_scale(V) * system.tributary
    if V in supports:
        rubbing = jnp.where(node(system.x, 0), 0.0, rubbing)
    return Band(lower, diagonal, upper, normal, rubbing, tuple(supports))


def _rows(
    system: System,
    section: Array,
    supports: dict[int, Array],
    before: list[Array],
    after: list[Array],
    tributary: Array,
) -> tuple[Blocks, Blocks, Blocks, Blocks]:
    """Blocks of nodes from the powers 1, 0 and -1 of the lengths of the elements around them."""
    active, rule = system.model.active, system.element_rule

    def integral(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.einsum("q,qa,qb->ab", rule.weights, a, b)

    def element(i: int, j: int, powers: list[Array], a: int, b: int) -> Array:
        """Force on field i of end a per field j of end b."""
        own, other = system.shapes(i), system.shapes(j)
        ss, sd = integral(own, other)[a, b], integral(own, rule.slopes)[a, b]
        ds, dd = integral(rule.slopes, other)[a, b], integral(rule.slopes, rule.slopes)[a, b]
        factors = (
            ss * section[0, i, 0, j],
            sd * section[0, i, 1, j] + ds * section[1, i, 0, j],
            dd * section[1, i, 1, j],
        )
        parts = [factor * power for factor, power in zip(factors, powers, strict=True)]
        return sum(parts[1:], parts[0])

    def near(i: int, j: int) -> tuple[Array, Array, Array]:
        own = element(i, j, before, 1, 1) + element(i, j, after, 0, 0)
        return element(i, j, before, 1, 0), own, element(i, j, after, 0, 1)

    first = before[1] == 0.0

    def row(i: int) -> list[tuple[Array, ...]]:
        scale = system.residual_scale(i)
        entries = [tuple(scale * entry for entry in near(i, j)) for j in active]
        if i not in supports:
            return entries
        held: tuple[ArrayLike, ...] = (0.0, scale * supports[i], 0.0)
        return [
            tuple(
                jnp.where(first, jnp.asarray(own) if j == i else 0.0, entry)
                for own, entry in zip(held, entry_of_j, strict=True)
            )
            for j, entry_of_j in zip(active, entries, strict=True)
        ]

    found = [row(i) for i in active]
    lower, diagonal, upper = ([[entry[k] for entry in row] for row in found] for k in range(3))
    above = [near(W, j) for j in active]
    normal = [[entry[k] / tributary for entry in above] for k in range(3)]
    return lower, diagonal, upper, normal


def node(x: Array, node: int) -> np.ndarray:
    """True at one node, in an array over the nodes."""
    here = np.zeros(x.shape[0], bool)
    here[node] = True
    return here.reshape(-1, *[1] * (x.ndim - 1))


def unheld(system: System, band: Band, load: list[Array]) -> list[Array]:
    """Load, m entries (n, ...), without the part that acts on held fields."""
    first = node(system.x, 0)
    return [
        jnp.where(first, 0.0, each) if field in band.held else each
        for field, each in zip(system.model.active, load, strict=True)
    ]


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

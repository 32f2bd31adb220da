"""Tableau of a contact between two events, and its change at an event.

Along a branch of a load path, with q = (v, w) the change of the contact fields since the branch
began and tau the load since then,

    r = r_0 + matrix q - pull tau

are the forces of the base.  A tableau holds, row by row, what answers to what is held: a node that
sticks holds its slip and answers with its tangential force r_t; one that slips holds r_t + sigma mu
r_n and answers with its slip.  A closed node holds its lift and answers with its reaction r_n; an
open one the reverse.  Between two events all answers are linear in tau.  At an event one row and
one column are exchanged (a principal pivot, as in parametric complementarity: Cottle, Pang & Stone
1992, chapter 4), so that an event costs a product of two vectors.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.common.numbers_of import numbers_of, put

KINDS = 5  # of events
ALONG, AGAINST, STICK, OPEN, CLOSE = range(KINDS)


class Branch(NamedTuple):
    """Equations of a branch, r = r_0 + matrix q - pull tau, for k of n nodes that may slip.

    Attributes
    ----------
    matrix : (k + n, k + n) stiffness
    pull : (k + n,) part of the load that each clamped contact field carries, along the branch
    friction : mu
    r_0 : (k + n,) forces of the base where the branch begins
    lift : (n,) lift there
    """

    matrix: Array
    pull: Array
    friction: Array
    r_0: Array
    lift: Array


class Tableau(NamedTuple):
    """Contact between two events; rows and columns are the k tangential and the n normal ones.

    Attributes
    ----------
    matrix : (k + n, k + n) answers to what is held
    answer, rate : (k + n,) answers at tau, and their rates over it
    held : (k + n,) what is held
    sigma : (k,) 1 and -1 for nodes that slip along and against v, 0 for those that stick
    opened : (n,) True for open nodes
    tau : load since the branch began, positive
    """

    matrix: Array
    answer: Array
    rate: Array
    held: Array
    sigma: Array
    opened: Array
    tau: Array

    @property
    def moving(self) -> Array:
        """True for fields (k + n,) that answer, False for those that are held."""
        return jnp.concatenate([self.sigma != 0.0, self.opened])

    @property
    def change(self) -> Array:
        """Change q (k + n,) of the fields since the branch began."""
        return jnp.where(self.moving, self.answer, self.held)

    @property
    def velocity(self) -> Array:
        """Rate (k + n,) of q over tau."""
        return jnp.where(self.moving, self.rate, 0.0)

    def at(self, tau: Array) -> Tableau:
        """Tableau at a later tau without an event between."""
        return self._replace(answer=self.answer + self.rate * (tau - self.tau), tau=tau)


def begun(branch: Branch, opened: Array) -> Tableau:
    """Tableau where a branch begins: the nodes ``opened`` (n,) stay open, all others stick.

    An open node may still have a reaction, where the branch before ended while it opened or closed.
    It keeps that, with the friction that goes with it, until it closes.
    """
    n = branch.lift.size
    k = branch.pull.size - n
    start = Tableau(
        matrix=branch.matrix,
        answer=branch.r_0,
        rate=-branch.pull,
        held=jnp.zeros_like(branch.pull),
        sigma=jnp.zeros(k, branch.pull.dtype),
        opened=jnp.zeros(n, bool),
        tau=jnp.zeros_like(branch.friction),
    )

    def open_next(at: Tableau) -> Tableau:
        i = jnp.argmax(opened & ~at.opened)
        sticks = (i < k) & (at.sigma[jnp.minimum(i, k - 1)] == 0.0)  # it slips before it opens
        way = jnp.where(at.answer[jnp.minimum(i, k - 1)] > 0.0, AGAINST, ALONG)
        return changed(branch, at, jnp.where(sticks, way, OPEN), i, keeps=True)

    return lax.while_loop(lambda at: jnp.any(opened & ~at.opened), open_next, start)


def changed(
    branch: Branch, at: Tableau, kind: Array | int, node: Array, keeps: Array | bool = False
) -> Tableau:
    """Tableau after an event of a kind at a node.

    Parameters
    ----------
    keeps : True for a node that opens with the reaction it has, or closes with its lift
    """
    friction = branch.friction
    kind = jnp.asarray(kind)
    tangential, normal, i = places(at, kind, node)
    slips, sticks = kind < STICK, kind == STICK
    # A slipping node holds r_t + sigma mu r_n: before it slips its row becomes that sum, and after
    # it sticks again the sum is taken apart.
    sigma = jnp.where(kind == ALONG, 1.0, -1.0)
    added = jnp.where(slips, sigma * friction, 0.0)
    rest = jnp.where(sticks, -at.sigma[tangential] * friction, 0.0)
    lines = lines_of(at.matrix, i, normal, added)
    pivot = lines.row[i]
    share = lines.column / pivot
    entry = at.rate[i] + added * at.rate[normal]
    beside = at.rate[normal] - share[normal] * entry
    rate = (at.rate - share * entry).at[i].set(rest * beside - entry / pivot)

    # What answered is held from now on, and the reverse.
    answer, held = at.answer[i], at.held[i]
    with_reaction = answer + added * at.answer[normal]
    apart = jnp.where(kind == CLOSE, -branch.lift[node], 0.0)  # neither lift nor reaction
    now = jnp.where(slips, sigma, jnp.where(sticks, 0.0, at.sigma[tangential]))
    opened = jnp.where(kind < OPEN, at.opened[node], kind == OPEN)
    return Tableau(
        matrix=exchanged(lines, i, normal, rest),
        answer=at.answer.at[i].set(held + rest * at.answer[normal]),
        rate=rate,
        held=at.held.at[i].set(jnp.where((kind <= STICK) | keeps, with_reaction, apart)),
        sigma=at.sigma.at[tangential].set(now),
        opened=at.opened.at[node].set(opened),
        tau=at.tau,
    )


def places(at: Tableau, kind: Array, node: Array) -> tuple[Array, Array, Array]:
    """Rows of a node: the tangential, the normal, and the one that an event of a kind exchanges."""
    k = at.sigma.size
    tangential, normal = jnp.minimum(node, k - 1), k + node
    return tangential, normal, jnp.where(kind < OPEN, tangential, normal)


class Lines(NamedTuple):
    """Matrix (rows, columns) and those of its lines that an exchange is made of.

    Attributes
    ----------
    matrix : (rows, columns)
    row, beside : (columns,) row that is exchanged, and another one
    column : (rows,) column that is exchanged
    """

    matrix: Array
    row: Array
    beside: Array
    column: Array


def lines_of(
    matrix: Array, i: Array, other: Array | None = None, added: Array | float = 0.0
) -> Lines:
    """Lines to exchange row and column ``i``, to whose row ``added`` times the row ``other`` goes.

    In JAX they are read in a loop that runs once.  Otherwise the compiler reads them from the
    matrix whenever it needs them, and copies the whole matrix before it is overwritten.
    """
    other = i if other is None else other

    def lines(whole: Array) -> Lines:
        return Lines(whole, whole[i] + added * whole[other], whole[other], whole[:, i])

    if numbers_of(matrix) is np:
        return lines(matrix)
    none = jnp.zeros(matrix.shape[1], matrix.dtype)
    unread = Lines(matrix, none, none, jnp.zeros(matrix.shape[0], matrix.dtype))

    def read(now: tuple[Lines, Array]) -> tuple[Lines, Array]:
        return lines(now[0].matrix), jnp.asarray(False)

    return lax.while_loop(lambda now: now[1], read, (unread, jnp.asarray(True)))[0]


def exchanged(
    lines: Lines, i: Array, other: Array | None = None, rest: Array | float = 0.0
) -> Array:
    """Matrix with row and column ``i`` exchanged; ``rest`` times the new row ``other`` is added."""
    other = i if other is None else other
    matrix, row, beside, column = lines
    pivot = row[i]
    share = column / pivot
    beside = put(beside - share[other] * row, i, share[other])
    new = put(-row / pivot, i, 1.0 / pivot) + rest * beside
    swept = matrix - share[:, None] * row
    return put(put(swept, (slice(None), i), share), i, new)

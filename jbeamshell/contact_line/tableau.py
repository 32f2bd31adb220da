"""Tableau of a contact between two events, and its change at an event.

Between two events all changes are linear in the load.  A tableau holds what answers, row by row,

    answer = value + rate tau + sum over what is held (matrix . held),

with tau the load since the last reversal.  A node that sticks holds its slip and answers with its
tangential force r_t; one that slips holds r_t + sigma mu r_n at zero and answers with its slip.  A
closed node holds its lift and answers with its reaction r_n; an open one the reverse.  At an event
one row and one column are exchanged (a principal pivot, as in parametric complementarity: Cottle,
Pang & Stone 1992, chapter 4), so that an event costs a product of two vectors.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array, lax

from jbeamshell.contact_line.branches import ContactState

KINDS = 5  # of events
ALONG, AGAINST, STICK, OPEN, CLOSE = range(KINDS)


class System(NamedTuple):
    """Equations of a body with q = (v, w): r = reference + matrix q - pull F, u = c F + pull.q.

    Attributes
    ----------
    matrix : (k + n, k + n) stiffness
    pull : (k + n,) part of the load that each clamped contact field carries
    c : displacement per load with a clamped contact
    friction : mu
    reference : (k + n,) forces of the base at q = 0 without a load
    """

    matrix: Array
    pull: Array
    c: Array
    friction: Array
    reference: Array


class Tableau(NamedTuple):
    """Contact between two events; k of n nodes may slip.

    Rows are the k tangential and the n normal ones, and the displacement of the loaded end.
    Columns are the tangential and the normal ones.  Loads of one body that have met the same
    events share all but the value, what is held, tau and the work, which then have one more axis,
    the last.

    Attributes
    ----------
    matrix : (k + n + 1, k + n)
    value, rate : (k + n + 1,) answers at tau = 0, and their rates over tau
    sigma : (k,) 1 and -1 for nodes that slip along and against v, 0 for those that stick
    opened : (n,) True for open nodes
    held : (k,) slip at which sticking nodes are held, since the reversal
    tau : load since the reversal, positive
    work : work of friction since the reversal
    events : count since the reversal
    """

    matrix: Array
    value: Array
    rate: Array
    sigma: Array
    opened: Array
    held: Array
    tau: Array
    work: Array
    events: Array

    def at(self, tau: Array) -> Array:
        """All answers at a tau of this stretch; (rows, loads) at those of many loads."""
        return self.value + jnp.multiply.outer(self.rate, tau)

    def fields(self, tau: Array, origin: Array) -> tuple[Array, Array]:
        """Fields q = (v, w) and reactions r_n at a tau; ``origin`` is v at the reversal."""
        k, n = self.sigma.size, self.opened.size
        answer = self.at(tau)
        slip = jnp.where(self.sigma == 0.0, self.held, answer[:k])
        normal = answer[k : k + n]
        lift = jnp.where(self.opened, normal, 0.0)
        return jnp.concatenate([origin + slip, lift]), jnp.where(self.opened, 0.0, normal)


def empty(k: int, n: int) -> Tableau:
    """Tableau of no contact, to be filled at the first reversal."""
    zero, rows = jnp.zeros(()), jnp.zeros(k + n + 1)
    return Tableau(
        matrix=jnp.zeros((k + n + 1, k + n)),
        value=rows,
        rate=rows,
        sigma=jnp.zeros(k),
        opened=jnp.zeros(n, bool),
        held=jnp.zeros(k),
        tau=zero,
        work=zero,
        events=jnp.asarray(0),
    )


def reversed_at(
    system: System, state: ContactState, lift: Array, opened: Array, sense: Array
) -> Tableau:
    """Tableau at a reversal: the nodes ``opened`` (n,) stay open, all others stick."""
    k, n = state.v.size, lift.size
    start = empty(k, n)._replace(
        matrix=jnp.concatenate([system.matrix, system.pull[None]]),
        value=jnp.concatenate([state.r_t, state.r_n, state.displacement[None]]),
        rate=sense * jnp.append(-system.pull, system.c),
    )

    def open_next(at: Tableau) -> Tableau:
        i = jnp.argmax(opened & ~at.opened)
        sticks = (i < k) & (at.sigma[jnp.minimum(i, k - 1)] == 0.0)  # it slips before it opens
        return changed(at, jnp.where(sticks, ALONG, OPEN), i, system.friction)

    end = lax.while_loop(lambda at: jnp.any(opened & ~at.opened), open_next, start)
    value = end.value.at[k : k + n].add(jnp.where(opened, lift, 0.0))
    return end._replace(value=value, events=jnp.asarray(0))


def changed(at: Tableau, kind: Array | int, node: Array, friction: Array) -> Tableau:
    """Tableau after an event of a kind at a node."""
    kind = jnp.asarray(kind)
    k = at.sigma.size
    tangential, normal = jnp.minimum(node, k - 1), k + node
    slips, sticks = kind < STICK, kind == STICK
    i = jnp.where(kind < OPEN, tangential, normal)
    # A slipping node holds r_t + sigma mu r_n: before it slips its row becomes that sum, and after
    # it sticks again the sum is taken apart.  Slip is counted from where the node was held.
    sigma = jnp.where(kind == ALONG, 1.0, -1.0)
    slip = at.value[tangential] + at.rate[tangential] * at.tau
    held = at.held[tangential]
    added = jnp.where(slips, sigma * friction, 0.0)
    rest = jnp.where(sticks, -at.sigma[tangential] * friction, 0.0)
    lines = lines_of(at.matrix, i, normal, added)
    pivot = lines.row[i]
    share = lines.column / pivot

    def column(old: Array, less: Array | float, more: Array | float) -> Array:
        entry = old[i] + added * old[normal] - less
        beside = old[normal] - share[normal] * entry
        swept = old - jnp.multiply.outer(share, entry)
        return swept.at[i].set(rest * beside - entry / pivot + more)

    now = jnp.where(slips, sigma, jnp.where(sticks, 0.0, at.sigma[tangential]))
    opened = jnp.where(kind < OPEN, at.opened[node], kind == OPEN)
    return at._replace(
        matrix=exchanged(lines, i, normal, rest),
        value=column(at.value, jnp.where(sticks, slip, 0.0), jnp.where(slips, held, 0.0)),
        rate=column(at.rate, 0.0, 0.0),
        sigma=at.sigma.at[tangential].set(now),
        opened=at.opened.at[node].set(opened),
        held=at.held.at[tangential].set(jnp.where(sticks, slip, jnp.where(slips, 0.0, held))),
        events=at.events + 1,
    )


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

    They are read in a loop that runs once.  Otherwise the compiler reads them from the matrix
    whenever it needs them, and copies the whole matrix before it is overwritten.
    """
    other = i if other is None else other

    def read(now: tuple[Lines, Array]) -> tuple[Lines, Array]:
        whole = now[0].matrix
        beside = whole[other]
        row = whole[i] + added * beside
        return Lines(whole, row, beside, whole[:, i]), jnp.asarray(False)

    none = jnp.zeros(matrix.shape[1], matrix.dtype)
    unread = Lines(matrix, none, none, jnp.zeros(matrix.shape[0], matrix.dtype))
    return lax.while_loop(lambda now: now[1], read, (unread, jnp.asarray(True)))[0]


def exchanged(
    lines: Lines, i: Array, other: Array | None = None, rest: Array | float = 0.0
) -> Array:
    """Matrix with row and column ``i`` exchanged; ``rest`` times the new row ``other`` is added."""
    other = i if other is None else other
    matrix, row, beside, column = lines
    pivot = row[i]
    share = column / pivot
    beside = (beside - share[other] * row).at[i].set(share[other])
    new = (-row / pivot).at[i].set(1.0 / pivot) + rest * beside
    swept = matrix - share[:, None] * row
    return swept.at[:, i].set(share).at[i].set(new)

"""Pressing: contact of a body under its pressures alone, without friction, which may leave gaps.

The pressing is the linear complementarity problem

    r_n = r_0 + A w,    w >= 0,    r_n >= 0,    w.r_n = 0,

with A the stiffness of the lift once the tangential displacements have settled.  It is followed
from forces that close all nodes, r_n = (1 - s) even + s r_0, to s = 1: at an event a node opens or
closes and one row and one column of a tableau are exchanged (Lemke's method; Cottle, Pang & Stone
1992, chapter 4), so that a contact is found in as many events as nodes open.
"""

from __future__ import annotations

from typing import NamedTuple

from jax import Array

from jbeamshell.common.failed import nan_unless
from jbeamshell.common.numbers_of import numbers_of, put, while_loop, without_slopes
from jbeamshell.contact_line.tableau import exchanged, lines_of
from jbeamshell.numerics.factors import solve

MOST_EVENTS = 8  # times the nodes


class Pressing(NamedTuple):
    """Contact under the pressures alone.

    Attributes
    ----------
    lift : (n,) lift w, NaN if no contact was found
    settled : (k,) tangential displacements
    reaction : (n,) nodal forces of the base
    """

    lift: Array
    settled: Array
    reaction: Array


def press(
    k_tt: Array,
    k_tn: Array,
    k_nn: Array,
    press_t: Array,
    press_n: Array,
    foundation: bool = True,
    gap: Array | None = None,
) -> Pressing:
    """Pressing of a body without friction.

    First derivatives are exact: they are those of the contact that was found.

    Parameters
    ----------
    k_tt, k_tn, k_nn : (k, k), (k, n) and (n, n) stiffness
    press_t, press_n : (k,) and (n,) nodal forces of the base if nothing moved
    foundation : False to leave the body without a base under pressures that balance; the last node
        keeps its height
    gap : (n,) distance of the nodes before anything presses; None is none.  The lift is what is
        left of it
    """
    xp = numbers_of(k_tt, k_tn, k_nn, press_t, press_n, gap)
    solution = solve(k_tt, xp.concatenate([k_tn, press_t[:, None]], axis=1))
    stiffness = k_nn - k_tn.T @ solution[:, :-1]
    r_0 = press_n - k_tn.T @ solution[:, -1]
    down, distance = xp.sum(r_0), 0.0 * r_0 if gap is None else gap
    r_0 = r_0 - stiffness @ distance
    opened, ends = xp.arange(r_0.size) < r_0.size - 1, xp.asarray(True)
    if foundation:
        opened, ends = _open_nodes(*without_slopes((stiffness, r_0, down)))
    block = opened[:, None] & opened
    matrix = xp.where(block, stiffness, xp.diag(xp.diag(stiffness)))
    lift = xp.where(opened, solve(matrix, xp.where(opened, -r_0, 0.0)), 0.0)
    lift = nan_unless(ends, lift)
    reaction = xp.where(opened | (not foundation), 0.0, r_0 + stiffness @ lift)
    return Pressing(lift, -solution[:, -1] - solution[:, :-1] @ (lift - distance), reaction)


def _open_nodes(stiffness: Array, r_0: Array, down: Array) -> tuple[Array, Array]:
    """Open nodes (n,), and True if the events came to an end; ``down`` is the whole pressure."""
    xp, n = numbers_of(stiffness, r_0), r_0.size
    even = xp.maximum(down, 0.0) / n * xp.ones(n)
    rows = xp.concatenate([stiffness, even[:, None], (r_0 - even)[:, None]], axis=1)

    class Walk(NamedTuple):
        rows: Array
        opened: Array
        at: Array
        events: Array

    def next_event(now: Walk) -> tuple[Array, Array]:
        value, rate = now.rows[:, -2] + now.rows[:, -1] * now.at, now.rows[:, -1]
        wait = xp.maximum(value, 0.0) / xp.where(rate < 0.0, -rate, 1.0)
        wait = xp.where(rate < 0.0, wait, xp.inf)
        node = xp.argmin(wait)
        return now.at + wait[node], node

    def unfinished(now: Walk) -> Array:
        return (next_event(now)[0] < 1.0) & (now.events < MOST_EVENTS * n)

    def go(now: Walk) -> Walk:
        at, node = next_event(now)
        rows = exchanged(lines_of(now.rows, node), node)
        return Walk(rows, put(now.opened, node, ~now.opened[node]), at, now.events + 1)

    start = Walk(rows, xp.zeros(n, bool), xp.zeros(()), xp.asarray(0))
    end = while_loop(unfinished, go, start)
    return end.opened, (next_event(end)[0] >= 1.0) & (down > 0.0)

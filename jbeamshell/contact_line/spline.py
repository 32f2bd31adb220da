r"""Branch read on the spline of its events.

The contact at the events is a polygon over the load, y(tau) = y_0 + sum kappa_e (tau - tau_e)_+,
with the change kappa_e of the rate at event e.  Its corners come from the mesh: nodes slip, open
and close one after the other, where a front moves steadily.  So each corner is rounded by a
parabola, between the loads at which the front comes to this node and to the next one.  A node slips
when the front has passed half of the element behind it, as in a bar.  So an element's share of the
step from event to event tells when the front is at a node.  With t from 0 to 1 and the two parts a
and b of a corner,

    tau - tau_e = -a + 2 a t + (b - a) t^2,    (tau - tau_e)_+  becomes  b t^2.

Where one front moves alone on even elements that is the quadratic B-spline of the polygon.  Of
several fronts each is rounded over its own steps.  The corner where the first front starts may
reach back to the begin of the branch.  That of a later front reaches back by a quarter of its load
at most: its next step may be far away, beyond the end of the branch.  The first loading of a bar is
exact, whatever its elements.  A corner that no front makes stays sharp, as where a whole body slips
at once or a bolt comes to bear.

All equations that are linear hold exactly on the spline: balance, and u = c F + f.q.  Coulomb's and
Signorini's conditions hold as far as convexity goes: a node that opens or closes within a rounded
corner has a little lift and a little reaction at once.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from jbeamshell.contact_line.polygon import MOST_PART, STARTS, UNEVEN, Polygon, Slip, starts_late
from jbeamshell.contact_line.tableau import Branch


class Reading(NamedTuple):
    """Contact at loads (levels,) of a branch.

    Attributes
    ----------
    change : (levels, k + n) change q of the fields since the branch began
    r : (levels, k + n) forces of the base
    work : (levels,) work of friction since then
    slipping : (levels, k) True for nodes that slip by more than the part of a rounded corner
    slides : (levels,) True where the body slides as a whole
    """

    change: Array
    r: Array
    work: Array
    slipping: Array
    slides: Array


def read(branch: Branch, polygon: Polygon, x: Array, tau: Array, slides: Array) -> Reading:
    """Contact at loads tau (levels,) of a branch; ``slides`` is that of `polygon.polygon`.

    Parameters
    ----------
    x : (n,) positions of the nodes, of which the first k count
    """
    k = branch.pull.size - branch.lift.size
    rates, edge = _rates(polygon), _edge(polygon, tau)
    sliding = jnp.abs(rates @ branch.pull) > slides
    before, behind = _corners(polygon, x, sliding)
    since = tau - polygon.tau[edge]
    kinks = jnp.diff(rates, axis=0, prepend=rates[:1])
    rounding, area = jax.vmap(lambda at: _rounding(at - polygon.tau, before, behind))(tau)
    change = polygon.change[edge] + rates[edge] * since[:, None] + rounding @ kinks

    # Work of friction: the load's on the fields, int tau d(pull.q), less what the body stores.
    pulled, rise = polygon.change @ branch.pull, rates @ branch.pull
    steps = jnp.diff(polygon.tau, append=polygon.tau[-1:])
    below = steps * (pulled + 0.5 * rise * steps)
    whole = jnp.append(0.0, jnp.cumsum(below[:-1]))
    under = whole[edge] + since * (pulled[edge] + 0.5 * rise[edge] * since)
    under = under + area @ (kinks @ branch.pull)
    push = change @ branch.matrix
    stored = change @ branch.r_0 + 0.5 * jnp.sum(change * push, axis=1)
    return Reading(
        change=change,
        r=branch.r_0 + push - tau[:, None] * branch.pull,
        work=tau * (change @ branch.pull) - under - stored,
        slipping=rates[edge][:, :k] != 0.0,
        slides=sliding[edge],
    )


def slipped(polygon: Polygon, slip: Slip, x: Array, reach: Array) -> tuple[Array, Array]:
    """Side (k,) on which nodes slipped up to a branch's end, and True for those that stuck again.

    A node whose corner is rounded at the end has slipped by a part.
    """
    before, _ = _corners(polygon, x, jnp.zeros(polygon.tau.size, bool))
    begins = (polygon.tau - before)[slip.later]
    part = (slip.later > 0) & (begins < reach)
    return jnp.where(part, slip.later_side, slip.side), slip.stuck & ~part


def _rates(polygon: Polygon) -> Array:
    """Rates (most, k + n) along the edges that begin at the vertices, zero beyond the last."""
    ahead = jnp.diff(polygon.tau, append=0.0)
    known = jnp.arange(polygon.tau.size) < polygon.number - 1
    steps = jnp.roll(polygon.change, -1, axis=0) - polygon.change
    inverse = jnp.where(known, 1.0 / jnp.where(known, ahead, 1.0), 0.0)
    return jnp.where(known[:, None], steps * inverse[:, None], 0.0)


def _edge(polygon: Polygon, tau: Array) -> Array:
    """Numbers (levels,) of the edges on which loads lie."""
    known = jnp.arange(polygon.tau.size) < polygon.number
    loads = jnp.where(known, polygon.tau, jnp.inf)
    edge = jnp.searchsorted(loads, tau, side="left") - 1
    return jnp.clip(edge, 0, polygon.number - 2)


def _corners(polygon: Polygon, x: Array, sliding: Array) -> tuple[Array, Array]:
    """Parts (most,) of the rounded corners before and behind each vertex; zero for sharp ones."""
    tau, rows = polygon.tau, jnp.arange(polygon.tau.size)
    share = _shares(polygon, x)
    starts, ends = polygon.before == 0, polygon.after == 0
    ahead = (tau[polygon.after] - tau) * (1.0 - share[polygon.after])
    half = (tau - tau[polygon.before]) * share
    room = jnp.where(starts_late(polygon), STARTS * tau, tau)
    half = jnp.where(
        starts, jnp.minimum(room, ahead), jnp.minimum(half, UNEVEN * half[polygon.before])
    )
    ahead = jnp.where(ends, half, ahead)
    round_ones = (rows < polygon.number - 1) & ~(starts & ends) & ~sliding & ~jnp.roll(sliding, 1)
    before = jnp.where(round_ones, jnp.minimum(half, UNEVEN * ahead), 0.0)
    behind = jnp.where(round_ones, jnp.minimum(ahead, UNEVEN * half), 0.0)
    return before, behind


def _shares(polygon: Polygon, x: Array) -> Array:
    """Part (most,) of the step to a vertex that is nearer to it than to the vertex before.

    The front of a bar is at a node where it has gone through half of the element before it.
    """
    lengths = jnp.abs(jnp.diff(x))
    both = lengths[:-1] + lengths[1:]
    part = jnp.where(both > 0.0, lengths[1:] / jnp.where(both > 0.0, both, 1.0), 0.5)
    part = jnp.pad(part, 1, constant_values=0.5)[polygon.node]
    return jnp.clip(jnp.where(polygon.way, part, 1.0 - part), 1.0 - MOST_PART, MOST_PART)


def _rounding(since: Array, before: Array, behind: Array) -> tuple[Array, Array]:
    """Rounded corners less (tau - tau_e)_+, and their integral over the load; any shape.

    Parameters
    ----------
    since : tau - tau_e
    before, behind : parts of the corners
    """
    is_round = (before > 0.0) & (behind > 0.0)
    a, b = jnp.where(is_round, before, 1.0), jnp.where(is_round, behind, 1.0)
    inside = is_round & (since > -a) & (since < b)
    x = jnp.where(inside, since, 0.0)
    part = (x + a) / a
    t = part / (1.0 + jnp.sqrt(1.0 + (b - a) / a * part))
    rounding = jnp.where(inside, b * t**2 - jnp.maximum(x, 0.0), 0.0)

    def area(t: Array, x: Array) -> Array:
        return b * t**3 * (2.0 * a / 3.0 + 0.5 * (b - a) * t) - 0.5 * jnp.maximum(x, 0.0) ** 2

    whole = jnp.where(is_round & (since >= b), area(jnp.ones_like(t), b), 0.0)
    return rounding, jnp.where(inside, area(t, x), whole)

"""Branches of load from factors: exact micro-slip of a body whose slip zones are nested.

On a branch, from one reversal of the load to the next, slip starts at the loaded end and spreads
node by node.  With the nodes numbered from there, A = K_tt + sigma mu K_nt and

    A d = c_0 + g dF on the nodes that slip,
    c_0 = -(r_t + sigma mu r_n),   g = f_t + sigma mu f_n,

one factorisation A = L U without pivoting holds for every zone: the first k entries of
y = L^-1 (c_0 + g dF) depend on the first k nodes only.  Node k starts to slip where y_k = 0, at
dF_k = -y_ck / y_gk, and

    u - u_start = c dF + sum over k of z_k y_gk (dF - dF_k)_+,   z = U^-T f_t,

a network of sliders in series with thresholds dF_k and compliances z_k y_gk.  There are no load
steps and no iteration, and the work of friction is a closed sum.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.condensed.body import Body

SHRINK = 8  # powers of two from row to row of a matrix that is factorised


class Factors(NamedTuple):
    """Factors of a body for one sense of slip; k of its n contact nodes may slip.

    Attributes
    ----------
    lower, upper : (k, k) inverses of L and U
    y_g : (k,) L^-1 g
    z : (k,) U^-T f_t
    regular : (k,) True for nodes that come closer to slipping with every event before their own,
        and whose event makes no node slip backwards
    falls : (n, k + 1) rates of the reactions over the load between the events, where they fall
    draws : (k, k + 1) rates likewise of mu r_n + sigma r_t, which is zero where a node slips
    """

    lower: Array
    upper: Array
    y_g: Array
    z: Array
    regular: Array
    falls: Array
    draws: Array


class ContactState(NamedTuple):
    """Contact at a load, n nodes: slip v since the pressure, nodal forces, load, displacement."""

    v: Array
    r_t: Array
    r_n: Array
    force: Array
    displacement: Array


class Branch(NamedTuple):
    """One branch of load.

    Attributes
    ----------
    end : the contact at its end
    thresholds : (n,) change of load, positive, at which each node starts to slip
    compliances : (n,) compliance that its slip adds
    slip_work : work of friction along the branch
    slipping : (n,) True for nodes that slip at the end
    valid : True if the zones are nested, all nodes stay closed and none slips backwards
    """

    end: ContactState
    thresholds: Array
    compliances: Array
    slip_work: Array
    slipping: Array
    valid: Array


def factorise(body: Body, friction: Array) -> Factors:
    """Factors for slip along and against v, stacked along the first axis."""
    k = body.f_t.size
    k_nt, f_n = body.K_tn.T, body.f_n

    def one(sense: float) -> Factors:
        matrix = body.K_tt + sense * friction * k_nt[:k]
        lower, upper = inverse_factors(matrix)
        g = body.f_t + sense * friction * f_n[:k]
        y_g = lower @ g
        # Columns are the events; what has a leading column more starts before the first of them.
        slips = jnp.cumsum(upper * y_g, axis=1)
        before = ((0, 0), (1, 0))
        lifts = sense * (jnp.pad(k_nt @ slips, before) - f_n[:, None])
        rooms = jnp.pad(matrix @ slips, before) - g[:, None]
        backwards = jnp.any(jnp.triu(slips) < 0.0, axis=0)
        away = jnp.any(jnp.tril(rooms[:, :-1]) > 0.0, axis=1)
        return Factors(
            lower,
            upper,
            y_g,
            upper.T @ body.f_t,
            regular=~backwards & ~away,
            falls=jnp.minimum(lifts, 0.0),
            draws=jnp.minimum(rooms, 0.0),
        )

    return jax.tree.map(lambda a, b: jnp.stack([a, b]), one(1.0), one(-1.0))


def inverse_factors(matrix: Array) -> tuple[Array, Array]:
    """Inverses of L (unit diagonal) and U of a matrix L U (n, n), without pivoting."""
    lower, upper = lower_upper(matrix)
    one = jnp.eye(matrix.shape[0], dtype=matrix.dtype)
    return (
        lax.linalg.triangular_solve(lower, one, left_side=False, lower=True, unit_diagonal=True),
        lax.linalg.triangular_solve(upper, one, left_side=False),
    )


def lower_upper(matrix: Array) -> tuple[Array, Array]:
    """L (unit diagonal) and U of a matrix L U (n, n), without pivoting.

    NaN where a pivot is so small that rows would have to be exchanged.
    """
    n = matrix.shape[0]
    # Rows that shrink by powers of two keep LAPACK from exchanging them, and cost no digits.
    scale = 2.0 ** (-min(SHRINK, 900 // n) * np.arange(n))
    both, _, order = lax.linalg.lu(matrix * scale[:, None])
    exchanged = jnp.where(jnp.all(order == np.arange(n)), 0.0, jnp.nan)
    lower = jnp.tril(both * (scale / scale[:, None]), -1) + jnp.eye(n, dtype=matrix.dtype)
    return lower + exchanged, jnp.triu(both / scale[:, None]) + exchanged


def pressed(body: Body) -> ContactState:
    """Contact under the pressures alone."""
    zero = jnp.zeros_like(body.f_t)
    return ContactState(zero, zero, body.r_0, body.c * 0.0, body.c * 0.0)


def follow(
    body: Body, factors: Factors, friction: Array, start: ContactState, force: Array
) -> Branch:
    """One branch of load.

    Parameters
    ----------
    body, factors : see `factorise`
    friction : mu
    start : contact at the branch's start
    force : end load at its end
    """
    k = body.f_t.size
    step = force - start.force
    sense = jnp.where(step >= 0.0, 1.0, -1.0)
    reach = jnp.abs(step)
    own: Factors = jax.tree.map(lambda a: a[jnp.where(step >= 0.0, 0, 1)], factors)
    y_c = own.lower @ -(start.r_t + sense * friction * start.r_n[:k])
    thresholds = -sense * y_c / own.y_g
    slips = jnp.cumsum(thresholds >= reach) == 0
    slip = own.upper @ jnp.where(slips, y_c + own.y_g * step, 0.0)
    beyond = jnp.where(slips, reach - thresholds, 0.0)
    compliances = own.z * own.y_g
    forces = body.K_tt @ slip
    work = 0.5 * jnp.sum(compliances * beyond * (reach + thresholds))
    end = ContactState(
        start.v + slip,
        start.r_t + forces - body.f_t * step,
        start.r_n + slip @ body.K_tn - body.f_n * step,
        force,
        start.displacement + body.c * step + sense * jnp.sum(compliances * beyond),
    )
    return Branch(
        end=end,
        thresholds=thresholds,
        compliances=compliances,
        slip_work=work - start.r_t @ slip - 0.5 * slip @ forces,
        slipping=slips,
        valid=holds(own, friction, start, thresholds, slips, sense, reach),
    )


def path(
    body: Body, factors: Factors, friction: Array, start: ContactState, turns: Array
) -> Branch:
    """Branches to the turns (branches,) of a load path, stacked along the first axis."""

    def go(state: ContactState, force: Array) -> tuple[ContactState, Branch]:
        branch = follow(body, factors, friction, state, force)
        return branch.end, branch

    return lax.scan(go, start, turns)[1]


def holds(
    own: Factors,
    friction: Array,
    start: ContactState,
    thresholds: Array,
    slips: Array,
    sense: Array,
    reach: Array,
) -> Array:
    """True if what a branch assumes holds from its start to its end, seen from the safe side.

    The events rise, no node slips before its turn or backwards, reactions stay positive, and nodes
    beyond the slip zone stick.
    """
    k = thresholds.size
    tiny = 64.0 * jnp.finfo(thresholds.dtype).eps
    events = jnp.where(slips, thresholds, reach)
    between = jnp.maximum(jnp.diff(events, prepend=0.0, append=reach), 0.0)
    rising = jnp.all(jnp.diff(events, prepend=0.0) >= -tiny * reach)
    regular = jnp.all(own.regular | ~slips)
    closed = jnp.all(start.r_n + own.falls @ between > 0.0)  # an open node has none
    cap = friction * start.r_n[:k]
    room = cap + sense * start.r_t + own.draws @ between
    sticks = jnp.all(slips | (room >= -tiny * jnp.max(cap)))
    return rising & regular & closed & sticks

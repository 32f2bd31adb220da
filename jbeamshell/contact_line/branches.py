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
from jax import Array, lax

from jbeamshell.contact_line.body import Body
from jbeamshell.numerics.factors import lower_upper
from jbeamshell.numerics.running_sums import running_sums


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
    backs : (k, k + 1) rates, falling or not, of mu r_n - sigma r_t, which is zero where a node
        slips the other way, as long as the node sticks
    """

    lower: Array
    upper: Array
    y_g: Array
    z: Array
    regular: Array
    falls: Array
    draws: Array
    backs: Array


class ContactState(NamedTuple):
    """Contact at a load, n nodes: slip v since the pressure, nodal forces, load, displacement."""

    v: Array
    r_t: Array
    r_n: Array
    force: Array
    displacement: Array


class Branch(NamedTuple):
    """One branch of load, seen at one load () or at several (levels,), which lead the axes.

    Attributes
    ----------
    at : the contact at each load
    thresholds : (k,) change of load, positive, at which each node starts to slip
    compliances : (k,) compliance that its slip adds
    slip_work : work of friction from the branch's start to each load
    slipping : (k,) True for nodes that slip, at each load
    valid : True if the zones are nested, all nodes stay closed and none slips backwards
    """

    at: ContactState
    thresholds: Array
    compliances: Array
    slip_work: Array
    slipping: Array
    valid: Array


def factorise(body: Body, friction: Array) -> Factors:
    """Factors for slip along and against v, stacked along the first axis."""
    k = body.f_t.size
    k_nt, f_n = body.K_tn.T, body.f_n

    def of_sense(sense: Array) -> Factors:
        matrix = body.K_tt + sense * friction * k_nt[:k]
        g = body.f_t + sense * friction * f_n[:k]
        parts = lower_upper(matrix, g[:, None])
        upper, y_g = parts.inverse_upper, parts.reduced[:, 0]
        # Columns are the events; what has a leading column more starts before the first of them.
        slips = running_sums(upper * y_g)
        before = ((0, 0), (1, 0))
        lifts = sense * (jnp.pad(k_nt @ slips, before) - f_n[:, None])
        rooms = jnp.pad(running_sums(parts.lower * y_g), before) - g[:, None]  # matrix slips - g
        backwards = jnp.any(jnp.triu(slips) < 0.0, axis=0)
        away = jnp.any(jnp.tril(rooms[:, :-1]) > 0.0, axis=1)
        return Factors(
            parts.inverse_lower,
            upper,
            y_g,
            upper.T @ body.f_t,
            regular=~backwards & ~away,
            falls=jnp.minimum(lifts, 0.0),
            draws=jnp.minimum(rooms, 0.0),
            backs=jnp.tril(2.0 * friction * lifts[:k] - rooms),
        )

    return jax.vmap(of_sense)(jnp.asarray([1.0, -1.0], body.f_t.dtype))


def pressed(body: Body) -> ContactState:
    """Contact under the pressures alone."""
    zero = jnp.zeros_like(body.f_t)
    return ContactState(zero, body.t_0, body.r_0, body.c * 0.0, body.c * 0.0)


def follow(
    body: Body, factors: Factors, friction: Array, start: ContactState, forces: Array
) -> Branch:
    """One branch of load.

    Parameters
    ----------
    body, factors : see `factorise`
    friction : mu
    start : contact at the branch's start
    forces : () or (levels,) end loads along it, the last one at its end
    """
    k = body.f_t.size
    step = (forces - start.force)[..., None]
    rises = jnp.ravel(step)[-1] >= 0.0
    sense = jnp.where(rises, 1.0, -1.0)
    reach = jnp.abs(step)
    factors = jax.tree.map(lambda a: a[jnp.where(rises, 0, 1)], factors)
    y_c = factors.lower @ -(start.r_t + sense * friction * start.r_n[:k])
    thresholds = -sense * y_c / factors.y_g
    slips = running_sums((thresholds >= reach).astype(step.dtype)) == 0.0
    slip = jnp.where(slips, y_c + factors.y_g * step, 0.0) @ factors.upper.T
    beyond = jnp.where(slips, reach - thresholds, 0.0)
    compliances = factors.z * factors.y_g
    push = slip @ body.K_tt
    work = 0.5 * jnp.sum(compliances * beyond * (reach + thresholds), axis=-1)
    at = ContactState(
        start.v + slip,
        start.r_t + push - body.f_t * step,
        start.r_n + slip @ body.K_tn - body.f_n * step,
        forces,
        start.displacement + body.c * step[..., 0] + sense * (beyond @ compliances),
    )
    last = slips.reshape(-1, k)[-1], jnp.ravel(reach)[-1]
    return Branch(
        at=at,
        thresholds=thresholds,
        compliances=compliances,
        slip_work=work - slip @ start.r_t - 0.5 * jnp.sum(slip * push, axis=-1),
        slipping=slips,
        valid=_holds(factors, friction, start, thresholds, last[0], sense, last[1]),
    )


def path(
    body: Body, factors: Factors, friction: Array, start: ContactState, turns: Array
) -> Branch:
    """Branches to the turns (branches,) of a load path, stacked along the first axis."""

    def go(state: ContactState, force: Array) -> tuple[ContactState, Branch]:
        branch = follow(body, factors, friction, state, force)
        return branch.at, branch

    return lax.scan(go, start, turns)[1]


def _holds(
    factors: Factors,
    friction: Array,
    start: ContactState,
    thresholds: Array,
    slips: Array,
    sense: Array,
    reach: Array,
) -> Array:
    """True if what a branch assumes holds from its start to its end, seen from the safe side.

    The events rise, no node slips before its turn or backwards, none goes on slipping the way of
    the branch before, reactions stay positive, and nodes beyond the slip zone stick.
    """
    k = thresholds.size
    tiny = 64.0 * jnp.finfo(thresholds.dtype).eps
    events = jnp.where(slips, thresholds, reach)
    between = jnp.maximum(jnp.diff(events, prepend=0.0, append=reach), 0.0)
    rising = jnp.all(jnp.diff(events, prepend=0.0) >= -tiny * reach)
    regular = jnp.all(factors.regular | ~slips)
    closed = jnp.all(start.r_n + factors.falls @ between > 0.0)  # an open node has none
    cap = friction * start.r_n[:k]
    room = cap + sense * start.r_t + factors.draws @ between
    least = -tiny * jnp.max(cap)
    sticks = jnp.all(slips | (room >= least))
    behind = cap - sense * start.r_t + running_sums(factors.backs * between).T
    return rising & regular & closed & sticks & jnp.all(behind >= least)

"""Steady cycles of a body whose slip zones are nested, in closed form.

In a cycle of the end load between A and -A the larger slip zone, that of the push, wipes out what
came before: at -A the contact is that of a first push.  With A = L U and y of `branches`, the
slip u = p (before multiplication by U^-1) of the push to -A, of the pull from there to A, and of
the push back are

    p_1 = y_g A - y_r,    p_2 = U_2 U_1^-1 p_1 + y_g2 A - y_r2,    p_3 = U_1 U_2^-1 p_2,

each zero where it is not positive, with y_r = mu L^-1 r_0 and indices 1 for pushes and 2 for pulls.
Node k starts to slip at the change of load tau = 2A - p/y_g, and the work of a cycle is the sum of
z p tau / 2 over both branches, z = U^-T f_t: two products of a matrix and a vector.

The edge of a slip zone moves through the elements: when node k starts to slip, it is in the middle
of the element ahead.  So the nodes' thresholds are spread linearly between the loads at which the
edge passes from one node's element to the next.  That is exact for a bar, and takes the steps out
of the dissipation over the amplitude that a mesh would leave there.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.failed import nan_unless
from jbeamshell.contact_line.body import Body
from jbeamshell.numerics.factors import lower_upper

STEADY = 2  # cycles after which the dissipation repeats
GROUPS = 16  # of events, over which the least rate of a reaction stands for all
LITTLE = 1e-6  # of the largest rate or load: less does not count as a wrong sign


class CycleFactors(NamedTuple):
    """Factors of a body for steady cycles, for k of its n nodes that may slip.

    The first axis of pairs is 0 for pushes and 1 for pulls.

    Attributes
    ----------
    y_g, z : (2, k) L^-1 g and U^-T f_t
    threshold : (2, k) loads at which the nodes start to slip when loaded first
    begin, width : (2, k) loads over which the zone's edge goes through a node's element
    turned : (2, k, k) U of the other sense times the inverse of U of this one
    limit : () amplitude up to which first loading is nested and the contact closed
    reaction : (k + 1, n) nodal reactions in a first push, where so many nodes begin to slip
    rate : (k + 1, n) their change per load from there on
    swing : (2, n, groups) least change of the reactions per load, backwards in a push and onwards
        in a pull, where it is negative
    """

    y_g: Array
    z: Array
    threshold: Array
    begin: Array
    width: Array
    turned: Array
    limit: Array
    reaction: Array
    rate: Array
    swing: Array

    def dissipation(self, amplitudes: ArrayLike) -> Array:
        """Work of friction per cycle between A and -A, (amplitudes,), NaN where not nested."""
        return _works(self, jnp.asarray(amplitudes))

    def _work(self, amplitude: Array) -> Array:
        y_g, z, reach = self.y_g, self.z, 2.0 * amplitude
        diagonal = jnp.diagonal(self.turned, axis1=1, axis2=2)
        # Within a node p falls along a straight line, over the part of it that slips.
        part = jnp.clip((amplitude - self.begin[0]) / self.width[0], 0.0, 1.0)
        top = y_g[0] * jnp.maximum(amplitude - self.begin[0], 0.0)
        p_1 = part * (top - 0.5 * part * y_g[0] * self.width[0])
        y = self.turned[0] @ p_1 + y_g[1] * (amplitude - self.threshold[1])
        top = y + diagonal[0] * (top - p_1) - y_g[1] * (self.begin[1] - self.threshold[1])
        fall = diagonal[0] * y_g[0] * self.width[0] + y_g[1] * self.width[1]
        back = jnp.clip(top / fall, 0.0, part)
        low = top - back * fall
        p_2 = 0.5 * back * (top + low)
        square = back * (top**2 + top * low + low**2) / 3.0
        p_3 = self.turned[1] @ p_2
        rest = p_3 - diagonal[1] * p_2
        square_3 = part * rest**2 + diagonal[1] * (2.0 * rest * p_2 + diagonal[1] * square)
        pull = z[1] @ (reach * p_2 - square / y_g[1])
        push = z[0] @ (reach * p_3 - square_3 / y_g[0])
        inside = jnp.all(low <= jnp.where(part < 1.0, LITTLE * reach * y_g[1], jnp.inf))
        valid = inside & self._valid(amplitude, reach - p_3 / y_g[0], reach - y / y_g[1])
        return nan_unless(valid, 0.5 * (pull + push))

    def _valid(self, amplitude: Array, push: Array, pull: Array) -> Array:
        """True if events rise from reversal to reversal and reactions stay positive.

        Parameters
        ----------
        amplitude : A
        push, pull : (k,) changes of load at which the nodes start to slip in a steady cycle
        """
        k, groups = push.size, self.swing.shape[-1]
        edges = _edges(k, groups)[1:-1]
        reach = 2.0 * amplitude
        zone = jnp.sum(self.threshold[0] < amplitude)
        since = amplitude - jnp.append(0.0, self.threshold[0])[zone]
        reaction = self.reaction[zone] + self.rate[zone] * since
        valid = amplitude <= self.limit
        for sense, thresholds in enumerate((push, pull)):
            events = jnp.minimum(thresholds, reach)
            valid &= jnp.all(jnp.diff(events, prepend=0.0) >= -LITTLE * reach)
            at = jnp.concatenate([jnp.zeros(1), events[edges - 1], reach[None]])
            valid &= jnp.all(reaction + self.swing[sense] @ jnp.diff(at) >= 0.0)
        return valid


@jax.jit
def _works(cycles: CycleFactors, amplitudes: Array) -> Array:
    return jax.vmap(cycles._work)(amplitudes)


def cycle_factors(body: Body, friction: Array) -> CycleFactors:
    """Factors of a body for steady cycles with friction mu."""
    push, pull = (_first_loading(body, friction, sense) for sense in (-1.0, 1.0))
    y_g, z, threshold = (jnp.stack(pair) for pair in zip(push[:3], pull[:3], strict=True))
    bad = push.bad | pull.bad
    begin, width = _passage(body.x, threshold)
    limit = jnp.append(begin[0], jnp.inf)[jnp.argmax(bad[1:])]
    return CycleFactors(
        y_g,
        z,
        threshold,
        begin,
        width,
        turned=jnp.stack([pull.upper @ push.inverse, push.upper @ pull.inverse]),
        limit=jnp.where(bad[0], 0.0, jnp.where(jnp.any(bad), limit, jnp.inf)),
        reaction=push.reaction.T,
        rate=push.rate.T,
        swing=jnp.stack([_least(-push.rate), _least(pull.rate)]),
    )


class _FirstLoading(NamedTuple):
    """First loading in one sense; columns are the numbers of nodes that slip, 0 to k.

    Attributes
    ----------
    y_g, z, threshold, reaction, rate : see `CycleFactors`, the last two turned
    upper, inverse : (k, k) U and its inverse
    bad : (k + 1,) True where so many slipping nodes contradict what is assumed
    """

    y_g: Array
    z: Array
    threshold: Array
    reaction: Array
    rate: Array
    upper: Array
    inverse: Array
    bad: Array


def _first_loading(body: Body, friction: Array, sense: float) -> _FirstLoading:
    k = body.f_t.size
    k_nt = body.K_tn.T
    earlier = jnp.triu(jnp.ones((k, k + 1)), 1)
    matrix, g = body.K_tt + sense * friction * k_nt[:k], body.f_t + sense * friction * body.f_n[:k]
    sides = jnp.stack([g, friction * body.r_0[:k]], axis=1)
    lower, upper, y, _, inverse = lower_upper(matrix, sides)
    y_g, threshold = y[:, 0], y[:, 1] / y[:, 0]
    slips = (inverse * y_g) @ earlier
    rate = sense * (k_nt @ slips - body.f_n[:, None])
    rooms = (lower * y_g) @ earlier - g[:, None]
    steps = jnp.diff(threshold, prepend=0.0)
    reaction = body.r_0[:, None] + (rate[:, :k] * steps) @ earlier
    # Events rise, no node slips backwards or before its turn, and all stay closed.
    cap = friction * body.r_0[:k, None]
    early = jnp.tril(cap + (rooms[:, :k] * steps) @ earlier < -LITTLE * cap)
    backwards = slips < -LITTLE * jnp.max(jnp.abs(slips))
    lifts = jnp.any(reaction < 0.0, axis=0)
    bad = jnp.any(early | backwards, axis=0) | lifts | jnp.append(lifts[1:], False)
    bad = bad.at[1:].set(bad[1:] | (steps <= 0.0) | (y_g <= 0.0))
    bad = bad | jnp.any(body.r_0 <= 0.0)  # open under the pressures alone
    return _FirstLoading(y_g, inverse.T @ body.f_t, threshold, reaction, rate, upper, inverse, bad)


def _passage(x: Array, threshold: Array) -> tuple[Array, Array]:
    """Loads at which the zone's edge enters the nodes' elements, and how long it stays there."""
    k = threshold.shape[-1]
    ahead = x[:-1] - x[1:]
    ahead = jnp.append(ahead, ahead[-1])[:k]
    share = ahead[:-1] / (ahead[:-1] + ahead[1:])
    between = threshold[:, :-1] + share * jnp.diff(threshold, axis=1)
    first = 2.0 * threshold[:, :1] - between[:, :1]
    last = 2.0 * threshold[:, -1:] - between[:, -1:]
    ends = jnp.concatenate([first, between, last], axis=1)
    return ends[:, :-1], jnp.diff(ends, axis=1)


def _edges(nodes: int, groups: int) -> np.ndarray:
    """Numbers of slipping nodes that bound the groups of events."""
    return np.linspace(0, nodes + 1, groups + 1).astype(int)


def _least(rate: Array) -> Array:
    """Least rates (n, groups) over each group of the events (n, k + 1), zero at most."""
    edges = _edges(rate.shape[1] - 1, GROUPS)
    parts = [jnp.min(rate[:, a:b], axis=1) for a, b in itertools.pairwise(edges)]
    return jnp.minimum(jnp.stack(parts, axis=1), 0.0)

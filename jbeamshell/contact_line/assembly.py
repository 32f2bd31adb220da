"""Assembly: pressing of a body with friction, as bolts are tightened.

The pressures grow together from zero, and the contact follows event by event.  Without a load the
contact would have no reaction at all, so that nothing could be said of its friction: it starts from
even reactions that are a millionth of the whole and fade while the pressures grow.
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np
from jax import Array

from jbeamshell.common.failed import nan_unless
from jbeamshell.common.numbers_of import without_slopes
from jbeamshell.contact_line.body import Body
from jbeamshell.contact_line.contact_state import pressed
from jbeamshell.contact_line.walk import walk

FIRST = 1e-6  # part of the mean reaction from which the pressures grow


class Assembly(NamedTuple):
    """Contact under the pressures with friction; NaN if its events come to no end.

    Attributes
    ----------
    lift : (n,) lift w
    settled : (n,) tangential displacements
    reaction, traction : (n,) normal and tangential nodal forces of the base
    """

    lift: Array
    settled: Array
    reaction: Array
    traction: Array


def press_roughly(
    k_tt: Array,
    k_tn: Array,
    k_nn: Array,
    press_t: Array,
    press_n: Array,
    friction: Array,
    gap: Array | None = None,
) -> Assembly:
    """Pressing of a body with friction; first derivatives are exact.

    An initial gap grows together with the pressures.  Where bolts close it one after the other,
    other shear is locked in; the contact pressure, without friction, is the same.

    Parameters
    ----------
    k_tt, k_tn, k_nn : (k, k), (k, n) and (n, n) stiffness
    press_t, press_n : (k,) and (n,) nodal forces of the base if nothing moved
    friction : mu
    gap : (n,) distance of the nodes before anything presses; None is none
    """
    zero, even = 0.0 * press_n, without_slopes(FIRST * press_n.mean())
    body = Body(
        x=zero,
        tributary=zero,
        K_tt=k_tt,
        K_tn=k_tn,
        K_nn=k_nn,
        f_t=-press_t,
        f_n=even - press_n,
        r_0=even + zero,
        t_0=0.0 * press_t,
        c=0.0 * friction + 1.0,
    )
    if gap is not None:
        closed = body.f_t + k_tn @ gap, body.f_n + k_nn @ gap
        body = eqx.tree_at(lambda b: (b.f_t, b.f_n), body, closed)
    at_once = 0.0 * press_n[:1] + 1.0
    levels = walk(body, friction, pressed(body), at_once, np.ones(1, bool))
    first = jax.tree.map(lambda part: part[0], (levels.state, levels.lift))
    at, lift = nan_unless(levels.settled[0], first)
    return Assembly(lift, at.v, at.r_n, at.r_t)

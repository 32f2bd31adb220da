"""Bearings: the shanks of bolts come to bear on their holes once the slip exceeds the clearance.

The mean slip s of the bolts closes one of two gaps, c - s and c + s, behind which a spring yields.
A gap is a contact node without friction: with its opening a >= 0 the potential

    1/2 k (s + a - c)^2

is zero while the gap is open, and 1/2 k (s - c)^2 where it is closed.  So the events of the contact
line serve bearings too.
"""

from __future__ import annotations

import equinox as eqx
import numpy as np
from jax import Array

from jbeamshell.common.numbers_of import numbers_of, pad
from jbeamshell.contact_line.body import Body

WAYS = np.array([1.0, -1.0])  # of the slip that closes each gap


def with_bearings(body: Body, stiffness: Array, share: Array) -> Body:
    """Body with two further contact nodes, the gaps of its bearings.

    Parameters
    ----------
    body : k nodes that may slip
    stiffness : of all bearings together, force per width and length
    share : (k,) share of each node in the mean slip of the bolts
    """
    xp, slip = numbers_of(body, stiffness, share), share[:, None] * WAYS
    n, ways = body.r_0.size, len(WAYS)
    beside = ((0, ways), (0, ways))
    return eqx.tree_at(
        lambda b: (b.K_tt, b.K_tn, b.K_nn, b.f_n, b.r_0),
        body,
        (
            body.K_tt + stiffness * slip @ slip.T,
            xp.concatenate([body.K_tn, stiffness * slip], axis=1),
            pad(body.K_nn, *beside) + xp.diag(pad(stiffness * WAYS**2, (n, 0))),
            pad(body.f_n, (0, ways)),
            pad(body.r_0, (0, ways)),
        ),
    )


def with_gaps(lift: Array, clearance: Array | float) -> Array:
    """Lift (n + 2,) under the pressures with the openings of the gaps; see `with_bearings`."""
    return numbers_of(lift, clearance).append(lift, clearance * WAYS**2)


def bearing_energy(stiffness: Array, reaction: Array) -> Array:
    """Energy (...) of the bearings under their reactions (..., 2)."""
    return 0.5 * numbers_of(reaction).sum(reaction**2, axis=-1) / stiffness

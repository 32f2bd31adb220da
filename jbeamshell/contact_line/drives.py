"""Displacement control and elastic slip: bodies changed so that they solve the same equations.

A body answers a driving number, the end load F, with its displacement u.  Solved for F, the
equations of `Body` keep their form with u as the driving number; condensed onto the plastic part of
the slip, they keep it with springs between the body and its sliders.  So every solver of contact
paths serves these cases too.
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
from jax import Array

from jbeamshell.common.numbers_of import numbers_of
from jbeamshell.contact_line.body import Body, local_compliance
from jbeamshell.contact_line.contact_state import ContactState
from jbeamshell.numerics.factors import inverse_cholesky

STIFF = 1e7  # rounding leaves nine digits beside it


def driven_by_displacement(body: Body) -> Body:
    """Body whose driving number is the displacement u, and whose answer is -F.

    From u = c F + f_t.v + f_n.w follows F = u/c - (f_t.v + f_n.w)/c, so that

        K -> K + f f'/c,    f -> f/c,    c -> -1/c.

    A body that only friction holds back has no equilibrium beyond gross slip under a force; under a
    displacement it has.  See `exchanged` for its states.  A load that acts on the contact itself,
    where c is zero, acts through a spring that is `STIFF` times as stiff as the contact.
    """
    xp, f_t, f_n = numbers_of(body), body.f_t, body.f_n
    stiffness = xp.append(xp.diag(body.K_tt), xp.diag(body.K_nn))
    c = xp.maximum(body.c, local_compliance(stiffness, xp.append(f_t, f_n)) / STIFF)
    return eqx.tree_at(
        lambda b: (b.K_tt, b.K_tn, b.K_nn, b.f_t, b.f_n, b.c),
        body,
        (
            body.K_tt + xp.outer(f_t, f_t) / c,
            body.K_tn + xp.outer(f_t, f_n) / c,
            body.K_nn + xp.outer(f_n, f_n) / c,
            f_t / c,
            f_n / c,
            -1.0 / c,
        ),
    )


def exchanged(state: ContactState) -> ContactState:
    """State under force control from one of `driven_by_displacement`."""
    return state._replace(force=-state.displacement, displacement=state.force)


class Springs(NamedTuple):
    """Springs in series with the sliders of k contact nodes.

    Attributes
    ----------
    stiffness : (k,) D, force per width and length
    flexibility : (k, k) (K_tt + D)^-1 of the body without springs
    body : the body without springs
    """

    stiffness: Array
    flexibility: Array
    body: Body

    def slip(self, plastic: Array, lift: Array, force: Array) -> Array:
        """Tangential displacements v (..., k) at loads (...).

        Parameters
        ----------
        plastic, lift : (..., k) plastic slip and (..., n) lift
        """
        body = self.body
        pull = self.stiffness * plastic - lift @ body.K_tn.T + force[..., None] * body.f_t
        return pull @ self.flexibility


def spring_energy(stiffness: Array, r_t: Array) -> Array:
    """Energy (...) in springs of a stiffness (k,) under the tangential forces (..., k)."""
    return 0.5 * numbers_of(stiffness, r_t).sum(r_t**2 / stiffness, axis=-1)


def with_springs(body: Body, stiffness: Array) -> tuple[Body, Springs]:
    """Body on its plastic slips p, with springs of finite stiffness between p and v.

    With D = diag(stiffness) and r_t = D (p - v),

        K_tt -> D - D (K_tt + D)^-1 D,      K_tn -> D (K_tt + D)^-1 K_tn,
        K_nn -> K_nn - K_nt (K_tt + D)^-1 K_tn,
        f_t -> D (K_tt + D)^-1 f_t,         f_n -> f_n - K_nt (K_tt + D)^-1 f_t,
        c -> c + f_t' (K_tt + D)^-1 f_t.

    Parameters
    ----------
    body : k nodes that may slip
    stiffness : (k,) k_t times the contact length of each node

    Returns
    -------
    body, springs : with the plastic slip for v, and what finds v again
    """
    inverse = inverse_cholesky(body.K_tt + numbers_of(stiffness).diag(stiffness))
    flexibility = inverse.T @ inverse
    lifted, pulled = flexibility @ body.K_tn, flexibility @ body.f_t
    # D - D (K + D)^-1 D without the difference of two large matrices where the springs are stiff.
    k_tt = stiffness[:, None] * (flexibility @ body.K_tt)
    sprung = eqx.tree_at(
        lambda b: (b.K_tt, b.K_tn, b.K_nn, b.f_t, b.f_n, b.c),
        body,
        (
            0.5 * (k_tt + k_tt.T),
            stiffness[:, None] * lifted,
            body.K_nn - body.K_tn.T @ lifted,
            stiffness * pulled,
            body.f_n - body.K_tn.T @ pulled,
            body.c + body.f_t @ pulled,
        ),
    )
    return sprung, Springs(stiffness, flexibility, body)

"""Body on its contact line: a linear elastic strip with everything but the contact eliminated.

A strip whose section stores a quadratic energy in its fields and their slopes couples each station
along X to the next one only.  All fields but the contact's (tangential displacement v, lift w) are
eliminated station by station from the far end, with the contact's fields and the end load as
right-hand sides.  What is left are dense matrices over the contact nodes.

The unknowns of a station are the steps of its fields from the next station.  A short element is
stiff against a step over its length, and soft if it moves as a whole.  With the fields themselves
as unknowns these two would have to cancel, and round-off would grow.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.common.pytrees import Tree
from jbeamshell.mechanics.section_form import SectionForm
from jbeamshell.numerics.factors import inverse_cholesky

PARTS = 3  # of a strip, eliminated one after the other with as many contact nodes as they know
FEW = 100  # nodes up to which one part, which compiles in a third of the time, is as fast


class Body(Tree):
    """Matrices of a body over its n contact nodes, numbered from the loaded end.

    With v and w the tangential displacements and lifts since the pressure, F the end load and r the
    nodal forces of the base on the body,

        r_t = K_tt v + K_tn w - f_t F,    r_n = r_0 + K_tn' v + K_nn w - f_n F,
        u = c F + f_t.v + f_n.w.

    Attributes
    ----------
    x : (n,) positions X
    tributary : (n,) contact length of each node
    K_tt, K_tn, K_nn : (n, n) stiffness, force per width and length
    f_t, f_n : (n,) part of the end load that a clamped contact node carries
    r_0 : (n,) nodal forces of the base under the pressures alone
    t_0 : (k,) tangential ones, which are zero if the strip was pressed without friction
    c : displacement of the loaded end per end load with a clamped contact
    """

    x: Array
    tributary: Array
    K_tt: Array
    K_tn: Array
    K_nn: Array
    f_t: Array
    f_n: Array
    r_0: Array
    t_0: Array
    c: Array


class Elimination(NamedTuple):
    """Elimination of the fields between the contact's, station by station, to find them again.

    The unknowns are the steps of the fields to a station from the next one, and at the two ends the
    fields.  The right-hand sides are v and w of all stations, the end load, and the pressure.

    Attributes
    ----------
    inverse : (n, m-2, m-2) inverses of the Cholesky factors
    known : (n, m-2, 2n+2) right-hand sides, reduced
    onwards : (n-1, m-2, m-2) coupling to the fields of the next station, reduced
    """

    inverse: Array
    known: Array
    onwards: Array

    def recovered(self, given: Array) -> Array:
        """Fields (n, m-2, levels) from the right-hand sides' factors (2n+2, levels)."""

        def back(after: Array, station: tuple[Array, ...]) -> tuple[Array, Array]:
            first, inverse, sides, onwards = station
            step = -(inverse.T @ (sides + onwards @ after))
            here = jnp.where(first, step, after + step)
            return here, here

        none = jnp.zeros((self.inverse.shape[1], given.shape[1]), given.dtype)
        onwards = jnp.pad(self.onwards, ((0, 1), (0, 0), (0, 0)))
        first = np.arange(len(self.inverse)) == 0
        stations = (first, self.inverse, self.known @ given, onwards)
        return lax.scan(back, none, stations, reverse=True)[1]


def eliminate(
    form: SectionForm, x: Array, loads: Array, held: tuple[np.ndarray, np.ndarray]
) -> tuple[Elimination, Array]:
    """Eliminate a strip of linear elements down to its contact nodes.

    Parameters
    ----------
    form : energy of the section, m fields
    x : (n,) stations, increasing, the loaded end last
    loads : (n,) nodal forces that press on the top face
    held : (m,) True for fields that are zero at the far end, and at the loaded end; v and w of the
        contact are left to the caller

    Returns
    -------
    elimination : what finds the eliminated fields again
    left : (2n+2, 2n+2) energy's second derivatives in v and w of all stations, end load, pressure
    """
    n, inner = x.size, form.pull.size - 2
    columns = 2 * n + 2
    free, free_last = (jnp.asarray(~end[2:], x.dtype) for end in held)

    def go(
        carry: tuple[Array, Array], station: tuple[Array, ...]
    ) -> tuple[tuple[Array, Array], tuple[Array, Array, Array]]:
        before, forces = carry
        i, load, length = station
        start, end, across = (part[0] for part in form.element(length[None]))
        stays, follows = form.moved(length)
        forces = forces + load * _in_last_column(form.press[2:], forces)
        # Of the first station the fields are the unknowns, some of which are held.
        first = i == 0
        mask = jnp.where(first, free, 1.0)
        contacts = jnp.concatenate([start[2:, :2], across[2:, :2]], axis=1)
        sides = _add(forces, contacts, 2 * i) * mask[:, None]
        matrix = (before + start[2:, 2:]) * mask[:, None] * mask + jnp.diag(1.0 - mask)
        inverse = inverse_cholesky(matrix)
        coupling = jnp.where(first, across[2:, 2:], before + stays.T[2:, 2:])
        onwards = inverse @ (coupling * mask[:, None])
        known = inverse @ sides
        next_to = jnp.where(first, across[:2, 2:].T, stays[2:, :2])
        contacts = jnp.concatenate([next_to, jnp.where(first, end, follows)[2:, :2]], axis=1)
        forces = _add(jnp.where(first, 0.0, forces) - onwards.T @ known, contacts, 2 * i)
        own = jnp.where(first, end, stays + follows)[2:, 2:]
        return (before + own - onwards.T @ onwards, forces), (inverse, known, onwards)

    carry = (jnp.zeros((inner, inner), x.dtype), jnp.zeros((inner, 2), x.dtype))
    parts, total = [], jnp.zeros((columns, columns), x.dtype)
    stations = (jnp.arange(n - 1), loads[:-1], jnp.diff(x))
    # No station knows a contact node beyond its next one: the right-hand sides grow part by part.
    count = PARTS if n > FEW else 1
    for begin, stop in itertools.pairwise(np.linspace(0, n - 1, count + 1).astype(int)):
        carry = carry[0], _wider(carry[1], 2 * stop + 4)
        carry, part = lax.scan(go, carry, tuple(each[begin:stop] for each in stations))
        parts.append(part)
        total = total + _products(part[1], columns)
    matrix, sides = carry
    ends = jnp.stack([-form.pull[2:], loads[-1] * form.press[2:]], axis=1)
    sides = (sides + jnp.pad(ends, ((0, 0), (columns - 2, 0)))) * free_last[:, None]
    matrix = matrix * free_last[:, None] * free_last + jnp.diag(1.0 - free_last)
    inverse = inverse_cholesky(matrix)
    last = inverse @ sides
    total = total + _products(last[None], columns)
    left = _among_contacts(form, x, loads) - total
    found = Elimination(
        jnp.concatenate([*(part[0] for part in parts), inverse[None]]),
        jnp.concatenate([*(_wider(part[1], columns) for part in parts), last[None]]),
        jnp.concatenate([part[2] for part in parts]),
    )
    return found, left


def _add(sides: Array, block: Array, column: Array) -> Array:
    """Sum of sides and a block (rows, 4) at four of their columns."""
    old = lax.dynamic_slice(sides, (0, column), block.shape)
    return lax.dynamic_update_slice(sides, old + block, (0, column))


def _in_last_column(values: Array, sides: Array) -> Array:
    """Sides with values in their last column and zeros elsewhere."""
    return jnp.pad(values[:, None], ((0, 0), (sides.shape[1] - 1, 0)))


def _wider(sides: Array, columns: int) -> Array:
    """Sides with empty columns before the last two, those of the loads."""
    empty = [(0, 0)] * (sides.ndim - 1) + [(0, columns - sides.shape[-1])]
    return jnp.concatenate([jnp.pad(sides[..., :-2], empty), sides[..., -2:]], axis=-1)


def _among_contacts(form: SectionForm, x: Array, loads: Array) -> Array:
    """Stiffness (2n + 2, 2n + 2) of the elements among v and w, and the forces of the loads."""
    n = x.size
    start, end, across = (part[:, :2, :2] for part in form.element(jnp.diff(x)))
    own = jnp.pad(start, ((0, 1), (0, 0), (0, 0))) + jnp.pad(end, ((1, 0), (0, 0), (0, 0)))
    beside = jnp.pad(across, ((0, 1), (0, 0), (0, 0)))
    here, following = (np.eye(n, k=k)[..., None, None] for k in (0, 1))
    blocks = here * own[:, None] + following * beside[:, None]
    blocks = blocks + np.swapaxes(following, 0, 1) * jnp.swapaxes(beside, 1, 2)
    stiffness = jnp.moveaxis(blocks, 2, 1).reshape(2 * n, 2 * n)
    pull = jnp.pad(form.pull[:2], (2 * n - 2, 0))
    press = (loads[:, None] * form.press[:2]).ravel()
    sides = jnp.stack([-pull, press], axis=1)
    return jnp.block([[stiffness, sides], [sides.T, jnp.zeros((2, 2), x.dtype)]])


def _products(known: Array, columns: int) -> Array:
    """Sum of known' known over the stations and their fields, (columns, columns)."""
    known = known.reshape(-1, known.shape[-1])
    return _wider(_wider(known.T @ known, columns).T, columns).T

"""Body on its contact line: a linear elastic strip with everything but the contact eliminated.

A strip whose section stores a quadratic energy in its fields and their slopes couples each station
along X to the next one only.  All fields but the contact's (tangential displacement v, lift w) are
eliminated station by station from the far end, with the contact's fields and the end load as
right-hand sides.  What is left are dense matrices over the contact nodes.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.mechanics.section_form import SectionForm
from jbeamshell.numerics.factors import inverse_cholesky

PARTS = 3  # of the strip, eliminated one after the other with as many contact nodes as they know


class Body(eqx.Module):
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
    c: Array


class Elimination(NamedTuple):
    """Elimination of the fields between the contact's, station by station, to find them again.

    The right-hand sides are v and w of all stations, the end load, and the pressure.

    Attributes
    ----------
    inverse : (n, m-2, m-2) inverses of the Cholesky factors
    known : (n, m-2, 2n+2) right-hand sides, reduced
    onwards : (n-1, m-2, m-2) coupling to the next station, reduced
    """

    inverse: Array
    known: Array
    onwards: Array

    def recovered(self, given: Array) -> Array:
        """Fields (n, m-2, levels) from the right-hand sides' factors (2n+2, levels)."""

        def back(after: Array, station: tuple[Array, Array, Array]) -> tuple[Array, Array]:
            inverse, known, onwards = station
            here = -(inverse.T @ (known @ given + onwards @ after))
            return here, here

        none = jnp.zeros((self.inverse.shape[1], given.shape[1]), given.dtype)
        onwards = jnp.pad(self.onwards, ((0, 1), (0, 0), (0, 0)))
        return lax.scan(back, none, (self.inverse, self.known, onwards), reverse=True)[1]


def eliminate(form: SectionForm, x: Array, loads: Array, held: bool) -> tuple[Elimination, Array]:
    """Eliminate a strip of linear elements down to its contact nodes.

    Parameters
    ----------
    form : energy of the section, m fields
    x : (n,) stations, increasing, the loaded end last
    loads : (n,) nodal forces that press on the top face
    held : True where the far end holds the fields of ``form.held``

    Returns
    -------
    elimination : what finds the eliminated fields again
    left : (2n+2, 2n+2) energy's second derivatives in v and w of all stations, end load, pressure
    """
    n, m = x.size, form.pull.size
    columns = 2 * n + 2
    inner = m - 2
    free = jnp.asarray(~form.held[2:] if held else np.ones(inner, bool), x.dtype)

    def go(
        carry: tuple[Array, Array], station: tuple[Array, ...]
    ) -> tuple[tuple[Array, Array], tuple[Array, Array, Array]]:
        matrix, sides = carry
        i, load, length = station
        start, end, across = (part[0] for part in form.element(length[None]))
        mask = jnp.where(i == 0, free, 1.0)
        sides = _add(sides, start[2:, :2], 2 * i).at[:, -1].add(load * form.press[2:])
        sides = _add(sides, across[2:, :2], 2 * i + 2) * mask[:, None]
        matrix = (matrix + start[2:, 2:]) * mask[:, None] * mask + jnp.diag(1.0 - mask)
        inverse = inverse_cholesky(matrix)
        onwards = inverse @ (across[2:, 2:] * mask[:, None])
        known = inverse @ sides
        sides = _add(-(onwards.T @ known), end[2:, :2], 2 * i + 2)
        sides = _add(sides, across[:2, 2:].T, 2 * i)
        return (end[2:, 2:] - onwards.T @ onwards, sides), (inverse, known, onwards)

    carry = (jnp.zeros((inner, inner), x.dtype), jnp.zeros((inner, 2), x.dtype))
    parts, total = [], jnp.zeros((columns, columns), x.dtype)
    stations = (jnp.arange(n - 1), loads[:-1], jnp.diff(x))
    # No station knows a contact node beyond its next one: the right-hand sides grow part by part.
    for begin, stop in itertools.pairwise(np.linspace(0, n - 1, PARTS + 1).astype(int)):
        carry = carry[0], _wider(carry[1], 2 * stop + 4)
        carry, part = lax.scan(go, carry, tuple(each[begin:stop] for each in stations))
        parts.append(part)
        total = _with_products(total, part[1])
    matrix, sides = carry
    sides = sides.at[:, -2].add(-form.pull[2:]).at[:, -1].add(loads[-1] * form.press[2:])
    inverse = inverse_cholesky(matrix)
    last = inverse @ sides
    left = _among_contacts(form, x) - _with_products(total, last[None])
    pull = jnp.zeros(2 * n).at[-2:].set(form.pull[:2])
    press = (loads[:, None] * form.press[:2]).ravel()
    left = left.at[:-2, -2].add(-pull).at[-2, :-2].add(-pull)
    left = left.at[:-2, -1].add(press).at[-1, :-2].add(press)
    found = Elimination(
        jnp.concatenate([*(part[0] for part in parts), inverse[None]]),
        jnp.concatenate([*(_wider(part[1], columns) for part in parts), last[None]]),
        jnp.concatenate([part[2] for part in parts]),
    )
    return found, left


def _add(sides: Array, block: Array, column: Array) -> Array:
    """Sum of sides and a block (rows, 2) at two of their columns."""
    old = lax.dynamic_slice(sides, (0, column), block.shape)
    return lax.dynamic_update_slice(sides, old + block, (0, column))


def _wider(sides: Array, columns: int) -> Array:
    """Sides with empty columns before the last two, those of the loads."""
    empty = [(0, 0)] * (sides.ndim - 1) + [(0, columns - sides.shape[-1])]
    return jnp.concatenate([jnp.pad(sides[..., :-2], empty), sides[..., -2:]], axis=-1)


def _among_contacts(form: SectionForm, x: Array) -> Array:
    """Stiffness (2n + 2, 2n + 2) of the elements among v and w, empty for the loads."""
    n = x.size
    start, end, across = (part[:, :2, :2] for part in form.element(jnp.diff(x)))
    i = np.arange(n)
    own = jnp.zeros((n, 2, 2), x.dtype).at[:-1].add(start).at[1:].add(end)
    blocks = jnp.zeros((n, n, 2, 2), x.dtype).at[i, i].set(own)
    blocks = blocks.at[i[:-1], i[1:]].set(across)
    blocks = blocks.at[i[1:], i[:-1]].set(jnp.swapaxes(across, 1, 2))
    return jnp.pad(jnp.moveaxis(blocks, 2, 1).reshape(2 * n, 2 * n), (0, 2))


def _with_products(total: Array, known: Array) -> Array:
    """Sum of total (columns, columns) and known' known over the stations and their fields."""
    columns, width = total.shape[0], known.shape[-1]
    part = known.reshape(-1, width)
    there = np.r_[: width - 2, columns - 2 : columns]
    return total.at[np.ix_(there, there)].add(part.T @ part)

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

CHUNKS = 6  # parts of the strip whose products are taken over the nodes that they know


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
    lower : (n, m-2, m-2) Cholesky factors
    known : (n, m-2, 2n+2) right-hand sides, reduced
    onwards : (n-1, m-2, m-2) coupling to the next station, reduced
    """

    lower: Array
    known: Array
    onwards: Array

    def recovered(self, given: Array) -> Array:
        """Fields (n, m-2, levels) from the right-hand sides' factors (2n+2, levels)."""

        def back(after: Array, station: tuple[Array, Array, Array]) -> tuple[Array, Array]:
            lower, known, onwards = station
            right = -(known @ given + onwards @ after)
            here = lax.linalg.triangular_solve(
                lower, right, left_side=True, lower=True, transpose_a=True
            )
            return here, here

        none = jnp.zeros((self.lower.shape[1], given.shape[1]), given.dtype)
        onwards = jnp.pad(self.onwards, ((0, 1), (0, 0), (0, 0)))
        return lax.scan(back, none, (self.lower, self.known, onwards), reverse=True)[1]


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
    start, end, across = form.element(jnp.diff(x))
    columns = 2 * n + 2
    free = jnp.asarray(~form.held[2:] if held else np.ones(m - 2, bool), x.dtype)

    def go(
        carry: tuple[Array, Array], station: tuple[Array, ...]
    ) -> tuple[tuple[Array, Array], tuple[Array, Array, Array]]:
        matrix, sides = carry
        i, load, start, end, across = station
        mask = jnp.where(i == 0, free, 1.0)
        sides = _add(sides, start[2:, :2], 2 * i).at[:, -1].add(load * form.press[2:])
        sides = _add(sides, across[2:, :2], 2 * i + 2) * mask[:, None]
        matrix = (matrix + start[2:, 2:]) * mask[:, None] * mask + jnp.diag(1.0 - mask)
        right = jnp.concatenate([sides, across[2:, 2:] * mask[:, None]], axis=1)
        lower, solved = _halved(matrix, right)
        known, onwards = solved[:, :columns], solved[:, columns:]
        sides = _add(-onwards.T @ known, end[2:, :2], 2 * i + 2)
        sides = _add(sides, across[:2, 2:].T, 2 * i)
        return (end[2:, 2:] - onwards.T @ onwards, sides), (lower, known, onwards)

    stations = (jnp.arange(n - 1), loads[:-1], start, end, across)
    nothing = (jnp.zeros((m - 2, m - 2), x.dtype), jnp.zeros((m - 2, columns), x.dtype))
    (matrix, sides), (lower, known, onwards) = lax.scan(go, nothing, stations)
    sides = sides.at[:, -2].add(-form.pull[2:]).at[:, -1].add(loads[-1] * form.press[2:])
    last_lower, last = _halved(matrix, sides)
    left = _among_contacts(start, end, across) - (last.T @ last + _products(known))
    pull = jnp.zeros(2 * n).at[-2:].set(form.pull[:2])
    press = (loads[:, None] * form.press[:2]).ravel()
    left = left.at[:-2, -2].add(-pull).at[-2, :-2].add(-pull)
    left = left.at[:-2, -1].add(press).at[-1, :-2].add(press)
    found = Elimination(
        jnp.concatenate([lower, last_lower[None]]),
        jnp.concatenate([known, last[None]]),
        onwards,
    )
    return found, left


def _halved(matrix: Array, right: Array) -> tuple[Array, Array]:
    """L and L^-1 right of a symmetric matrix L L'."""
    lower = jnp.linalg.cholesky(matrix)
    return lower, lax.linalg.triangular_solve(lower, right, left_side=True, lower=True)


def _add(sides: Array, block: Array, column: Array) -> Array:
    """Sum of sides and a block (rows, 2) at two of their columns."""
    old = lax.dynamic_slice(sides, (0, column), block.shape)
    return lax.dynamic_update_slice(sides, old + block, (0, column))


def _among_contacts(start: Array, end: Array, across: Array) -> Array:
    """Stiffness (2n + 2, 2n + 2) of the elements among v and w, empty for the loads."""
    n = start.shape[0] + 1
    i = np.arange(n)
    own = jnp.zeros((n, 2, 2), start.dtype).at[:-1].add(start[:, :2, :2]).at[1:].add(end[:, :2, :2])
    blocks = jnp.zeros((n, n, 2, 2), start.dtype).at[i, i].set(own)
    blocks = blocks.at[i[:-1], i[1:]].set(across[:, :2, :2])
    blocks = blocks.at[i[1:], i[:-1]].set(jnp.swapaxes(across[:, :2, :2], 1, 2))
    return jnp.pad(jnp.moveaxis(blocks, 2, 1).reshape(2 * n, 2 * n), (0, 2))


def _products(known: Array) -> Array:
    """Sum over the stations of known' known; no station knows a node beyond its next one."""
    stations, _, columns = known.shape
    cuts = np.linspace(0, stations, CHUNKS + 1).astype(int)
    total = jnp.zeros((columns, columns), known.dtype)
    for begin, stop in itertools.pairwise(cuts):
        width = 2 * stop + 2
        part = known[begin:stop]
        part = jnp.concatenate([part[..., :width], part[..., -2:]], axis=-1)
        part = part.reshape(-1, width + 2)
        there = np.r_[:width, columns - 2 : columns]
        total = total.at[np.ix_(there, there)].add(part.T @ part)
    return total

"""One load step of a face: Newton's method on the contact, differentiable at the equilibrium.

The bodies are condensed to w (n, 3), the displacement of the upper nodes over the lower ones,

    lambda = K w - f P,

and the residual is lambda less the force of the contact law (`pair.contact_force`).  It has kinks
and no other nonlinearity, so that Newton's method ends after a few iterations (Alart and Curnier
1991); a step that raises the residual is shortened.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.contact_face.pair import Pairs, contact_force

TOLERANCE = 1e-11  # force out of balance over the largest load of a node
ITERATIONS = 40
SHORTER = 0.5 ** np.arange(7.0)  # lengths of a Newton step that are tried


class Face(NamedTuple):
    """Bodies on their common face, and the law of its pairs.

    Attributes
    ----------
    stiffness : (3n, 3n) K of the relative displacements, two tangential and the normal one in turn
    loads : (3n, m) f of the load to and fro and of the bolts
    held : (3n,) True for displacements that supports on both sides hold
    pairs : numbers of the pairs
    """

    stiffness: Array
    loads: Array
    held: Array
    pairs: Pairs

    @property
    def scales(self) -> Array:
        """Stiffness (n, 3) of the bodies at each displacement."""
        return self.pairs.scale[:, np.array([0, 0, 1])]

    def reaction(self, w: Array, load: Array) -> Array:
        """Force (n, 3) of the contact on the upper nodes, from w (n, 3) and the loads (m,)."""
        return (self.stiffness @ w.ravel() - self.loads @ load).reshape(-1, 3)


class Found(NamedTuple):
    """End of a step: displacements (n, 3), force out of balance over the loads, iterations."""

    w: Array
    error: Array
    iterations: Array


def take_step(face: Face, start: Array, slip: Array, load: Array) -> Found:
    """Equilibrium after a step.

    Parameters
    ----------
    face : bodies and pairs
    start : (n, 3) displacements from which the search starts
    slip : (n, 2) slip at the end of the last step
    load : (m,) loads
    """

    def off_balance(w: Array) -> Array:
        return _off_balance(face, w, slip, load)

    def solve(residual: Any, begin: Array) -> tuple[Array, tuple[Array, Array]]:
        still, loads = lax.stop_gradient((face, (slip, load)))
        return _newton(still, begin, *loads)

    def tangent(linear: Any, right: Array) -> Array:
        size = right.size
        columns = jax.vmap(lambda unit: linear(unit.reshape(right.shape)).ravel())(jnp.eye(size))
        return jnp.linalg.solve(columns.T, right.ravel()).reshape(right.shape)

    w, (error, count) = lax.custom_root(
        off_balance, lax.stop_gradient(start), solve, tangent, has_aux=True
    )
    return Found(w, error, count)


def _off_balance(face: Face, w: Array, slip: Array, load: Array) -> Array:
    """Residual (n, 3), a force."""
    force = face.reaction(w, load)
    law = jax.vmap(contact_force)(force, w, slip, face.pairs)
    return jnp.where(face.held.reshape(-1, 3), face.scales * w, force - law)


def _tangent(face: Face, w: Array, slip: Array, load: Array) -> Array:
    """Matrix (3n, 3n) of the residual."""
    force, n = face.reaction(w, load), w.shape[0]
    slopes = jax.vmap(jax.jacfwd(contact_force, (0, 1)))
    by_force, by_move = slopes(force, w, slip, face.pairs)
    free = np.eye(3) - by_force
    matrix = jnp.einsum("nij,njk->nik", free, face.stiffness.reshape(n, 3, 3 * n))
    at = np.arange(n)
    matrix = matrix.reshape(n, 3, n, 3).at[at, :, at, :].add(-by_move).reshape(3 * n, 3 * n)
    return jnp.where(face.held[:, None], jnp.diag(face.scales.ravel()), matrix)


def _newton_step(matrix: Array, right: Array, scale: Array) -> Array:
    """Solution (n, 3) of the tangent's equations.

    The rows of a pair that sticks name its own displacement alone, so that the others are solved
    for beside it: on the least part of the face, in quarters, that holds them all.
    """
    n = right.shape[0]
    own = scale.ravel()
    alone = jnp.sum(jnp.abs(matrix), axis=1) == own  # with the pair's scale on the diagonal
    sticks = jnp.all(alone.reshape(n, 3), axis=1)
    known = jnp.where(sticks[:, None], right / scale, 0.0)
    order = jnp.argsort(sticks, stable=True)
    parts = sorted({-(-n * quarter // 4) for quarter in (1, 2, 3, 4)})

    def on_part(count: int) -> Array:
        pairs = order[:count]
        rows = (3 * pairs[:, None] + np.arange(3)).ravel()
        rest = right.ravel() - matrix @ known.ravel()
        part = jnp.linalg.solve(matrix[rows][:, rows], rest[rows])
        return known.at[pairs].add(part.reshape(count, 3))

    branch = jnp.searchsorted(np.array(parts), n - jnp.sum(sticks))
    return lax.switch(branch, [lambda count=count: on_part(count) for count in parts])


def _newton(face: Face, w: Array, slip: Array, load: Array) -> tuple[Array, tuple[Array, Array]]:
    """Displacements where the residual vanishes; its size and the iterations beside them."""
    largest = jnp.max(jnp.abs(face.loads @ load))
    size = jnp.where(largest > 0.0, largest, 1.0)

    def residual(w: Array) -> Array:
        return _off_balance(face, w, slip, load) / size

    def improve(state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        w, off, count = state
        way = size * _newton_step(_tangent(face, w, slip, load), off, face.scales)
        trials = w - SHORTER[:, None, None] * way
        offs = jax.vmap(residual)(trials)
        squares, before = jnp.sum(offs**2, axis=(1, 2)), jnp.sum(off**2)
        better = squares < (1.0 - 1e-4 * SHORTER) * before
        chosen = jnp.where(jnp.any(better), jnp.argmax(better), jnp.argmin(squares))
        return trials[chosen], offs[chosen], count + 1

    def goes_on(state: tuple[Array, Array, Array]) -> Array:
        _, off, count = state
        most = jnp.max(jnp.abs(off))
        return (most > TOLERANCE) & (count < ITERATIONS) & jnp.isfinite(most)

    w, off, count = lax.while_loop(goes_on, improve, (w, residual(w), jnp.asarray(0)))
    return w, (jnp.max(jnp.abs(off)), count.astype(w.dtype))

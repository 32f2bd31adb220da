"""One load step of a face: Newton's method on the contact, differentiable at the equilibrium.

The bodies are condensed to v (n, 3), the displacement of the upper nodes over the lower ones,

    lambda = K v - f P,

and the residual is lambda less the force of the contact law (`face_law.contact_force`).  It has
kinks and no other nonlinearity, so that Newton's method ends after a few iterations (Alart and
Curnier 1991); a step that does not lower the residual is shortened.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.bodies.face_law import Pairs, contact_force

TOLERANCE = 1e-11  # force out of balance over the largest load of a node
ITERATIONS = 40
SHORTER = 0.5 ** np.arange(1.0, 7.0)  # lengths that are tried where a whole Newton step fails
PARTS = 16  # sizes of the part of a face that is solved for


class Face(NamedTuple):
    """Bodies on their common face, and the law of its pairs.

    Attributes
    ----------
    stiffness : (3n, 3n) K of the relative displacements, two tangential and the normal one in turn
    loads : (3n, m) f of the load to and fro and of the bolts
    held : (n, 3) True for displacements that supports on both sides hold
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

    def reaction(self, v: Array, load: Array) -> Array:
        """Force (n, 3) of the contact on the upper nodes, from v (n, 3) and the loads (m,)."""
        return (self.stiffness @ v.ravel() - self.loads @ load).reshape(-1, 3)


class Found(NamedTuple):
    """End of a step: displacements (n, 3), force out of balance over the loads, iterations."""

    v: Array
    error: Array
    iterations: Array


def take_step(face: Face, before: Array, load: Array, guess: Array) -> Found:
    """Equilibrium after a step.

    Parameters
    ----------
    face : bodies and pairs
    before : (n, 3) displacements at the end of the last step
    load : (m,) loads
    guess : (n, 3) displacements from which the search starts
    """
    slip = before[:, :2]

    def off_balance(v: Array) -> Array:
        return _off_balance(face, v, slip, load)

    def solve(residual: Any, begin: Array) -> tuple[Array, tuple[Array, Array]]:
        return _newton(*lax.stop_gradient((face, begin, slip, load)))

    def tangent(linear: Any, right: Array) -> Array:
        size = right.size
        columns = jax.vmap(lambda unit: linear(unit.reshape(right.shape)).ravel())(jnp.eye(size))
        return jnp.linalg.solve(columns.T, right.ravel()).reshape(right.shape)

    v, (error, count) = lax.custom_root(
        off_balance, lax.stop_gradient(guess), solve, tangent, has_aux=True
    )
    return Found(v, error, count)


def _off_balance(face: Face, v: Array, slip: Array, load: Array) -> Array:
    """Residual (n, 3), a force."""
    force = face.reaction(v, load)
    law = jax.vmap(contact_force)(force, v, slip, face.pairs)
    return jnp.where(face.held, face.scales * v, force - law)


def _newton_step(face: Face, v: Array, slip: Array, load: Array, off: Array) -> Array:
    """Step (n, 3) of Newton's method.

    Many rows of the residual name one displacement alone: all those of a pair that sticks, and the
    normal one of a pair that slides.  The other displacements are solved for beside them, on the
    least part of the face that holds them all.
    """
    n, size = v.shape[0], v.size
    slopes = jax.vmap(jax.jacfwd(contact_force, (0, 1)))
    by_force, by_move = slopes(face.reaction(v, load), v, slip, face.pairs)
    held = face.held[:, :, None]
    free = jnp.where(held, 0.0, np.eye(3) - by_force)
    own = jnp.where(held, face.scales[:, :, None] * np.eye(3), -by_move)
    alone = jnp.all(free == 0.0, axis=2)
    known = jnp.where(alone, -off / face.scales, 0.0)
    pushed = (face.stiffness @ known.ravel()).reshape(n, 3)
    moved = jnp.einsum("nij,nj->ni", free, pushed) + jnp.einsum("nij,nj->ni", own, known)
    rest = jnp.where(alone, 0.0, -off - moved).ravel()
    order = jnp.argsort(alone.ravel(), stable=True)
    parts = sorted({-(-size * part // PARTS) for part in range(1, PARTS + 1)})

    def on_part(count: int) -> Array:
        chosen = order[:count]
        pair, way = chosen // 3, chosen % 3
        rows = jnp.einsum("rj,rjk->rk", free[pair, way], face.stiffness.reshape(n, 3, size)[pair])
        matrix = jnp.take(rows, chosen, axis=1)
        matrix += jnp.where(pair[:, None] == pair, own[pair, way][:, way], 0.0)
        found = jnp.linalg.solve(matrix, rest[chosen])
        return known.ravel().at[chosen].add(found).reshape(n, 3)

    branch = jnp.searchsorted(np.array(parts), size - jnp.sum(alone))
    return lax.switch(branch, [lambda count=count: on_part(count) for count in parts])


def _newton(face: Face, v: Array, slip: Array, load: Array) -> tuple[Array, tuple[Array, Array]]:
    """Displacements where the residual vanishes; its size and the iterations beside them."""
    largest = jnp.max(jnp.abs(face.loads @ load))
    size = jnp.where(largest > 0.0, largest, 1.0)

    def residual(v: Array) -> Array:
        return _off_balance(face, v, slip, load)

    def improve(state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        v, off, count = state
        way = _newton_step(face, v, slip, load, off)
        whole = v + way
        at_whole = residual(whole)
        before = jnp.sum(off**2)

        def shortened() -> tuple[Array, Array]:
            trials = v + SHORTER[:, None, None] * way
            offs = jax.vmap(residual)(trials)
            squares = jnp.sum(offs**2, axis=(1, 2))
            better = squares < (1.0 - 1e-4 * SHORTER) * before
            chosen = jnp.where(jnp.any(better), jnp.argmax(better), jnp.argmin(squares))
            return trials[chosen], offs[chosen]

        falls = jnp.sum(at_whole**2) < (1.0 - 1e-4) * before
        v, off = lax.cond(falls, lambda: (whole, at_whole), shortened)
        return v, off, count + 1

    def goes_on(state: tuple[Array, Array, Array]) -> Array:
        _, off, count = state
        most = jnp.max(jnp.abs(off)) / size
        return (most > TOLERANCE) & (count < ITERATIONS) & jnp.isfinite(most)

    v, off, count = lax.while_loop(goes_on, improve, (v, residual(v), jnp.asarray(0)))
    return v, (jnp.max(jnp.abs(off)) / size, count.astype(v.dtype))

"""One load step of a face: Newton's method on the contact, differentiable at the equilibrium.

With u the displacements of the face's nodes, B their part in the displacement of each contact point
and lambda the force of the contact law (`face_law.contact_force`),

    K u - f P - B' lambda(B u) = 0.

It has kinks and no other nonlinearity, so that Newton's method ends after a few iterations; a step
that does not lower the residual is shortened.  Where that goes on and on, as on strongly coupled
faces of much friction, sweeps with the stiffness of sticking points lead elsewhere.  Where the
displacement of the load is prescribed, P follows from it, d = f' u + c P.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.bodies.face_law import Points, contact_force

TOLERANCE = 1e-11  # force out of balance over the largest load of a node
ITERATIONS = 80
ROUND = 20  # iterations after which Newton's method starts anew, from where sweeps have led
SWEEPS = 400  # between two such rounds
SHORTER = 0.5 ** np.arange(1.0, 7.0)  # lengths that are tried where a whole Newton step fails
PARTS = np.array([1, 2, 3, 4, 6, 8]) / 16  # of the face, on which points slide or open
LEAST = 24  # displacements, below which a part is not worth its program


class Face(NamedTuple):
    """Bodies on their common face, and the law of its contact points.

    Attributes
    ----------
    stiffness : (N, N) K of the nodes' displacements, three of each node in turn
    loads : (N, m) f of the load to and fro and of the bolts
    flexibility : (m, m) c, displacements per load while the nodes stay
    nodes : (g, k) nodes of each group of contact points, such as those of an element
    shares : (q, k, 3, 3) their part B in the displacement of each point, two tangential ones and
        the normal one; the points of a group after each other
    points : numbers of the contact points
    """

    stiffness: Array
    loads: Array
    flexibility: Array
    nodes: Array
    shares: Array
    points: Points

    def moves(self, u: Array) -> Array:
        """Displacements (q, 3) of the points, from those of the nodes (N,)."""
        near = u.reshape(-1, 3)[self.nodes]
        return jnp.einsum("gpkij,gkj->gpi", self._grouped, near).reshape(-1, 3)

    def on_nodes(self, force: Array) -> Array:
        """Nodal forces (N,) of the points' forces (q, 3)."""
        shares = self._grouped
        each = jnp.einsum("gpkij,gpi->gkj", shares, force.reshape(*shares.shape[:2], 3))
        return jnp.zeros((self.loads.shape[0] // 3, 3)).at[self.nodes].add(each).ravel()

    @property
    def _grouped(self) -> Array:
        """Shares (g, points, k, 3, 3)."""
        return self.shares.reshape(self.nodes.shape[0], -1, *self.shares.shape[1:])

    def forces(self, u: Array, slip: Array) -> Array:
        """Forces (q, 3) of the contact."""
        return jax.vmap(contact_force)(self.moves(u), slip, self.points)

    def blocks(self, stiffness: Array) -> tuple[tuple[Array, Array], Array]:
        """Rows and columns, and entries, of B' S B for stiffnesses (q, 3, 3) of the points."""
        shares = self._grouped
        pushed = jnp.einsum("gpij,gpljb->gpilb", stiffness.reshape(*shares.shape[:2], 3, 3), shares)
        each = jnp.einsum("gpkia,gpilb->gkalb", shares, pushed)
        places = 3 * self.nodes[:, :, None] + np.arange(3)
        rows = jnp.broadcast_to(places[:, :, :, None, None], each.shape)
        return (rows, jnp.broadcast_to(places[:, None, None], each.shape)), each

    def load(self, u: Array, drive: Drive) -> Array:
        """Loads (m,), of which the first follows from its displacement where that is prescribed."""
        others = self.flexibility[0, 1:] @ drive.load[1:]
        soft = jnp.where(drive.driven, self.flexibility[0, 0], 1.0)
        moved = (drive.load[0] + drive.start - self.loads[:, 0] @ u - others) / soft
        first = jnp.where(drive.driven, moved, drive.load[0])
        return drive.load.at[0].set(first)


class Drive(NamedTuple):
    """Loads of a step.

    Attributes
    ----------
    load : (m,) loads; the first one is a displacement since the pressing where that is prescribed
    driven : True where it is
    start : displacement of the load after the pressing
    """

    load: Array
    driven: Array
    start: Array


class Sticking(NamedTuple):
    """Bodies whose points all stick.

    Attributes
    ----------
    stiffness, inverse : (N, N) of the bodies on the springs of their points
    pulled, soft : (N,) and () displacements per load to and fro, and that of the load itself
    """

    stiffness: Array
    inverse: Array
    pulled: Array
    soft: Array

    @classmethod
    def of(cls, face: Face) -> Sticking:
        """Bodies of a face."""
        springs = face.points.springs[:, np.array([0, 0, 1]), None] * np.eye(3)
        where, entries = face.blocks(springs)
        stiffness = face.stiffness.at[where].add(entries)
        inverse = jnp.linalg.inv(stiffness)
        pulled = inverse @ face.loads[:, 0]
        soft = face.flexibility[0, 0] + pulled @ face.loads[:, 0]
        return cls(stiffness, inverse, pulled, soft)

    def glued(self, face: Face, load: Array) -> Array:
        """Displacements (N,) under loads if all points stick, and close their gaps."""
        points = face.points
        closing = jnp.zeros((points.gap.size, 3)).at[:, 2].set(-points.springs[:, 1] * points.gap)
        return self.inverse @ (face.loads @ load + face.on_nodes(closing))

    def moved(self, force: Array, driven: Array, pull: Array) -> Array:
        """Displacements (N,) under nodal forces; with the load held in place where it is driven."""
        free = self.inverse @ force
        return free - jnp.where(driven, (pull @ free) / self.soft, 0.0) * self.pulled


class Found(NamedTuple):
    """End of a step: displacements (N,), force out of balance over the loads, iterations."""

    u: Array
    error: Array
    iterations: Array


def take_step(face: Face, sticking: Sticking, slip: Array, drive: Drive, guess: Array) -> Found:
    """Equilibrium after a step.

    Parameters
    ----------
    face, sticking : bodies and points
    slip : (q, 2) slip at the end of the last step
    drive : loads
    guess : (N,) displacements from which the search starts
    """

    def off_balance(u: Array) -> Array:
        return _off_balance(face, u, slip, drive)

    def solve(residual: Any, begin: Array) -> tuple[Array, tuple[Array, Array]]:
        return _newton(*lax.stop_gradient((face, sticking, begin, slip, drive)))

    def tangent(linear: Any, right: Array) -> Array:
        return jnp.linalg.solve(jax.vmap(linear)(jnp.eye(right.size)).T, right)

    u, (error, count) = lax.custom_root(
        off_balance, lax.stop_gradient(guess), solve, tangent, has_aux=True
    )
    return Found(u, error, count)


def _off_balance(face: Face, u: Array, slip: Array, drive: Drive) -> Array:
    """Residual (N,), a force."""
    pushed = face.on_nodes(face.forces(u, slip))
    return face.stiffness @ u - face.loads @ face.load(u, drive) - pushed


def _newton_step(
    face: Face, sticking: Sticking, u: Array, slip: Array, drive: Drive, off: Array
) -> Array:
    """Step (N,) of Newton's method.

    The bodies whose points stick are solved for once and for all.  What is left is solved for on
    the least part of the face that holds all nodes of points that do not.
    """
    slopes = jax.vmap(jax.jacfwd(contact_force))(face.moves(u), slip, face.points)
    springs = face.points.springs[:, np.array([0, 0, 1]), None] * np.eye(3)
    where, entries = face.blocks(springs + slopes)  # by which the bodies are softer
    size, pull = u.size, face.loads[:, 0]

    def on_part(count: int) -> Array:
        chosen = order[:count]
        place = jnp.zeros(size, int).at[order].set(np.arange(size))
        inside = tuple(place[rows] for rows in where)
        softer = jnp.zeros((count, count)).at[inside].add(entries, mode="drop")
        flexible = sticking.inverse[chosen][:, chosen]
        away = jnp.where(drive.driven, 1.0 / sticking.soft, 0.0)
        flexible -= away * jnp.outer(sticking.pulled[chosen], sticking.pulled[chosen])
        alone = sticking.moved(-off, drive.driven, pull)
        moved = jnp.linalg.solve(jnp.eye(count) - flexible @ softer, alone[chosen])
        more = jnp.zeros(size).at[chosen].add(softer @ moved)
        return alone + sticking.moved(more, drive.driven, pull)

    def on_all() -> Array:
        matrix = sticking.stiffness.at[where].add(-entries)
        soft = jnp.where(drive.driven, face.flexibility[0, 0], 1.0)
        matrix += jnp.where(drive.driven, 1.0 / soft, 0.0) * jnp.outer(pull, pull)
        return jnp.linalg.solve(matrix, -off)

    counts = sorted({count for part in PARTS if (count := math.ceil(size * part)) >= LEAST})
    if not counts:
        return on_all()
    slides = jnp.any(springs + slopes != 0.0, axis=(1, 2))
    slides = jnp.any(slides.reshape(face.nodes.shape[0], -1), axis=1)
    near = jnp.zeros(size // 3, bool).at[face.nodes].max(slides[:, None])
    order = jnp.argsort(jnp.repeat(~near, 3), stable=True)
    branch = jnp.searchsorted(np.array(counts), 3 * jnp.sum(near))
    parts = [lambda count=count: on_part(count) for count in counts]
    return lax.switch(branch, [*parts, on_all])


def _newton(
    face: Face, sticking: Sticking, u: Array, slip: Array, drive: Drive
) -> tuple[Array, tuple[Array, Array]]:
    """Displacements where the residual vanishes; its size and the iterations beside them."""

    def residual(u: Array) -> Array:
        return _off_balance(face, u, slip, drive)

    def relative(u: Array, off: Array) -> Array:
        largest = jnp.max(jnp.abs(face.loads @ face.load(u, drive)))
        return jnp.max(jnp.abs(off)) / jnp.where(largest > 0.0, largest, 1.0)

    def improve(state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        u, off, count = state
        way = _newton_step(face, sticking, u, slip, drive, off)
        whole = u + way
        at_whole = residual(whole)
        before = jnp.sum(off**2)

        def shortened() -> tuple[Array, Array]:
            trials = u + SHORTER[:, None] * way
            offs = jax.vmap(residual)(trials)
            squares = jnp.sum(offs**2, axis=1)
            better = squares < (1.0 - 1e-4 * SHORTER) * before
            chosen = jnp.where(jnp.any(better), jnp.argmax(better), jnp.argmin(squares))
            return trials[chosen], offs[chosen]

        falls = jnp.sum(at_whole**2) < (1.0 - 1e-4) * before
        u, off = lax.cond(falls, lambda: (whole, at_whole), shortened)
        # A loop of no sweeps costs nothing, also under vmap, where a condition would take them all.
        sweeps = jnp.where((count + 1) % ROUND == 0, SWEEPS, 0)
        u, off = lax.fori_loop(0, sweeps, sweep, (u, off))
        return u, off, count + 1

    def sweep(_: Array, state: tuple[Array, Array]) -> tuple[Array, Array]:
        u, off = state
        u = u + sticking.moved(-off, drive.driven, face.loads[:, 0])
        return u, residual(u)

    def goes_on(state: tuple[Array, Array, Array]) -> Array:
        u, off, count = state
        most = relative(u, off)
        return (most > TOLERANCE) & (count < ITERATIONS) & jnp.isfinite(most)

    u, off, count = lax.while_loop(goes_on, improve, (u, residual(u), jnp.asarray(0)))
    return u, (relative(u, off), count.astype(u.dtype))

"""Bodies on their common face: what Newton's method asks of them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jax import Array
from numpy.typing import NDArray

from jbeamshell.bodies.face_law import Points
from jbeamshell.common.numbers_of import numbers_of, put, summed
from jbeamshell.numerics.factors import inverse

SPARE = 1.5  # entries that are kept over those that are needed, before others are
LARGE = 700  # rows, from which on memory is slower than the processor


class Face(NamedTuple):
    """Bodies on their common face, and the law of its contact points.

    Attributes
    ----------
    stiffness : (N, N) K of the nodes' displacements, three of each node in turn
    loads : (N, m) f of the load to and fro and of the bolts
    flexibility : (m, m) c, displacements per load while the nodes stay
    places : (g, 3 k) displacements of the nodes of each group of points, such as of an element
    shares : (g, 3 p, 3 k) their part B in the displacements of the group's p points, two tangential
        ones and the normal one
    points : numbers of the contact points, those of a group after each other, q = g p
    """

    stiffness: Array
    loads: Array
    flexibility: Array
    places: Array
    shares: Array
    points: Points

    def moves(self, u: Array) -> Array:
        """Displacements (q, 3) of the points, from those of the nodes (N,)."""
        return (self.shares @ u[self.places][:, :, None]).reshape(-1, 3)

    def on_nodes(self, force: Array) -> Array:
        """Nodal forces (..., N) of the points' forces (..., q, 3)."""
        groups = force.reshape(*force.shape[:-2], *self.shares.shape[:2])
        each = (groups[..., None, :] @ self.shares)[..., 0, :]
        return summed(each, self.places, len(self.loads))

    def blocks(self, stiffness: Array) -> Array:
        """Stiffness B' S B (g, 3 k, 3 k) of each group, by stiffnesses S (q, 3, 3) of points."""
        parts = self.shares.reshape(-1, 3, self.shares.shape[2])
        pushed = (stiffness @ parts).reshape(self.shares.shape)
        return self.shares.swapaxes(1, 2) @ pushed

    def load(self, u: Array, drive: Drive) -> Array:
        """Loads (m,), of which the first follows from its displacement where that is prescribed."""
        xp = numbers_of(u)
        soft = xp.where(drive.driven, self.flexibility[0, 0], 1.0)
        first = xp.where(drive.driven, self.left(u, drive) / soft, drive.load[0])
        return put(drive.load, 0, first)

    def left(self, u: Array, drive: Drive) -> Array:
        """Part of a prescribed displacement that the nodes and the other loads do not make."""
        others = self.flexibility[0, 1:] @ drive.load[1:]
        return drive.load[0] + drive.start - self.loads[:, 0] @ u - others


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
    inverse : (N, N) C, of the bodies on the springs of their points
    pulled, soft : (N,) and () displacements per load to and fro, and that of the load itself
    memory : parts of C that were asked for; none in a program of JAX
    """

    inverse: Array
    pulled: Array
    soft: Array
    memory: Memory | None

    @classmethod
    def of(cls, face: Face) -> Sticking:
        """Bodies of a face."""
        xp = numbers_of(face.loads)
        blocks = face.blocks(face.points.stiffness[:, :, None] * np.eye(3))
        size, places = len(face.loads), face.places
        flat = places[:, :, None] * size + places[:, None, :]
        springs = summed(blocks, flat, size**2).reshape(size, size)
        flexible = inverse(face.stiffness + springs)
        pulled = flexible @ face.loads[:, 0]
        soft = face.flexibility[0, 0] + pulled @ face.loads[:, 0]
        return cls(flexible, pulled, soft, Memory(flexible) if xp is np else None)

    def under(self, face: Face, force: Array, drive: Drive) -> Array:
        """Displacements (N,) under a load, and under nodal forces (N,)."""
        xp = numbers_of(force)
        free = self.inverse @ (force + face.loads[:, 1:] @ drive.load[1:])
        load = xp.where(drive.driven, face.left(free, drive) / self.soft, drive.load[0])
        return free + load * self.pulled

    def moved(self, force: Array, driven: Array, pull: Array) -> Array:
        """Displacements (N,) under nodal forces; with the load held in place where it is driven."""
        free = self.inverse @ force
        held = numbers_of(force).where(driven, (pull @ free) / self.soft, 0.0)
        return free - held * self.pulled


class Memory:
    """Parts of the flexibility of a face, which Newton's steps ask for again and again.

    Parameters
    ----------
    flexibility : (N, N)
    """

    def __init__(self, flexibility: Any) -> None:
        none = np.zeros(len(flexibility), bool)
        self._whole, self._rows, self._columns = flexibility, none, none
        self._part = flexibility[:0, :0]

    def part(self, rows: Any, columns: Any) -> tuple[Any, Any, NDArray[np.float64]]:
        """Numbers of the rows and columns of a part, and the part, columns first.

        Of large parts, which are multiplied alone, half of the digits are kept.

        Parameters
        ----------
        rows, columns : (N,) True for those that are needed; the part may have more
        """
        wanted = np.count_nonzero(rows) * np.count_nonzero(columns)
        both = rows | self._rows, columns | self._columns
        kept = np.count_nonzero(both[0]) * np.count_nonzero(both[1])
        if kept > SPARE * wanted:
            both = rows, columns
        known = np.array_equal(both[0], self._rows) and np.array_equal(both[1], self._columns)
        numbers = np.flatnonzero(both[0]), np.flatnonzero(both[1])
        if not known:
            self._rows, self._columns = both
            part = self._whole[np.ix_(numbers[1], numbers[0])]
            self._part = part.astype(np.float32) if numbers[0].size >= LARGE else part
        return *numbers, self._part

"""A user's structure with joints in it: mass, damping and stiffness matrices of any origin."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
import scipy.sparse
import scipy.sparse.linalg
from numpy.typing import NDArray

from jbeamshell.common.checks import require
from jbeamshell.dynamics.structure.joint import Joint

SQUARE = "give a square matrix of numbers, dense or scipy sparse, as large as the mass matrix"
SYMMETRIC = "must be symmetric; take (A + A.T)/2 if rounding is all that is wrong"
SYMMETRY_ROUNDING = 1e-8
DENSE = 400  # degrees of freedom up to which everything is dense


class Attachment(NamedTuple):
    """A joint between two degrees of freedom.

    Attributes
    ----------
    joint : its law
    first, second : the degrees of freedom; None is the ground
    """

    joint: Joint
    first: int
    second: int | None = None


class Structure:
    """M x_tt + C x_t + K x + joints = forces.

    Attributes
    ----------
    mass, damping, stiffness : (n, n) dense or sparse, symmetric
    attachments : the joints, whose stiffness the matrices do not contain
    """

    def __init__(
        self,
        mass: Any,
        stiffness: Any,
        attachments: Sequence[Attachment] = (),
        damping: Any = None,
    ) -> None:
        """Check the matrices.

        Raises
        ------
        InputError
            for matrices that are not square, of one size, symmetric and finite; for a mass matrix
            that is not positive; for a joint that is not between degrees of freedom; for a rigid
            mode, which neither stiffness nor a joint that sticks resists
        """
        self.mass = _checked("mass", mass)
        size = self.mass.shape[0]
        self.stiffness = _checked("stiffness", stiffness, size)
        none = 0.0 * self.mass
        self.damping = none if damping is None else _checked("damping", damping, size)
        self.attachments = tuple(attachments)
        for place, attached in enumerate(self.attachments):
            ends = [attached.first, *([] if attached.second is None else [attached.second])]
            inside = all(isinstance(e, int | np.integer) and 0 <= e < size for e in ends)
            apart = len(set(ends)) == len(ends)
            fix = f"name two different degrees of freedom from 0 to {size - 1}, or one and None"
            require(f"attachments[{place}]", ends, inside and apart, fix)
        self._check_modes()

    @property
    def size(self) -> int:
        """Degrees of freedom."""
        return self.mass.shape[0]

    @property
    def directions(self) -> NDArray[np.float64]:
        """What turns motions into the joints' displacements, transposed: (n, joints)."""
        directions = np.zeros((self.size, len(self.attachments)))
        for column, attached in enumerate(self.attachments):
            directions[attached.first, column] = 1.0
            if attached.second is not None:
                directions[attached.second, column] = -1.0
        return directions

    @property
    def stuck(self) -> Any:
        """Stiffness with all joints sticking."""
        own = np.array([float(a.joint.stiffness) for a in self.attachments])
        along = self.directions
        if scipy.sparse.issparse(self.stiffness):
            along = scipy.sparse.csr_array(along)
            return self.stiffness + along @ scipy.sparse.diags_array(own) @ along.T
        return self.stiffness + (along * own) @ along.T

    def modes(self, count: int = 6) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Angular frequencies (k,) and shapes (n, k) of unit modal mass, all joints sticking."""
        stuck, count = self.stuck, min(count, self.size)
        if self.size <= DENSE or count >= self.size - 1:
            values, shapes = scipy.linalg.eigh(dense(stuck), dense(self.mass))
        else:
            stiff, heavy = (scipy.sparse.csc_array(a) for a in (stuck, self.mass))
            # Below zero, so that a rigid mode is seen and not divided by.
            shift = -SYMMETRY_ROUNDING * abs(stuck).max() / abs(self.mass).max()
            values, shapes = scipy.sparse.linalg.eigsh(stiff, count, heavy, sigma=shift)
        order = np.argsort(values)[:count]
        return np.sqrt(np.maximum(values[order], 0.0)), shapes[:, order]

    def compliance(self, loads: NDArray[np.float64]) -> NDArray[np.float64]:
        """Static displacements (n, k) under loads (n, k), all joints sticking."""
        if self.size <= DENSE:
            return scipy.linalg.solve(dense(self.stuck), loads, assume_a="pos")
        solver = scipy.sparse.linalg.splu(scipy.sparse.csc_array(self.stuck))
        return solver.solve(loads)

    def _check_modes(self) -> None:
        try:
            if self.size <= DENSE:
                scipy.linalg.cholesky(dense(self.mass))
            lightest = float(np.min(self.mass.diagonal()))
        except scipy.linalg.LinAlgError:
            lightest = -1.0
        require("mass", self.mass.shape, lightest > 0.0, "must be positive definite")
        frequency, _ = self.modes(1)
        scale = float(abs(self.stuck).max() / abs(self.mass).max())
        held = frequency[0] ** 2 > SYMMETRY_ROUNDING * scale
        fix = "leaves an undamped rigid mode: hold the structure, or attach a joint that does"
        require("stiffness", self.stiffness.shape, held, fix)


def _checked(name: str, matrix: Any, size: int | None = None) -> Any:
    if scipy.sparse.issparse(matrix):
        known, values = scipy.sparse.csr_array(matrix).astype(float), matrix.data
    else:
        try:
            known = np.asarray(matrix, float)
        except (TypeError, ValueError):
            known = np.zeros(0)
        values = known
    square = known.ndim == 2 and known.shape[0] == known.shape[1] and known.shape[0] > 0
    fits = square and size in (None, known.shape[0])
    require(name, known.shape, fits, SQUARE)
    require(name, known.shape, bool(np.all(np.isfinite(values))), "must hold finite numbers only")
    skew = abs(known - known.T).max()
    require(name, known.shape, bool(skew <= SYMMETRY_ROUNDING * abs(known).max()), SYMMETRIC)
    return known


def dense(matrix: Any) -> NDArray[np.float64]:
    """The matrix with all its zeros."""
    return matrix.toarray() if scipy.sparse.issparse(matrix) else matrix

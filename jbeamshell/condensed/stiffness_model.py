"""Stiffness model: the matrix of an elastic body from any finite-element program.

The matrix is that of a full model, or of one that the program has condensed already.  Each row is a
degree of freedom, a node in a direction.  Everything but the contact is eliminated here,

    K = K_cc - K_ci K_ii^-1 K_ic,    f = f_c - K_ci K_ii^-1 f_i,    c = f_i' K_ii^-1 f_i,

with c the contact, i the rest, and f the nodal forces of a load (Guyan 1965; exact in statics).
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.linalg import SuperLU, splu

from jbeamshell.common.checks import require, require_count
from jbeamshell.common.errors import InputError
from jbeamshell.condensed.matrix_files import read_matrix
from jbeamshell.condensed.substructure import Substructure

SYMMETRIC = 1e-8  # of the largest entry
SAME_PLACE = 1e-9  # of the contact's length, within which nodes lie at one X
LOST = 1e-12  # pivot over its diagonal entry, from which on nothing is left of the stiffness
TABLE = "give rows of node and X"
FORCES = "give rows of node, direction and force"


@dataclasses.dataclass(frozen=True, eq=False)
class StiffnessModel:
    """Stiffness matrix of an elastic body, with the node and direction of each row.

    Supports are those degrees of freedom that the matrix does not have.

    Attributes
    ----------
    matrix : (N, N) symmetric, dense or scipy sparse
    dofs : (N, 2) node number and direction (1, 2, 3) of each row

    Raises
    ------
    InputError
        if the matrix is not square or not symmetric, or has no row for each degree of freedom

    Examples
    --------
    ::

        model = jb.StiffnessModel.read("upper.sti")  # of CalculiX, with upper.dof beside it
        upper = model.condensed(contact, pull=pull, press=[bolt])
        history = jb.solve_contact(upper, friction=0.1, amplitude=0.8)
    """

    matrix: Any
    dofs: NDArray[np.int64]

    def __post_init__(self) -> None:
        matrix = scipy.sparse.csc_array(self.matrix)
        square = matrix.shape[0] == matrix.shape[1] > 0
        require("matrix", matrix.shape, square, "must be square")
        finite = bool(np.all(np.isfinite(matrix.data)))
        require("matrix", matrix.shape, finite, "must hold finite numbers only")
        largest = float(np.max(np.abs(matrix.data), initial=0.0))
        apart = float(abs(matrix - matrix.T).max()) if matrix.nnz else 0.0
        fix = "is not symmetric: give the whole matrix, or mirror the half that was written"
        require("matrix", f"max|K - K'| {apart:.3g}", apart <= SYMMETRIC * largest, fix)
        dofs = np.asarray(self.dofs)
        fix = f"give the node and direction of each of its {matrix.shape[0]} rows"
        require("dofs", dofs.shape, dofs.shape == (matrix.shape[0], 2), fix)
        unique = len({tuple(row) for row in dofs.tolist()}) == len(dofs)
        require("dofs", dofs.shape, unique, "must name each node and direction once")
        object.__setattr__(self, "matrix", 0.5 * (matrix + matrix.T))
        object.__setattr__(self, "dofs", dofs.astype(np.int64))

    @classmethod
    def read(
        cls, path: str | os.PathLike[str], *, dofs: ArrayLike | None = None, directions: int = 2
    ) -> StiffnessModel:
        """Model in a file, see `jbeamshell.condensed.matrix_files` for the formats.

        Parameters
        ----------
        path : file of the matrix
        dofs : (N, 2) node and direction of each row, where the file does not say them
        directions : rows of each node where neither does; nodes then count from 1

        Raises
        ------
        InputError
            if the file cannot be read or holds no such matrix
        """
        found = read_matrix(path)
        if dofs is not None:
            return cls(found.matrix, np.asarray(dofs))
        if found.dofs is not None:
            return cls(found.matrix, found.dofs)
        require_count("directions", directions, 1, 6)
        node, direction = np.divmod(np.arange(found.matrix.shape[0]), directions)
        return cls(found.matrix, np.column_stack([node, direction]) + 1)

    def condensed(
        self,
        contact: ArrayLike,
        *,
        pull: ArrayLike | None = None,
        press: Sequence[ArrayLike] = (),
        held: ArrayLike | None = None,
        tangential: int = 1,
        normal: int = 2,
        tributary: ArrayLike | None = None,
    ) -> Substructure:
        """Body on its contact line, everything else eliminated.

        Parameters
        ----------
        contact : (k, 2) node and X of the contact's nodes; those at one X move together, such as
            the front and the back of a slice
        pull : (k, 3) node, direction and force of a unit of the load that is cycled; its
            displacement is the one conjugate to it.  None for a body that is not pulled
        press : for each bolt or pressure, (k, 3) node, direction and force
        held : (k, 2) node and direction of supports that the matrix still has
        tangential, normal : directions along the contact and away from the body below
        tributary : contact length of each X; None is half the way to its neighbours

        Raises
        ------
        InputError
            for a node that the model does not have, or a body with a negative or a loose mode
        """
        model = self if held is None else self._without(held)
        row = {(int(a), int(b)): i for i, (a, b) in enumerate(model.dofs)}
        nodes, x, group = _groups(contact)
        known = set(model.dofs[:, 0].tolist())
        for node in nodes:
            fix = "is no node of the model: give nodes that have rows in the matrix"
            require("contact", node, node in known, fix)
        size = model.dofs.shape[0]
        place = np.full(size, -1)
        fixed = np.zeros((x.size, 2), bool)
        for side, direction in enumerate((tangential, normal)):
            for node, g in zip(nodes, group, strict=True):
                if (node, direction) not in row:
                    fixed[g, side] = True
            for node, g in zip(nodes, group, strict=True):
                if (node, direction) in row:
                    place[row[node, direction]] = -2 if fixed[g, side] else 2 * g + side
        forces = np.column_stack(
            [_forces("pull", [] if pull is None else pull, row, size)]
            + [_forces(f"press[{i}]", table, row, size) for i, table in enumerate(press)]
        )
        on_line, inside = np.flatnonzero(place >= 0), np.flatnonzero(place == -1)
        ties = scipy.sparse.csc_array(
            (np.ones(on_line.size), (np.arange(on_line.size), place[on_line])),
            shape=(on_line.size, 2 * x.size),
        )
        stiffness = (ties.T @ model.matrix[on_line][:, on_line] @ ties).toarray()
        across = (model.matrix[inside][:, on_line] @ ties).toarray()
        among, given = ties.T @ forces[on_line], forces[inside]
        flexibility = np.zeros((forces.shape[1],) * 2)
        if inside.size:
            solved = _factors(model.matrix[inside][:, inside]).solve(np.hstack([across, given]))
            by_contact, by_loads = np.split(solved, [across.shape[1]], axis=1)
            stiffness = stiffness - across.T @ by_contact
            among = among - across.T @ by_loads
            flexibility = given.T @ by_loads
        return Substructure(
            x,
            0.5 * (stiffness + stiffness.T),
            among,
            0.5 * (flexibility + flexibility.T),
            tributary=tributary,
            fixed=fixed.ravel().tolist(),
        )

    def _without(self, held: ArrayLike) -> StiffnessModel:
        """Model without the rows of supports."""
        table = np.asarray(held)
        fix = "give rows of node and direction"
        require("held", table.shape, table.ndim == 2 and table.shape[1] == 2, fix)
        gone = {(int(a), int(b)) for a, b in table}
        kept = [i for i, (a, b) in enumerate(self.dofs.tolist()) if (a, b) not in gone]
        return StiffnessModel(self.matrix[kept][:, kept], self.dofs[kept])


def _groups(contact: ArrayLike) -> tuple[list[int], NDArray[np.float64], NDArray[np.int64]]:
    """Nodes of the contact, the rising places X, and the place of each node."""
    table = np.asarray(contact, float)
    require("contact", table.shape, table.ndim == 2 and table.shape[1] == 2, TABLE)
    require("contact", table.shape, bool(np.all(np.isfinite(table))), TABLE)
    nodes = [int(node) for node in table[:, 0]]
    require("contact", len(nodes), len(set(nodes)) == len(nodes), "names a node twice")
    order = np.argsort(table[:, 1], kind="stable")
    rising = table[order, 1]
    begins = np.diff(rising, prepend=-np.inf) > SAME_PLACE * np.ptp(rising)
    group = np.empty(len(nodes), int)
    group[order] = np.cumsum(begins) - 1
    x = rising[begins]
    require("contact", x.size, x.size > 1, "needs nodes at two or more places X")
    return nodes, x, group


def _forces(
    key: str, table: ArrayLike, row: dict[tuple[int, int], int], size: int
) -> NDArray[np.float64]:
    """Nodal forces (N,) of a table of node, direction and force."""
    values = np.asarray(table, float).reshape(-1, 3) if np.size(table) else np.zeros((0, 3))
    require(key, values.shape, bool(np.all(np.isfinite(values))), FORCES)
    found = np.zeros(size)
    for node, direction, force in values:
        where = row.get((int(node), int(direction)))
        if where is None:
            fix = "is not in the model: leave it out where a support holds it"
            raise InputError(f"{key} = node {int(node)}, direction {int(direction)}: {fix}")
        found[where] += force
    return found


def _factors(matrix: scipy.sparse.csc_array) -> SuperLU:
    """Factors of what is eliminated, which must be positive definite."""
    try:
        factors = splu(
            scipy.sparse.csc_matrix(matrix),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:  # exactly singular
        left = 0.0
    else:
        left = float(np.min(factors.U.diagonal()[factors.perm_c] / matrix.diagonal()))
    fix = "a part moves freely or has a negative mode with the contact clamped: check the supports"
    require("matrix", f"pivot {left:.3g} of its diagonal", left > LOST, fix)
    return factors

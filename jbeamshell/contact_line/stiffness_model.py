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

from jbeamshell.common.checks import require, require_count, shown, whole_numbers
from jbeamshell.common.errors import InputError
from jbeamshell.contact_line.craig_bampton import reduced
from jbeamshell.contact_line.matrix_files import read_matrix
from jbeamshell.contact_line.substructure import Substructure

SYMMETRIC = 1e-8  # of the largest entry
SAME_PLACE = 1e-9  # of the contact's length, within which nodes lie at one X
LOST = 1e-12  # pivot over its diagonal entry, from which on nothing is left of the stiffness
TABLE = "give rows of node and X"
FORCES = "give rows of node, direction and force"
SUPPORTS = "give rows of node and direction"
DIRECTIONS = 6  # three ways and three turns
MODAL = 0  # direction of a row that is the coordinate of a mode, not of a node


@dataclasses.dataclass(frozen=True, eq=False)
class StiffnessModel:
    """Stiffness matrix of an elastic body, with the node and direction of each row.

    Supports are those degrees of freedom that the matrix does not have.

    Attributes
    ----------
    matrix : (N, N) symmetric, dense or scipy sparse
    dofs : (N, 2) node number and direction (1, 2, 3) of each row; the mode of a reduced body has
        a row with a number of its own and the direction 0
    mass : (N, N) symmetric, or None; only modes need it

    Raises
    ------
    InputError
        if a matrix is not square or not symmetric, if it has no row for each degree of freedom,
        or if a node or a direction is no whole number

    Examples
    --------
    ::

        model = jb.StiffnessModel.read("upper.sti")  # of CalculiX, with upper.dof beside it
        upper = model.condensed(contact, pull=pull, press=[bolt])
        history = jb.solve_contact(upper, friction=0.1, amplitude=0.8)
    """

    matrix: Any
    dofs: NDArray[np.int64]
    mass: Any = None

    def __post_init__(self) -> None:
        matrix = _symmetric("matrix", self.matrix)
        dofs = whole_numbers("dofs", self.dofs)
        fix = f"give the node and direction of each of its {matrix.shape[0]} rows"
        require("dofs", dofs.shape, dofs.shape == (matrix.shape[0], 2), fix)
        valid = bool(np.all((dofs >= [0, MODAL]) & (dofs[:, 1:] <= DIRECTIONS)))
        modal = dofs[dofs[:, 1] == MODAL, 0]
        valid &= int(np.sum(np.isin(dofs[:, 0], modal))) == modal.size
        fix = f"directions are 1 to {DIRECTIONS}, and {MODAL} alone in a mode's only row"
        require("dofs", dofs, valid, f"{fix}; nodes are not negative")
        unique = len({tuple(row) for row in dofs.tolist()}) == len(dofs)
        require("dofs", dofs.shape, unique, "must name each node and direction once")
        object.__setattr__(self, "matrix", matrix)
        object.__setattr__(self, "dofs", dofs)
        if self.mass is not None:
            mass = _symmetric("mass", self.mass)
            require("mass", mass.shape, mass.shape == matrix.shape, f"must be {matrix.shape}")
            fix = "must be positive on its diagonal: each row needs its mass"
            require("mass", mass.shape, bool(np.all(mass.diagonal() > 0.0)), fix)
            object.__setattr__(self, "mass", mass)

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        *,
        dofs: ArrayLike | None = None,
        directions: int = 2,
        mass: str | os.PathLike[str] | None = None,
    ) -> StiffnessModel:
        """Model in a file, see `jbeamshell.contact_line.matrix_files` for the formats.

        Parameters
        ----------
        path : file of the matrix
        dofs : (N, 2) node and direction of each row, where the file does not say them
        directions : rows of each node where neither does; nodes then count from 1
        mass : file of the mass matrix, its rows in the same order; may be the same file

        Raises
        ------
        InputError
            if the file cannot be read or holds no such matrix
        """
        rows = read_matrix(path)
        masses = None if mass is None else read_matrix(mass, "mass")
        if masses is not None and rows.dofs is not None and masses.dofs is not None:
            same = np.array_equal(rows.dofs, masses.dofs)
            require("mass", str(mass), same, "must name the rows of the stiffness, in their order")
        matrices = rows.matrix, None if masses is None else masses.matrix
        if dofs is not None:
            return cls(matrices[0], np.asarray(dofs), matrices[1])
        if rows.dofs is not None:
            return cls(matrices[0], rows.dofs, matrices[1])
        require_count("directions", directions, 1, DIRECTIONS)
        node, direction = np.divmod(np.arange(rows.matrix.shape[0]), directions)
        return cls(matrices[0], np.column_stack([node, direction]) + 1, matrices[1])

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
        held : (k, 2) node and direction of supports that the matrix still has; may be empty
        tangential, normal : directions along the contact and away from the body below
        tributary : contact length of each X; None is half the way to its neighbours

        Raises
        ------
        InputError
            for a node or a direction that the model does not have, or that is no whole number; for
            forces and lengths that are not finite; for a body with a negative or a loose mode
        """
        model = self if held is None else self.without(held)
        directions = {"tangential": tangential, "normal": normal}
        for key, direction in directions.items():
            require_count(key, direction, 1, DIRECTIONS)
        require("normal", normal, normal != tangential, "must differ from tangential")
        row = {(int(a), int(b)): i for i, (a, b) in enumerate(model.dofs)}
        nodes, x, group = _groups(contact)
        model_nodes = set(self.dofs[:, 0].tolist())
        for node in nodes:
            fix = "is no node of the model: give nodes that have rows in the matrix"
            require("contact", node, node in model_nodes, fix)
        for key, direction in directions.items():
            fix = "is a direction that no node of the contact has: name another, or free a node"
            require(key, direction, any((node, direction) in row for node in nodes), fix)
        place, fixed = _places(row, nodes, group, (tangential, normal))
        forces = np.column_stack(
            [nodal_forces("pull", [] if pull is None else pull, row)]
            + [nodal_forces(f"press[{i}]", table, row) for i, table in enumerate(press)]
        )
        matrices = condensed_on(model.matrix, forces, place, 2 * x.size)
        return Substructure(x, *matrices, tributary=tributary, fixed=fixed.ravel().tolist())

    def without(self, held: ArrayLike) -> StiffnessModel:
        """Model without the rows of supports."""
        rows = table_of("held", held, 2, SUPPORTS)
        supports = {(a, b) for a, b in whole_numbers("held", rows).tolist()}
        dofs = set(map(tuple, self.dofs.tolist()))
        for node, direction in sorted(supports - dofs):
            fix = "is not in the model: leave it out where its matrix has the support already"
            raise InputError(f"held = node {node}, direction {direction}: {fix}")
        stay = [i for i, dof in enumerate(self.dofs.tolist()) if tuple(dof) not in supports]
        fix = "holds the whole body: leave some free"
        require("held", f"{len(supports)} rows", bool(stay), fix)
        mass = None if self.mass is None else self.mass[stay][:, stay]
        return StiffnessModel(self.matrix[stay][:, stay], self.dofs[stay], mass)

    def reduced(self, nodes: ArrayLike, modes: int = 20) -> StiffnessModel:
        """Model of some nodes and of the modes of the rest (Craig and Bampton 1968).

        Parameters
        ----------
        nodes : (k,) those of the contact, and all that bear loads
        modes : how many modes of the body, with these nodes clamped, are retained

        Returns
        -------
        StiffnessModel
            its last rows are the modes, numbered after all nodes, with the direction 0

        Raises
        ------
        InputError
            for a model without mass, a node without a row, or more modes than there are
        """
        require("mass", self.mass, self.mass is not None, "is needed: read the model with mass=")
        wanted = whole_numbers("nodes", np.ravel(np.asarray(nodes))).tolist()
        for node in sorted(set(wanted) - set(self.dofs[:, 0].tolist())):
            raise InputError(f"nodes = node {node}: has no row in the matrix: leave it out")
        kept = np.isin(self.dofs[:, 0], wanted) & (self.dofs[:, 1] > MODAL)
        inside = int(np.sum(~kept))
        require_count("modes", modes, 0, max(inside - 1, 0))
        factors = _factors(self.matrix[~kept][:, ~kept]) if inside else None
        stiffness, mass = reduced(self.matrix, self.mass, kept, factors, modes)
        number = np.max(self.dofs[:, 0]) + np.arange(1, modes + 1)
        rows = np.column_stack([number, np.full(modes, MODAL)])
        return StiffnessModel(stiffness, np.concatenate([self.dofs[kept], rows]), mass)


def _symmetric(key: str, given: Any) -> scipy.sparse.csc_array:
    """Sparse matrix, refused unless it is square, finite and symmetric."""
    matrix = scipy.sparse.csc_array(given)
    square = matrix.shape[0] == matrix.shape[1] > 0
    require(key, matrix.shape, square, "must be square")
    finite = bool(np.all(np.isfinite(matrix.data)))
    require(key, matrix.shape, finite, "must hold finite numbers only")
    largest = float(np.max(np.abs(matrix.data), initial=0.0))
    apart = float(abs(matrix - matrix.T).max()) if matrix.nnz else 0.0
    fix = "is not symmetric: give the whole matrix, or mirror the half that was written"
    require(key, f"max|K - K'| {apart:.3g}", apart <= SYMMETRIC * largest, fix)
    return 0.5 * (matrix + matrix.T)


def _groups(contact: ArrayLike) -> tuple[list[int], NDArray[np.float64], NDArray[np.int64]]:
    """Nodes of the contact, the rising places X, and the place of each node."""
    table = table_of("contact", contact, 2, TABLE)
    nodes = whole_numbers("contact", table[:, 0]).tolist()
    require("contact", len(nodes), len(set(nodes)) == len(nodes), "names a node twice")
    order = np.argsort(table[:, 1], kind="stable")
    rising = table[order, 1]
    begins = np.diff(rising, prepend=-np.inf) > SAME_PLACE * np.ptp(rising)
    group = np.empty(len(nodes), int)
    group[order] = np.cumsum(begins) - 1
    x = rising[begins]
    require("contact", x.size, x.size > 1, "needs nodes at two or more places X")
    return nodes, x, group


def _places(
    row: dict[tuple[int, int], int],
    nodes: list[int],
    group: NDArray[np.int64],
    directions: tuple[int, int],
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Place of each row (N,) on the contact, and True for the contact's fixed displacements (n, 2).

    A place is -1 inside the body, and -2 where a support holds another node at the same X.
    """
    place, fixed = np.full(len(row), -1), np.zeros((np.max(group) + 1, 2), bool)
    for side, direction in enumerate(directions):
        for node, g in zip(nodes, group, strict=True):
            fixed[g, side] |= (node, direction) not in row
        for node, g in zip(nodes, group, strict=True):
            if (node, direction) in row:
                place[row[node, direction]] = -2 if fixed[g, side] else 2 * g + side
    return place, fixed


def condensed_on(
    matrix: scipy.sparse.csc_array, forces: NDArray[Any], place: NDArray[np.int64], size: int
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Stiffness, forces and flexibility of the contact's displacements, ``size`` of them."""
    on_line, inside = np.flatnonzero(place >= 0), np.flatnonzero(place == -1)
    ties = scipy.sparse.csc_array(
        (np.ones(on_line.size), (np.arange(on_line.size), place[on_line])),
        shape=(on_line.size, size),
    )
    stiffness = (ties.T @ matrix[on_line][:, on_line] @ ties).toarray()
    across = (matrix[inside][:, on_line] @ ties).toarray()
    loads, forces = forces[inside], ties.T @ forces[on_line]
    flexibility = np.zeros((forces.shape[1],) * 2)
    if inside.size:
        fields = _factors(matrix[inside][:, inside]).solve(np.hstack([across, loads]))
        by_contact, by_loads = np.split(fields, [across.shape[1]], axis=1)
        stiffness = stiffness - across.T @ by_contact
        forces = forces - across.T @ by_loads
        flexibility = loads.T @ by_loads
    return 0.5 * (stiffness + stiffness.T), forces, 0.5 * (flexibility + flexibility.T)


def nodal_forces(
    key: str, table: ArrayLike, row: dict[tuple[int, int], int]
) -> NDArray[np.float64]:
    """Nodal forces (N,) of a table of node, direction and force."""
    values = table_of(key, table, 3, FORCES)
    forces = np.zeros(len(row))
    places = whole_numbers(key, values[:, :2]).tolist()
    for (node, direction), force in zip(places, values[:, 2], strict=True):
        where = row.get((node, direction))
        if where is None:
            fix = "is not in the model: leave it out where a support holds it"
            raise InputError(f"{key} = node {node}, direction {direction}: {fix}")
        forces[where] += force
    return forces


def table_of(key: str, table: ArrayLike, columns: int, fix: str) -> NDArray[np.float64]:
    """Rows of finite numbers of a table; none of an empty one."""
    try:
        values = np.asarray(table, float)
    except (TypeError, ValueError):
        raise InputError(f"{key} = {shown(table)}: is no table of numbers: {fix}") from None
    values = values if values.size else np.zeros((0, columns))
    require(key, values.shape, values.ndim == 2 and values.shape[1] == columns, fix)
    finite = np.all(np.isfinite(values), axis=1)
    require(key, values[~finite], bool(np.all(finite)), "holds NaN or infinity: " + fix)
    return values


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
        pivot = 0.0
    else:
        pivot = float(np.min(factors.U.diagonal()[factors.perm_c] / matrix.diagonal()))
    fix = "a part moves freely or has a negative mode with the contact clamped: check the supports"
    require("matrix", f"pivot {pivot:.3g} of its diagonal", pivot > LOST, fix)
    return factors

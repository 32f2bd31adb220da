"""Stiffness model: the matrix of an elastic body from any finite-element program.

The matrix is that of a full model, or of one that the program has condensed already.  Each row is a
degree of freedom, a node in a direction.  Everything but the contact is eliminated here,

    K = K_cc - K_ci K_ii^-1 K_ic,    f = f_c - K_ci K_ii^-1 f_i,    c = f_i' K_ii^-1 f_i,

with c the contact, i the rest, and f the nodal forces of a load (Guyan 1965; exact in statics).
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike, NDArray

from jbeamshell.bodies.condensation import (
    condensed_on,
    face_rows,
    factors_of,
    line_rows,
    nodal_forces,
)
from jbeamshell.bodies.craig_bampton import reduced
from jbeamshell.bodies.matrix_files import read_matrix
from jbeamshell.bodies.substructure import Substructure
from jbeamshell.bodies.tables import table_of
from jbeamshell.common.checks import require, require_count, whole_numbers
from jbeamshell.common.errors import InputError

SYMMETRIC = 1e-8  # of the largest entry
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
        """Model in a file, see `jbeamshell.bodies.matrix_files` for the formats.

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
        normals: ArrayLike | None = None,
        elements: Iterable[ArrayLike] | None = None,
        tributary: ArrayLike | None = None,
    ) -> Substructure:
        """Body on its contact, everything else eliminated.

        Parameters
        ----------
        contact : (k, 2) node and X of the nodes of a contact line; those at one X move together,
            such as the front and the back of a slice.  Or (n, 4) node, X, Y and Z of a face's nodes
        pull : (k, 3) node, direction and force of a unit of the load that is cycled; its
            displacement is the one conjugate to it.  None for a body that is not pulled
        press : for each bolt or pressure, (k, 3) node, direction and force
        held : (k, 2) node and direction of supports that the matrix still has; may be empty
        tangential, normal : directions along a line and away from the body below
        normals : (3,) or (n, 3) of a face, from the body below to the one above; along Z if left
            out.  With elements, roughly
        elements : (k, 3 or 4) nodes of each element of a face, which give areas and normals by
            their shape functions, see `jbeamshell.face_surface`
        tributary : contact length of each X, half the way to its neighbours if left out; or area of
            each node of a face

        Raises
        ------
        InputError
            for a node or a direction that the model does not have, or that is no whole number; for
            forces and lengths that are not finite; for a body with a negative or a loose mode; for
            a support at a face that does not lie along a frame, or elements that are no mesh
        """
        model = self if held is None else self.without(held)
        if np.ndim(contact) == 2 and np.shape(contact)[1] == 4:
            directions = (tangential, normal) == (1, 2)
            fix = "are those of a line: give the normals of the face"
            require("tangential, normal", (tangential, normal), directions, fix)
            place, turn, given = face_rows(model.dofs, contact, normals, elements, tributary)
        else:
            for key, value in (("normals", normals), ("elements", elements)):
                require(key, value, value is None, "are those of a face: leave them out")
            for key, direction in (("tangential", tangential), ("normal", normal)):
                require_count(key, direction, 1, DIRECTIONS)
            require("normal", normal, normal != tangential, "must differ from tangential")
            place, given = line_rows(model.dofs, self.dofs, contact, (tangential, normal))
            turn, given = None, given | {"tributary": tributary}
        row = {(int(a), int(b)): i for i, (a, b) in enumerate(model.dofs)}
        forces = np.column_stack(
            [nodal_forces("pull", [] if pull is None else pull, row)]
            + [nodal_forces(f"press[{i}]", table, row) for i, table in enumerate(press)]
        )
        stiffness, loads, flexibility = condensed_on(
            model.matrix, forces, place, len(given["fixed"])
        )
        if turn is not None:
            stiffness, loads = turn @ (turn @ stiffness).T, turn @ loads
        places = given.pop("places")
        return Substructure(places, stiffness, loads, flexibility, **given)

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
        factors = factors_of(self.matrix[~kept][:, ~kept]) if inside else None
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

"""Structures with joints: mass, damping and stiffness matrices from any finite-element code."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
import scipy.sparse
import scipy.sparse.linalg
from jax import Array, lax
from jax.scipy.linalg import solve_triangular
from numpy.typing import ArrayLike, NDArray

from jbeamshell.common.checks import TINY, as_leaf, is_traced, require, require_number, shown
from jbeamshell.common.errors import InputError
from jbeamshell.dynamics.frequencies import Modes
from jbeamshell.dynamics.structure.joint import Joint
from jbeamshell.laws.law import ROUNDING, Law

SQUARE = "give a square matrix of numbers, dense or scipy sparse, as large as the mass matrix"
SYMMETRIC = "must be symmetric; take (A + A.T)/2 if only rounding makes it unsymmetric"
SYMMETRY_ROUNDING = 1e-8
DENSE = 400  # largest number of degrees of freedom for dense linear algebra
LARGE = f"needs all modes: give damping= of a structure of more than {DENSE} degrees of freedom"
SPARSE = f"needs dense matrices of at most {DENSE} degrees of freedom: reduce the structure first"
RATIOS = "give one damping ratio, or one for each of the lowest modes"


class Attachment(NamedTuple):
    """Law of a joint between two degrees of freedom.

    Attributes
    ----------
    law : `Joint`, or any law with Masing's memory, which becomes one (`Joint.of`)
    first, second : degrees of freedom, counted from 0; None is the ground
    """

    law: Law
    first: int
    second: int | None = None


class Structure:
    """Structure with joints, M x_tt + C x_t + K x + joint forces = f.

    Numbers of its matrices, ratios and joints may be traced by `jax.jit` and `jax.grad`, if it has
    few degrees of freedom; a traced structure is not checked.

    Attributes
    ----------
    mass, stiffness : (n, n) symmetric matrices, dense or scipy sparse
    attachments : joints; the matrices do not contain their stiffness
    joints : their laws as sliders
    damping_ratio : (m,) damping ratios of the lowest modes with all joints stuck, beside those of
        the given damping matrix; zeros beyond them

    Examples
    --------
    Two masses on a spring, the first one held by a joint:

    >>> joint = Joint([1.0, 3.0], [1.0, 2.0])
    >>> spring = [[2.0, -2.0], [-2.0, 2.0]]
    >>> Structure(np.eye(2), spring, [Attachment(joint, 0)]).size
    2
    """

    def __init__(
        self,
        mass: Any,
        stiffness: Any,
        attachments: Sequence[Attachment] = (),
        damping: Any = None,
        damping_ratio: ArrayLike | None = None,
    ) -> None:
        """Structure from its matrices and joints.

        Parameters
        ----------
        mass, stiffness : (n, n) symmetric matrices, dense or scipy sparse
        attachments : joints; the matrices do not contain their stiffness
        damping : (n, n) damping matrix; None is none
        damping_ratio : damping ratio of all modes, or one for each of the lowest, with all joints
            stuck; it adds to the matrix.  So small motion is damped as that of measured structures

        Raises
        ------
        InputError
            for matrices that are not square, of one size, real, symmetric and finite; for a mass
            that is not positive definite; for a damping with a negative mode; for a joint at a
            degree of freedom that does not exist; for a rigid-body mode, or one of negative
            stiffness, with all joints stuck; for a negative damping ratio, or more than modes; for
            ratios or traced numbers of a large structure; for a law that no sliders hold
        """
        self.mass = _checked("mass", mass)
        size = self.mass.shape[0]
        self.stiffness = _checked("stiffness", stiffness, size)
        undamped = 0.0 * self.mass
        self._given_damping = undamped if damping is None else _checked("damping", damping, size)
        self.damping_ratio = _ratios(damping_ratio, size)
        self.attachments = tuple(attachments)
        laws = [attached.law for attached in self.attachments]
        for place, law in enumerate(laws):
            fix = "give a Joint, or another jbeamshell.laws.Law"
            require(f"attachments[{place}].law", type(law).__name__, isinstance(law, Law), fix)
        self.joints = [law if isinstance(law, Joint) else Joint.of(law) for law in laws]
        for place, attached in enumerate(self.attachments):
            ends = [attached.first, *([] if attached.second is None else [attached.second])]
            inside = all(isinstance(e, int | np.integer) and 0 <= e < size for e in ends)
            apart = len(set(ends)) == len(ends)
            fix = f"name two different degrees of freedom from 0 to {size - 1}, or one and None"
            require(f"attachments[{place}]", ends, inside and apart, fix)
        if not self.traced:
            self._check_modes()
        elif size > DENSE or scipy.sparse.issparse(self.mass + self.stiffness):
            require("structure", "traced", size <= DENSE, SPARSE)
            self.mass, self.stiffness = dense(self.mass), dense(self.stiffness)

    @property
    def traced(self) -> bool:
        """True if any number of the structure is traced by a JAX transformation."""
        matrices = (self.mass, self.stiffness, self._given_damping, self.damping_ratio)
        return is_traced(*matrices, self.joints)

    @property
    def damping(self) -> Any:
        """Damping matrix C (n, n): the given one, and that of the damping ratios."""
        if not self.damping_ratio.size:
            return self._given_damping
        require("damping_ratio", self.damping_ratio.shape, self.size <= DENSE, LARGE)
        modes = self.modes(self.damping_ratio.size)
        momenta = dense(self.mass) @ modes.shapes
        own = (momenta * (2.0 * self.damping_ratio * modes.omega)) @ momenta.T
        return dense(self._given_damping) + own

    def modal_damping(self, shape: Any, omega: Any, mode: int) -> Any:
        """Damping 2 zeta omega of a mode of unit modal mass with all joints stuck.

        Parameters
        ----------
        shape : (n,) shape of the mode
        omega : its angular frequency
        mode : its number, counted from 0
        """
        known = mode < self.damping_ratio.size
        ratio = self.damping_ratio[mode] if known else 0.0
        return shape @ (self._given_damping @ shape) + 2.0 * ratio * omega

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return self.mass.shape[0]

    @property
    def directions(self) -> NDArray[np.float64]:
        """Matrix B (n, joints): B.T x are the displacements of the joints, B r their forces."""
        directions = np.zeros((self.size, len(self.attachments)))
        for column, attached in enumerate(self.attachments):
            directions[attached.first, column] = 1.0
            if attached.second is not None:
                directions[attached.second, column] = -1.0
        return directions

    @property
    def stuck_stiffness(self) -> Any:
        """Stiffness matrix (n, n) with all joints stuck."""
        springs = [joint.stiffness for joint in self.joints]
        directions = self.directions
        if self.traced:
            return self.stiffness + (directions * jnp.asarray(springs)) @ directions.T
        own = np.array(springs, float)
        if scipy.sparse.issparse(self.stiffness):
            directions = scipy.sparse.csr_array(directions)
            return self.stiffness + directions @ scipy.sparse.diags_array(own) @ directions.T
        return self.stiffness + (directions * own) @ directions.T

    def modes(self, count: int = 6) -> Modes:
        """Frequencies (k,) and shapes (n, k) of unit modal mass, all joints stuck.

        Traced ones have derivatives where no other mode has the same frequency.
        """
        stuck, count = self.stuck_stiffness, min(count, self.size)
        if self.traced:
            omega, shapes = _traced_modes(stuck, jnp.asarray(self.mass), count)
            return Modes(omega / (2.0 * jnp.pi), shapes)
        if self.size <= DENSE or count >= self.size - 1:
            values, shapes = scipy.linalg.eigh(dense(stuck), dense(self.mass))
        else:
            stiffness, mass = (scipy.sparse.csc_array(a) for a in (stuck, self.mass))
            # A shift below zero, because the matrix is singular at a rigid-body mode.
            shift = -SYMMETRY_ROUNDING * abs(stuck).max() / abs(self.mass).max()
            values, shapes = scipy.sparse.linalg.eigsh(stiffness, count, mass, sigma=shift)
        order = np.argsort(values)[:count]
        return Modes(np.sqrt(np.maximum(values[order], 0.0)) / (2.0 * np.pi), shapes[:, order])

    def static_displacements(self, loads: Any) -> Any:
        """Static displacements (n, k) under loads (n, k), all joints stuck."""
        if self.traced:
            return jnp.linalg.solve(self.stuck_stiffness, loads)
        if self.size <= DENSE:
            return scipy.linalg.solve(dense(self.stuck_stiffness), loads, assume_a="pos")
        solver = scipy.sparse.linalg.splu(scipy.sparse.csc_array(self.stuck_stiffness))
        return solver.solve(loads)

    def within_reach(self, peaks: Any) -> Array:
        """True where joints are known at their largest displacements (..., joints)."""
        ends = [joint.reach for joint in self.joints]
        return jnp.abs(peaks) <= (1.0 + ROUNDING) * jnp.stack(ends) if ends else jnp.abs(peaks) >= 0

    def knows(self, peaks: Any, what: str) -> Any:
        """True where the joints are known at their largest displacements, (k,).

        Parameters
        ----------
        peaks : (k, joints) largest displacements
        what : words for what moves the joints

        Raises
        ------
        InputError
            for a displacement beyond the `Joint.reach`, unless it is traced
        """
        within = self.within_reach(peaks)
        if is_traced(within) or bool(jnp.all(within)):
            return jnp.all(within, axis=-1)
        peaks = np.asarray(peaks)
        place = int(np.argmin(np.all(np.asarray(within), axis=0)))
        joint, most = self.joints[place], float(np.nanmax(abs(peaks[:, place])))
        words = joint.unknown_at(most)
        raise InputError(f"{what} moves the joint of attachments[{place}] by {words}")

    def _check_modes(self) -> None:
        """Raise `InputError` for matrices with negative modes, or a rigid-body mode."""
        require("mass", self.mass.shape, _is_positive(self.mass), "must be positive definite")
        own = self._given_damping
        damped = _is_positive(own, SYMMETRY_ROUNDING) or not abs(own).max()
        fix = "must have no negative mode: it would feed energy into the structure"
        require("damping", own.shape, damped, fix)
        stable = _is_positive(self.stuck_stiffness, SYMMETRY_ROUNDING)
        fix = "has a negative mode with all joints stuck: the structure is unstable"
        require("stiffness", self.stiffness.shape, stable, fix)
        lowest = self.modes(1)
        scale = float(abs(self.stuck_stiffness).max() / abs(self.mass).max())
        held = lowest.omega[0] ** 2 > SYMMETRY_ROUNDING * scale
        most = int(np.argmax(abs(lowest.shapes[:, 0])))
        fix = f"leaves a rigid mode, in which degree of freedom {most} moves most: hold the "
        fix += "structure by a spring or a joint"
        require("stiffness", self.stiffness.shape, held, fix)


def _ratios(given: ArrayLike | None, size: int) -> Any:
    """Damping ratios (m,) of the lowest modes; raises `InputError`."""
    if given is None:
        return np.zeros(0)
    ratios = as_leaf(given, "damping_ratio", RATIOS)
    fits = ratios.ndim == 0 or (ratios.ndim == 1 and ratios.size <= size)
    require("damping_ratio", ratios.shape, fits, RATIOS)
    each = jnp.broadcast_to(ratios, (size,)) if ratios.ndim == 0 else ratios
    if is_traced(each):
        return each
    for ratio in np.asarray(each).tolist():
        require_number("damping_ratio", ratio, "must be a number from 0 to 1", -TINY, 1.0)
    return np.asarray(each, float)


def _traced_modes(stiffness: Array, mass: Array, count: int) -> tuple[Array, Array]:
    """Angular frequencies and shapes, whose derivatives are those of K phi = lambda M phi."""
    k, m = map(lax.stop_gradient, (stiffness, mass))
    lower = jnp.linalg.cholesky(m)
    half = solve_triangular(lower, k, lower=True)
    values, vectors = jnp.linalg.eigh(solve_triangular(lower, half.T, lower=True))
    shapes = solve_triangular(lower.T, vectors)

    def one(value: Array, shape: Array) -> tuple[Array, Array]:
        # A step of Newton's method leaves the values and brings the derivatives.
        moved, side = mass @ shape, m @ shape
        residual = stiffness @ shape - value * moved
        residual = jnp.append(residual, 0.5 * (1.0 - shape @ moved))
        edge = jnp.append(-side, 0.0)[None]
        matrix = jnp.vstack([jnp.hstack([k - value * m, -side[:, None]]), edge])
        step = jnp.linalg.solve(matrix, residual)
        return value - step[-1], shape - step[:-1]

    found, forms = jax.vmap(one, (0, 1), (0, 1))(values[:count], shapes[:, :count])
    return jnp.sqrt(found), forms


def _checked(name: str, matrix: Any, size: int | None = None) -> Any:
    """Matrix of floats, dense or sparse; raises `InputError`."""
    if is_traced(matrix):
        known: Any = as_leaf(matrix, name, SQUARE)
        square = known.ndim == 2 and known.shape[0] == known.shape[1]
        require(name, known.shape, square and size in (None, known.shape[0]), SQUARE)
        return known
    sparse = scipy.sparse.issparse(matrix)
    try:
        real = not np.iscomplexobj(matrix.data if sparse else matrix)
    except ValueError:  # rows of different length
        raise InputError(f"{name} = {shown(matrix)}: {SQUARE}") from None
    require(name, np.shape(matrix), real, "must be real: give its real part if the rest is zero")
    if sparse:
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


def _is_positive(matrix: Any, margin: float = 0.0) -> bool:
    """True if a symmetric matrix is positive definite, with a margin for rounding.

    Parameters
    ----------
    matrix : dense or sparse
    margin : part of the largest entry that is added to the diagonal first
    """
    raised = matrix + margin * abs(matrix).max() * scipy.sparse.eye_array(matrix.shape[0])
    if matrix.shape[0] <= DENSE:
        return bool(np.all(np.linalg.eigvalsh(np.asarray(dense(raised))) > 0.0))
    # Without row exchanges the signs of the pivots are those of the eigenvalues (Sylvester).
    symmetric = {"SymmetricMode": True, "Equil": False}
    order = "MMD_AT_PLUS_A"
    try:
        factors = scipy.sparse.linalg.splu(
            scipy.sparse.csc_array(raised), order, diag_pivot_thresh=0.0, options=symmetric
        )
    except RuntimeError:  # exactly singular
        return False
    kept = np.array_equal(factors.perm_r, factors.perm_c)
    return kept and bool(np.all(factors.U.diagonal() > 0.0))


def dense(matrix: Any) -> Any:
    """Matrix as a dense array."""
    return matrix.toarray() if scipy.sparse.issparse(matrix) else matrix

"""Pair of members on their common contact line: two condensed bodies take the form of one.

With q = (v, w) of the contact nodes of each member and the relative slip and lift g = q_1 - q_2,
the contact knows g alone.  The members' own movement is eliminated from the sum of their potentials
like any other field; without supports at the contact

    K = K_1 - K_1 (K_1 + K_2)^-1 K_1,    f = f_1 - K_1 (K_1 + K_2)^-1 f_1,

so that exact branches, events, slopes and networks of sliders hold for two members as they do for
one on a rigid base.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jax import Array

from jbeamshell.common.numbers_of import numbers_of, pad, put
from jbeamshell.contact_line.body import Elimination, Line, Unknown
from jbeamshell.mechanics.section_form import SectionForm
from jbeamshell.numerics.factors import inverse_cholesky

UNITS = np.array([1.0, -1.0])  # v and w of the member below, seen from above


class Pair(NamedTuple):
    """Movement of two members, found again from that of their contact.

    Attributes
    ----------
    form : energy of the section of the member below, seen from its contact face
    elimination : of the fields of the member below
    upper, lower : (2n, 2n + 2) v and w of each member's stations from the relative v and w, the end
        load and the pressure; those of the member below in its own frame.  Of `joined` the
        pressures are p ones, see `pressed`
    """

    form: SectionForm
    elimination: Elimination | Unknown
    upper: Array
    lower: Array

    def pressed(self, top: Array, bottom: Array) -> Pair:
        """Pair under pressures of some sizes that act as one.

        Parameters
        ----------
        top, bottom : sizes of the pressures on the upper and on the lower member
        """
        sizes = numbers_of(self, top).append(top, bottom)
        upper, lower = (as_one(moves, sizes) for moves in (self.upper, self.lower))
        below = self.elimination.pressed(bottom)
        return self._replace(elimination=below, upper=upper, lower=lower)

    def above(self, movement: Array) -> Array:
        """Movement of the member above and its loads, (steps, 2n + 2), from the pair's."""
        parts = movement @ self.upper.T, movement[:, -2:]
        return numbers_of(self, movement).concatenate(parts, axis=1)

    def below(self, movement: Array) -> Array:
        """Movement of the member below in its own frame and its loads, (steps, 2n + 2)."""
        loads = movement[:, -2:] * np.array([0.0, 1.0])
        parts = movement @ self.lower.T, loads
        return numbers_of(self, movement).concatenate(parts, axis=1)


def as_one(matrix: Array, sizes: Array) -> Array:
    """Matrix (rows, columns + 1) whose last columns (p) act as one, with some sizes (p,)."""
    others = matrix.shape[1] - sizes.size
    columns = matrix[:, :others], matrix[:, others:] @ sizes
    return numbers_of(matrix, sizes).column_stack(columns)


class Member(NamedTuple):
    """Member on the stations of the contact.

    Attributes
    ----------
    form : energy of its section
    line : the member on its contact line
    fixed : (2n,) True for v and w that a support holds
    """

    form: SectionForm
    line: Line
    fixed: np.ndarray


def joined(upper: Member, lower: Member) -> tuple[Pair, Array]:
    """Two members on their contact line.

    Returns
    -------
    pair : what finds both members again
    hessian : (2n+1+p, 2n+1+p) of the pair's potential in the relative v and w, the end load and
        the pressures, first those on the upper member
    """
    size, dtype = upper.fixed.size, upper.line.hessian.dtype
    on_top, below = (member.line.hessian.shape[0] - size - 1 for member in (upper, lower))
    xp, total, both = numbers_of(upper, lower), size + 1 + on_top + below, []
    # The pressures on the member below come after those on the one above.
    for member, own in ((upper, np.arange(on_top)), (lower, on_top + np.arange(below))):
        at = np.append(np.arange(size + 1), size + 1 + own)
        both.append(put(xp.zeros((total, total), dtype), np.ix_(at, at), member.line.hessian))
    sign = xp.asarray(np.append(np.tile(UNITS, size // 2), np.ones(total - size)), dtype)
    below_seen = both[1] * sign[:, None] * sign
    hessian, q_1, q_2 = together(both[0], below_seen, upper.fixed, lower.fixed)
    moves = q_1[:size], (sign[:, None] * q_2)[:size]
    return Pair(lower.form, lower.line.elimination, *moves), hessian


def with_shanks(hessian: Array, stiffness: Array, down: Array) -> Array:
    """Potential of `joined` with the shanks of its bolts, springs between the members along X.

    They are unloaded under the pressures alone, from where v counts.

    Parameters
    ----------
    hessian : (2n + 2, 2n + 2)
    stiffness : of all shanks together, force per width and length
    down : (n,) nodal forces of the pressure, in proportion to which it is spread
    """
    xp = numbers_of(hessian, stiffness, down)
    spread = xp.stack([stiffness * down / xp.sum(down), xp.zeros_like(down)], axis=1)
    return hessian + xp.diag(pad(spread.ravel(), (0, 2)))


def together(
    above: Array, below: Array, fixed_above: np.ndarray, fixed_below: np.ndarray
) -> tuple[Array, Array, Array]:
    """Potential of two bodies in their relative displacements g = q_1 - q_2.

    Parameters
    ----------
    above, below : (k + m, k + m) second derivatives in q of each body and in the loads of both
    fixed_above, fixed_below : (k,) True for displacements that a support holds

    Returns
    -------
    hessian : (k + m, k + m) in g and the loads
    q_1, q_2 : (k + m, k + m) displacements of each body and the loads from these
    """
    dtype, size = above.dtype, fixed_above.size
    xp, count = numbers_of(above, below), above.shape[0] - size
    # Both from the movement z of the body below and g: q_1 = z + g, q_2 = z, unless one is held.
    moves = xp.asarray(~(fixed_above | fixed_below), dtype)
    first = xp.asarray(~fixed_above, dtype)
    second = xp.asarray(np.where(fixed_above & ~fixed_below, -1.0, 0.0), dtype)

    def in_both(scales: Array, matrix: Array) -> Array:
        return scales[:, None] * matrix * scales

    on_z = in_both(moves, (above + below)[:size, :size]) + xp.diag(1.0 - moves)
    one, other = (xp.append(part, xp.ones(count, dtype)) for part in (first, second))
    mixed = moves[:, None] * (above[:size] * one + below[:size] * other)
    inverse = inverse_cholesky(on_z)
    reduced = inverse @ mixed
    hessian = in_both(one, above) + in_both(other, below) - reduced.T @ reduced
    z = -(inverse.T @ reduced) * moves[:, None]
    unit = np.eye(size, size + count, dtype=dtype)
    loads = np.eye(size + count, dtype=dtype)[size:]
    q_1 = xp.concatenate([z + first[:, None] * unit, loads])
    q_2 = xp.concatenate([z + second[:, None] * unit, loads])
    return hessian, q_1, q_2

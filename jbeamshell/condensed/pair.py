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

import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.condensed.body import Elimination, eliminate
from jbeamshell.mechanics.section_form import SectionForm, on_symmetry_plane
from jbeamshell.numerics.factors import inverse_cholesky

UNITS = np.array([1.0, -1.0])  # v and w of the member below, seen from above
OVERHANG = np.linspace(0.0, 1.0, 25) ** 2  # stations of an overhang, denser at the contact


class Pair(NamedTuple):
    """Movement of two members, found again from that of their contact.

    The movement of a member is v and w of all its N stations, those of an overhang among them.

    Attributes
    ----------
    form : energy of the section of the member below, seen from its contact face
    elimination : of the fields of the member below
    upper, lower : (2N, 2n + 2) movement of each member from the relative v and w, the end load and
        the pressure; that of the member below in its own frame
    """

    form: SectionForm
    elimination: Elimination
    upper: Array
    lower: Array

    def above(self, given: Array) -> Array:
        """Movement of the member above and its loads, (steps, 2N + 2), from the pair's."""
        return jnp.concatenate([given @ self.upper.T, given[:, -2:]], axis=1)

    def below(self, given: Array) -> Array:
        """Movement of the member below in its own frame and its loads, (steps, 2N + 2)."""
        loads = given[:, -2:] * np.array([0.0, 1.0])
        return jnp.concatenate([given @ self.lower.T, loads], axis=1)


class Member(NamedTuple):
    """Member on the stations of the contact, those of its overhang eliminated.

    Attributes
    ----------
    form : energy of its section
    elimination : of its fields at all N stations
    movement : (2N, 2n + 2) v and w of all stations from those of the contact, load and pressure
    hessian : (2n + 2, 2n + 2) of its potential in v and w of the contact, load and pressure
    fixed : (2n,) True for v and w of the contact that a support holds
    """

    form: SectionForm
    elimination: Elimination
    movement: Array
    hessian: Array
    fixed: np.ndarray


class Supports(NamedTuple):
    """Fields that are zero at both ends of a member, (m,) each, and w along it.

    Attributes
    ----------
    far, loaded : (m,) True for held fields at X = 0 and at X = L
    flat : True if w is held everywhere
    """

    far: np.ndarray
    loaded: np.ndarray
    flat: bool = False

    def fixed(self, nodes: int) -> np.ndarray:
        """True for held v and w of the stations, (2 nodes,)."""
        held = np.zeros((nodes, 2), bool)
        held[0], held[-1] = self.far[:2], self.loaded[:2]
        held[:, 1] |= self.flat
        return held.ravel()


def upper_member(
    form: SectionForm, x: Array, overhang: Array | None, down: Array, guided: bool
) -> Member:
    """Member that is pulled at X = L, or at the end of its overhang beyond.

    Parameters
    ----------
    form : energy of its section
    x : (n,) stations of the contact
    overhang : length of the overhang; None is none
    down : (n,) nodal forces of the pressure on its outer face
    guided : True if its loaded end keeps its height
    """
    none = np.zeros_like(form.held)
    supports = Supports(none, ~form.held if guided else none)
    beyond = None if overhang is None else x[-1] + overhang * OVERHANG[1:]
    return member(form, x, (None, beyond), down, supports)


def lower_member(
    form: SectionForm, x: Array, overhang: Array | None, up: Array, clamped: bool
) -> Member:
    """Member that is held at X = 0, or at the end of its overhang before; see `upper_member`.

    It is clamped there, or held along X and on a symmetry plane with its outer face.
    """
    form = form._replace(pull=jnp.zeros_like(form.pull))  # the load acts above
    flat = not clamped and form.top == 0  # what cannot be squeezed keeps its height
    form = form if clamped else on_symmetry_plane(form)
    supports = Supports(form.held | clamped, np.zeros_like(form.held), flat)
    before = None if overhang is None else x[0] - overhang * OVERHANG[:0:-1]
    return member(form, x, (before, None), up, supports)


def member(
    form: SectionForm,
    x: Array,
    overhangs: tuple[Array | None, Array | None],
    loads: Array,
    supports: Supports,
) -> Member:
    """Member of a form on the stations of the contact and on those before and after."""
    before, after = (0 if part is None else part.size for part in overhangs)
    n = x.size
    stations = jnp.concatenate(
        [part for part in (overhangs[0], x, overhangs[1]) if part is not None]
    )
    loads = jnp.pad(loads, (before, after))
    elimination, hessian = eliminate(form, stations, loads, (supports.far, supports.loaded))
    fixed = supports.fixed(stations.size)
    inside = np.zeros(fixed.size + 2, bool)
    inside[2 * before : 2 * (before + n)] = inside[-2:] = True
    kept, gone = np.flatnonzero(inside), np.flatnonzero(~inside & ~np.append(fixed, [True, True]))
    movement = jnp.eye(2 * n + 2, dtype=x.dtype)[:-2]
    movement = jnp.pad(movement, ((2 * before, 2 * after), (0, 0)))
    left = hessian[np.ix_(kept, kept)]
    if gone.size:
        inverse = inverse_cholesky(hessian[np.ix_(gone, gone)])
        reduced = inverse @ hessian[np.ix_(gone, kept)]
        movement = movement.at[gone].set(-(inverse.T @ reduced))
        left = left - reduced.T @ reduced
    return Member(form, elimination, movement, left, fixed[kept[:-2]])


def joined(upper: Member, lower: Member) -> tuple[Pair, Array]:
    """Two members on their contact line.

    Returns
    -------
    pair : what finds both members again
    hessian : (2n + 2, 2n + 2) of the pair's potential in the relative v and w, load and pressure
    """
    sign = jnp.append(jnp.tile(jnp.asarray(UNITS), upper.fixed.size // 2), jnp.ones(2))
    below = lower.hessian * sign[:, None] * sign
    hessian, q_1, q_2 = together(upper.hessian, below, upper.fixed, lower.fixed)
    moves = upper.movement @ q_1, lower.movement @ (sign[:, None] * q_2)
    return Pair(lower.form, lower.elimination, *moves), hessian


def over_gap(pair: Pair, hessian: Array, gap: Array) -> tuple[Pair, Array]:
    """Pair and potential in the opening w + g_0 instead of the relative lift w.

    Parameters
    ----------
    pair, hessian : see `joined`
    gap : (n,) distance g_0 of the members before anything presses
    """
    shift = jnp.stack([jnp.zeros_like(gap), -gap], axis=1).ravel()
    change = jnp.eye(shift.size + 2, dtype=gap.dtype).at[:-2, -1].add(shift)
    moved = pair._replace(upper=pair.upper @ change, lower=pair.lower @ change)
    return moved, change.T @ hessian @ change


def with_shanks(hessian: Array, stiffness: Array, down: Array, settled: Array) -> Array:
    """Potential of `joined` with the shanks of its bolts, springs between the members along X.

    Parameters
    ----------
    hessian : (2n + 2, 2n + 2)
    stiffness : of all shanks together, force per width and length
    down : (n,) nodal forces of the pressure, in proportion to which it is spread
    settled : (n,) tangential displacements under the pressure, at which the shanks are unloaded
    """
    n = down.size
    slip = jnp.eye(2 * n, 2 * n + 2, dtype=hessian.dtype)[::2].at[:, -1].add(-settled)
    return hessian + slip.T @ ((stiffness * down / jnp.sum(down))[:, None] * slip)


def together(
    above: Array, below: Array, fixed_above: np.ndarray, fixed_below: np.ndarray
) -> tuple[Array, Array, Array]:
    """Potential of two bodies in their relative displacements g = q_1 - q_2.

    Parameters
    ----------
    above, below : (2n + 2, 2n + 2) second derivatives in q of each body, end load and pressure
    fixed_above, fixed_below : (2n,) True for displacements that a support holds

    Returns
    -------
    hessian : (2n + 2, 2n + 2) in g, end load and pressure
    q_1, q_2 : (2n + 2, 2n + 2) displacements of each body and the loads from these
    """
    dtype, size = above.dtype, fixed_above.size
    # Both from the movement z of the body below and g: q_1 = z + g, q_2 = z, unless one is held.
    moves = jnp.asarray(~(fixed_above | fixed_below), dtype)
    first = jnp.asarray(~fixed_above, dtype)
    second = jnp.asarray(np.where(fixed_above & ~fixed_below, -1.0, 0.0), dtype)

    def in_both(scales: Array, both: Array) -> Array:
        return scales[:, None] * both * scales

    on_z = in_both(moves, (above + below)[:-2, :-2]) + jnp.diag(1.0 - moves)
    one, other = (jnp.append(part, jnp.ones(2)) for part in (first, second))
    mixed = moves[:, None] * (above[:-2] * one + below[:-2] * other)
    inverse = inverse_cholesky(on_z)
    reduced = inverse @ mixed
    hessian = in_both(one, above) + in_both(other, below) - reduced.T @ reduced
    z = -(inverse.T @ reduced) * moves[:, None]
    given = jnp.eye(size, size + 2, dtype=dtype)
    loads = jnp.eye(size + 2, dtype=dtype)[-2:]
    q_1 = jnp.concatenate([z + first[:, None] * given, loads])
    q_2 = jnp.concatenate([z + second[:, None] * given, loads])
    return hessian, q_1, q_2

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


class Pair(NamedTuple):
    """What finds the movement of two members again from that of their contact.

    Attributes
    ----------
    form : energy of the section of the member below, seen from its contact face
    elimination : of the fields of the member below
    upper, lower : (2n, 2n + 2) v and w of each member's contact nodes from the relative v and w,
        the end load and the pressure; those of the member below in the frame of the one above
    """

    form: SectionForm
    elimination: Elimination
    upper: Array
    lower: Array

    def above(self, given: Array) -> Array:
        """What the member above is given, (steps, 2n + 2), from what the pair is given."""
        return jnp.concatenate([given @ self.upper.T, given[:, -2:]], axis=1)

    def below(self, given: Array) -> Array:
        """What the member below is given, (steps, 2n + 2), in its own frame."""
        own = given @ self.lower.T * jnp.tile(UNITS, self.lower.shape[0] // 2)
        return jnp.concatenate([own, jnp.zeros_like(given[:, :1]), given[:, -1:]], axis=1)


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

    def contact(self, nodes: int) -> np.ndarray:
        """True for held v and w of the contact nodes, (2 nodes,)."""
        held = np.zeros((nodes, 2), bool)
        held[0], held[-1] = self.far[:2], self.loaded[:2]
        held[:, 1] |= self.flat
        return held.ravel()


def supports_of(form: SectionForm, guided: bool) -> Supports:
    """Supports of the member above: none, or no deflection at the loaded end."""
    none = np.zeros_like(form.held)
    return Supports(none, ~form.held if guided else none)


def supports_below(form: SectionForm, clamped: bool) -> Supports:
    """Supports of the member below at X = 0; one that rolls and cannot be squeezed stays flat."""
    none = np.zeros_like(form.held)
    return Supports(form.held | clamped, none, flat=not clamped and form.top == 0)


def joined(
    above: Array,
    forms: tuple[SectionForm, SectionForm],
    x: Array,
    up: Array,
    guided: bool,
    clamped: bool,
) -> tuple[Pair, Array]:
    """Two members on their contact line.

    Parameters
    ----------
    above : (2n + 2, 2n + 2) second derivatives of the potential of the member above, see
        `jbeamshell.condensed.body.eliminate`
    forms : energies of the sections above and below
    x : (n,) stations of both
    up : (n,) nodal forces of the pressure on the bottom face of the member below
    guided, clamped : supports, see `supports_of` and `supports_below`

    Returns
    -------
    pair : what finds both members again
    hessian : (2n + 2, 2n + 2) of the pair's potential in the relative v and w, load and pressure
    """
    form = forms[1]._replace(pull=jnp.zeros_like(forms[1].pull))  # the load acts above
    held = supports_below(form, clamped)
    if not clamped:
        form = on_symmetry_plane(form)
        held = supports_below(form, clamped)._replace(flat=held.flat)
    elimination, below = eliminate(form, x, up, (held.far, held.loaded))
    n = x.size
    sign = jnp.append(jnp.tile(jnp.asarray(UNITS), n), jnp.ones(2))
    below = below * sign[:, None] * sign
    fixed = supports_of(forms[0], guided).contact(n), held.contact(n)
    # Both from the movement z of the member below and g: q_1 = z + g, q_2 = z, unless one is held.
    moves = jnp.asarray(~(fixed[0] | fixed[1]), x.dtype)
    first = jnp.asarray(~fixed[0], x.dtype)
    second = jnp.where(fixed[0] & ~fixed[1], -1.0, 0.0)

    def in_both(scales: Array, both: Array) -> Array:
        return scales[:, None] * both * scales

    on_z = in_both(moves, (above + below)[:-2, :-2]) + jnp.diag(1.0 - moves)
    one, other = (jnp.append(part, jnp.ones(2)) for part in (first, second))
    mixed = moves[:, None] * (above[:-2] * one + below[:-2] * other)
    inverse = inverse_cholesky(on_z)
    reduced = inverse @ mixed
    hessian = in_both(one, above) + in_both(other, below) - reduced.T @ reduced
    z = -(inverse.T @ reduced) * moves[:, None]
    given = jnp.eye(2 * n, 2 * n + 2)
    pair = Pair(form, elimination, z + first[:, None] * given, z + second[:, None] * given)
    return pair, hessian

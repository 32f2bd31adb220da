r"""Ends of a member: how a force enters its end section, and what goes on beyond it.

The end section of a member moves along X by u_x(y), with y - m the height over its middle:

| condition | u_x | a section that has it |
|---|---|---|
| ``free`` | any | under an even traction, or one that is linear in y |
| ``face`` | a - (y - m) b | on a rigid face, which may turn |
| ``guided`` | a | on a rigid face that may not turn |
| ``held`` | 0 | on a rigid face at rest |

A length beyond the contact is eliminated element by element, from its outer end inwards.  It leaves
a stiffness of the section where it begins, the part of each field in the displacement u that the
load moves through, and a compliance.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from jax import Array

from jbeamshell.common.numbers_of import numbers_of, scan
from jbeamshell.mechanics.section_form import SectionForm
from jbeamshell.numerics.factors import inverse_cholesky, solve

DOUBLINGS = 5  # of the outermost element of a length beyond

Condition = Literal["free", "face", "guided", "held"]
Three = tuple[Array, Array, Array]


class End(NamedTuple):
    """End section of a member, whose m fields are ``span`` times k free numbers.

    Attributes
    ----------
    span : (m, k); on a contact the first two numbers are v and w, and a support may hold these
    stiffness : (m, m) of the length beyond
    pull : (m,) parts of the fields in u
    softness : part of u for each unit of load, beside that of the fields
    """

    span: Array
    stiffness: Array
    pull: Array
    softness: Array

    def shorter(self, softness: Array) -> End:
        """End whose displacement leaves out a compliance."""
        return self._replace(softness=self.softness - softness)

    def among(self, moving: np.ndarray) -> End:
        """End of a section that has more fields, of which those that are True (m,) move here."""
        whole = numbers_of(self.pull).eye(moving.size, dtype=self.pull.dtype)
        fields = whole[:, moving]
        stiffness, pull = fields @ self.stiffness @ fields.T, fields @ self.pull
        return self._replace(span=whole, stiffness=stiffness, pull=pull)


def end_section(
    form: SectionForm, along: Condition = "free", level: bool = False, on_contact: bool = True
) -> End:
    """End section of a member without a length beyond.

    Parameters
    ----------
    form : energy of the section
    along : condition along X
    level : True if it keeps its height everywhere
    on_contact : False for the outer end of a length beyond the contact
    """
    xp, size, dtype = numbers_of(form.pull), form.pull.size, form.pull.dtype
    unit = xp.eye(size, dtype=dtype)
    shift, turn = form.modes[0, 1], form.modes[2, 1]  # fields that are a unit strain as slopes
    columns: list[Array] = []
    if along in ("face", "guided"):
        columns.append(shift)
    elif along == "free" or on_contact:
        columns.append(unit[0])
    if on_contact or not level:
        columns.append(unit[1])
    if along == "face" and size > 2:  # v and w alone do not turn
        columns.append(turn - turn[0] * shift)
    places = np.arange(size)
    kept = (form.held & (along == "free")) | (~form.held & (not level))
    columns += [unit[place] for place in places[kept & (places > 1)]]
    span = xp.stack(columns, axis=1) if columns else xp.zeros((size, 0), dtype)
    return End(span, xp.zeros((size, size), dtype), form.pull, xp.zeros((), dtype))


def beyond(form: SectionForm, lengths: Array, outer: End, forwards: bool) -> End:
    """End section where a length without contact begins.

    Parameters
    ----------
    form : energy of the section
    lengths : (k,) of the elements beyond, the nearest first; the last one stands for many
    outer : outer end
    forwards : True if the length goes on towards greater X
    """
    near, far, between = _long(form, lengths[-1], forwards)
    first = near, 0.0 * outer.pull, outer.softness
    if outer.span.shape[1]:  # something moves there
        inverse = inverse_cholesky(outer.span.T @ (far + outer.stiffness) @ outer.span)
        onto, moved = inverse @ (outer.span.T @ between), inverse @ (outer.span.T @ outer.pull)
        first = near - onto.T @ onto, -onto.T @ moved, outer.softness + moved @ moved

    def inwards(now: Three, element: Three) -> tuple[Three, None]:
        stiffness, pull, softness = now  # of the far section; unknown are the steps to it
        length, start, end = element
        stays, follows = form.moved(length)
        far, step = (end, follows.T) if forwards else (start, stays.T)
        inverse = inverse_cholesky(far + stiffness)
        onto, moved = inverse @ (step + stiffness), inverse @ pull
        left = stays + follows + stiffness - onto.T @ onto
        return (left, pull - onto.T @ moved, softness + moved @ moved), None

    others = lengths[:-1], *form.element(lengths[:-1])[:2]
    (stiffness, pull, softness), _ = scan(inwards, first, others, reverse=True)
    return end_section(form)._replace(stiffness=stiffness, pull=pull, softness=softness)


def _long(form: SectionForm, length: Array, forwards: bool) -> Three:
    """Stiffness (m, m) of the near, of the far end and from far to near, of many equal elements."""
    start, end, across = (part[0] for part in form.element(length[None] / 2**DOUBLINGS))

    def doubled(element: Three, _: Array) -> tuple[Three, None]:
        start, end, across = element
        inverse = inverse_cholesky(end + start)
        before, after = inverse @ across.T, inverse @ across
        return (start - before.T @ before, end - after.T @ after, -before.T @ after), None

    (start, end, across), _ = scan(doubled, (start, end, across), np.arange(DOUBLINGS))
    return (start, end, across.T) if forwards else (end, start, across)


def compliance(form: SectionForm, pull: Array, bends: bool = True, on_plane: bool = False) -> Array:
    """Displacement for each unit of load and of length of a member under an even load.

    The strains e and k are the same everywhere, and the section squeezes and warps as it likes.

    Parameters
    ----------
    form : energy of the section
    pull : (m,) parts of the fields in the displacement that the load moves through
    bends : False if the member stays straight
    on_plane : True if its top rolls on a symmetry plane, so that w is no rigid motion
    """
    strains = form.modes[:3:2, 1]
    free = slice(1 if on_plane else 2, None)  # v, and mostly w, are rigid motions
    mixed = (strains @ form.mixed.T)[:, free]
    stiffness = strains @ form.slopes @ strains.T - mixed @ solve(form.values[free, free], mixed.T)
    parts = strains @ pull
    if not bends:
        return parts[0] ** 2 / stiffness[0, 0]
    return parts @ solve(stiffness, parts)

"""How the force enters a scene's members, and how it leaves them: the conditions of their ends.

A member that goes on beyond the contact is continued by `REACH` half heights, from where on its
length no longer matters, unless a support beside the load bends it, see
`jbeamshell.scene.mounting`.  It stretches there under an even load.  That stretch, l/(E'2H) for a
force at mid-height, is left out of the displacement u, which stays conjugate to the load: its loop
holds the energy that friction takes.  So u is the mean displacement of the section X = L, but for
what the shear there does on an even stretch.  That is less than half a per cent of u, but a fifth
of the loop where little slips.

Members that go on are pressed first and mounted then: the pressures act on members that end with
the contact and whose ends are free.  What lies beyond is tied to them without stress.  Else the
edge of a base would press into a member that goes on, an even pressure would have a singular
reaction there, and nothing would slip at small loads.

Sections that stay straight (the beamshell) have a rigid face at X = L by nature.  They are
nearer to a member that goes on as they are than if they were continued.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jax import Array

from jbeamshell.common.numbers_of import numbers_of
from jbeamshell.contact_line.ends import Condition, End, beyond, compliance, end_section
from jbeamshell.mechanics import elements
from jbeamshell.mechanics.section_form import SectionForm, W, without_lift
from jbeamshell.scene.mounting import REACH, goes_on
from jbeamshell.scene.scene import Scene

PER_REACH = 1.0 / 6.0  # of the elements of the contact, in that length
LEAST = 24  # elements there, on 49 nodes a fourth of the error of 8 where little slips
END_SIZE = 1e-4  # of H, smallest element, beside the contact
GROWTH = 0.3  # of the element size over the distance from there
FREE = np.zeros(2, bool)


class Held(NamedTuple):
    """End of a member, and True for v and w (2,) of its contact that a support holds there."""

    end: End
    fixed: np.ndarray


def states(scene: Scene) -> tuple[bool, ...]:
    """True for members as they are mounted, after False for members that are only pressed.

    One state serves both where the ends are the same.
    """
    joint = scene.member.support != "none"
    apart = joint or scene.strip.overhang is not None or goes_on(scene)
    return (False, True) if apart and scene.load.entry == "member" else (True,)


def loaded_end(scene: Scene, form: SectionForm, mounted: bool) -> Held:
    """End of the strip at which the force enters.

    Parameters
    ----------
    form : energy of the strip's section, whose ``pull`` is that of the load
    mounted : see `states`
    """
    strip, entry = scene.strip, scene.load.entry
    level = scene.member.loaded_end == "level"
    along: Condition = entry if entry in ("face", "guided") else "free"  # type: ignore[assignment]
    if not mounted:
        return Held(end_section(form), FREE)
    if strip.overhang is not None:
        outer = end_section(form, along, level, on_contact=False)
        lengths = _lengths(strip.overhang, strip.half_height, LEAST)
        return Held(beyond(form, lengths, outer, True), FREE)
    if goes_on(scene):
        outer, reach = end_section(form, level=level, on_contact=False), REACH * strip.half_height
        lengths = _lengths(reach, strip.half_height, _count(scene))
        stretch = reach * compliance(form, form.pull, bends=not level)
        return Held(beyond(form, lengths, outer, True).shorter(stretch), FREE)
    return Held(end_section(form, along, level), np.array([False, level]))


def far_end(scene: Scene, form: SectionForm) -> End:
    """End of a strip on a rigid base at X = 0; v of its contact is left to the caller."""
    return end_section(form, "held" if scene.strip.far_end == "guided" else "free")


def leaving_end(
    scene: Scene, form: SectionForm, pull: Array, flat: bool, mounted: bool
) -> tuple[Held, Array]:
    """End of the second member of a lap joint at which the force leaves.

    Parameters
    ----------
    form : energy of its section
    pull : (m,) parts of its fields in the displacement of a rigid extension to the line of the load
    flat : True if its w is zero everywhere
    mounted : see `states`; a member that is not mounted keeps its place at X = 0

    Returns
    -------
    held : conditions at X = 0
    stretch : compliance of the length beyond that the joint's displacement leaves out
    """
    member, clamped = scene.member, scene.member.support == "clamped"
    half_height = member.beside(scene.strip).half_height
    stretch = 0.0 * half_height
    if not mounted:
        return Held(end_section(form), np.array([True, clamped])), stretch
    if member.overhang is not None:
        lengths = _lengths(member.overhang, half_height, LEAST)
    elif goes_on(scene):
        reach, bends = REACH * half_height, clamped and scene.member.loaded_end == "free"
        lengths = _lengths(reach, half_height, _count(scene))
        stretch = reach * compliance(form, pull, bends, on_plane=not clamped and not flat)
    else:
        return Held(end_section(form, "held", clamped), np.array([True, clamped])), stretch
    moving = without_lift(form) if flat else form
    outer = end_section(moving, "held", clamped or flat, on_contact=False)
    end = beyond(moving, lengths, outer, False)
    if flat:
        end = end.among(np.arange(form.pull.size) != W)
    return Held(end, FREE), stretch


def _count(scene: Scene) -> int:
    """Number of elements of a length beyond that is not given."""
    return max(LEAST, round(PER_REACH * (scene.plan.nodes - 1)))


def _lengths(length: Array, half_height: Array, count: int) -> Array:
    """Lengths (count,) of the elements beyond the contact, which grow from there on."""
    near = length * REACH * half_height / (length + REACH * half_height)
    grading = END_SIZE, None, GROWTH, 1.0, GROWTH
    graded, xp = elements.vertices(count - 1, near, half_height, *grading), numbers_of(near)
    return xp.append(xp.diff(graded)[::-1], length - near)

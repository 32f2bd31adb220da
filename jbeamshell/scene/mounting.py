"""Mounting of a lap joint: where it is held and loaded, in words, and what its scene leaves open.

The eccentric pull of a single lap bends both members.  A loaded end that keeps its height takes
the less of that moment, the longer the joint is between its supports: the lengths beyond the
contact decide the energy that it loses.  A single lap whose loaded end may deflect is statically
determinate, and these lengths change nothing.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from jbeamshell.common.checks import is_traced
from jbeamshell.scene.linearisation import Parts

OVERHANGS = ("member.overhang", "strip.overhang")  # before X = 0, and beyond X = L
REACH = 2.0  # of H, length beyond the contact of members that go on by a length that is not given
KINDS = {"rolling": "double shear, its middle on a symmetry plane", "clamped": "single lap"}


def in_words(scene: Parts, varied: Collection[str] = ()) -> str:
    """Line that says how a lap joint is held and loaded; empty for a strip on a base.

    Parameters
    ----------
    scene : scene, which may be traced
    varied : dotted keys whose numbers are many, as those of a sweep
    """
    support, end = scene.member.support, scene.member.loaded_end
    if support == "none":
        return ""
    held, loaded = (_place(scene, key, key in varied) for key in OVERHANGS)
    height = "keeps its height" if end == "level" else "may deflect"
    turns = "does not turn" if scene.load.entry == "guided" else "may turn"
    both = support == "rolling" and scene.strip.width is not None
    decides = any(key not in varied for key in left_open(scene))
    return (
        f"{KINDS[support]}: held {held}, loaded {loaded} (load.entry = {scene.load.entry}); "
        f"the loaded end {height} (member.loaded_end = {end}) and {turns}"
        + "; forces and works are those of both halves" * both
        + "; overhangs change what it loses" * decides
    )


def left_open(scene: Parts) -> tuple[str, ...]:
    """Overhangs that decide how a single lap bends, and that its scene leaves open.

    Members that end with the overlap (``load.entry`` face, guided or traction) leave none open.
    """
    member, load = scene.member, scene.load
    bends = member.support == "clamped" and member.loaded_end == "level"
    if not bends or load.entry != "member" or load.cycles == 0:
        return ()
    return tuple(key for key in OVERHANGS if overhang(scene, key) is None)


def goes_on(scene: Parts) -> bool:
    """True if members go on beyond the contact by a length that is not given.

    Sections that stay straight end with it: they are a rigid face by nature.
    """
    return scene.load.entry == "member" and scene.plan.elastic


def overhang(scene: Parts, key: str) -> object:
    """Overhang of a scene by its dotted key; None if it is not given."""
    heading, name = key.split(".")
    return getattr(getattr(scene, heading), name)


def _place(scene: Parts, key: str, varied: bool) -> str:
    """Words for the place at which a joint is held, or loaded."""
    length, far = overhang(scene, key), key == "member.overhang"
    end = "X = 0" if far else "X = L"
    if length is None:
        if not goes_on(scene):
            return f"at {end}"
        return f"{REACH:g} H {'before' if far else 'beyond'} {end}, with no {key}"
    size = "varied" if varied else "traced" if is_traced(length) else f"{np.asarray(length):g}"
    return f"at the end of {key} = {size}"

"""Strips of plane elasticity that were condensed, kept for scenes that share them.

A condensed strip depends on the strip, its supports, its pressures, the entry of the force and the
grid.  Friction and the size of the load do not touch it, unless the strip is pressed with friction.
What takes the time to condense does not depend on the sizes of the pressures either.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from jbeamshell.common.checks import is_staged, is_traced
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.template import Template

MOST = 8  # strips that are kept; one of plane elasticity holds some ten megabytes

Build = Callable[[Scene], Any]


def kept(build: Build, same: Callable[[Scene], Scene]) -> Build:
    """Function of a scene that keeps what it built for the last strips of plane elasticity.

    Parameters
    ----------
    build : function from a scene to its condensed strip
    same : function from a scene to one that stands for all of the same strip, such as `alike`
    """

    @functools.lru_cache(MOST)
    def of_template(template: Template, numbers: bytes) -> Any:
        values = np.frombuffer(numbers, template.dtype)
        return build(template.scene([np.asarray(value) for value in values]))

    @functools.wraps(build)
    def strip_of(scene: Scene) -> Any:
        if not scene.plan.elastic or is_staged() or is_traced(scene):
            return build(scene)
        template, numbers = Template.of(same(scene))
        return of_template(template, np.asarray(numbers, template.dtype).tobytes())

    return strip_of


def alike(scene: Scene) -> Scene:
    """One scene for all that share a condensed strip, whose grid no further change decides."""
    scene, none = scene.pinned().in_one_form(), np.zeros_like(scene.load.amplitude)
    load = scene.load.but(amplitude=none, cycles=1, steps_per_half_cycle=1)
    model, contact = scene.model.but(tolerance=1.0), scene.contact
    if scene.member.assembly != "frictional":
        contact = contact.but(friction=none)
    return scene.but(load=load, contact=contact, model=model, plan=scene.plan._replace(steps=1))


def alike_but_pressures(scene: Scene) -> Scene:
    """One scene for all that share a strip condensed for pressures of any size."""
    scene = alike(scene)
    contact, none = scene.contact, np.zeros_like(scene.load.amplitude)
    top, bottom = (_of_size_one(face) for face in (contact.pressure, contact.bottom_pressure))
    contact = contact.but(friction=none, pressure=top, bottom_pressure=bottom)
    return scene.but(contact=contact)


def _of_size_one(pressure: Any) -> Any:
    """Pressure whose rows have the size 1, in the same places."""
    values = np.array(pressure)
    if values.ndim:
        values[:, 1] = 1.0
        return values
    return np.ones_like(values)

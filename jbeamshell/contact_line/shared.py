"""Strips that many scenes share, so that none of them is condensed again.

Where scenes differ in load and friction alone they have one strip.  Where they differ in height,
Poisson's ratio, stiffness, length or pressure as well, their bodies are interpolated.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import jax
import numpy as np
from jax import Array

from jbeamshell.common.apart import apart
from jbeamshell.common.checks import is_traced
from jbeamshell.common.precision import doubled
from jbeamshell.common.threads import on_one_core
from jbeamshell.contact_line.interpolation import (
    HEIGHT,
    POISSON,
    Bodies,
    Range,
    built,
    may_be_interpolated,
)
from jbeamshell.contact_line.kept import alike
from jbeamshell.contact_line.solve import strip_of
from jbeamshell.contact_line.strip import Strip
from jbeamshell.history.history import FIGURES
from jbeamshell.scene.keys import WIDTH_OF_ALL
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.template import Template

LOADS = frozenset({"load.amplitude", "contact.friction"})
SCALES = frozenset({"contact.pressure", "strip.length", "strip.axial_stiffness", WIDTH_OF_ALL})
HEIGHTS = frozenset({HEIGHT, "strip.half_height"})
OF_CONTACT = frozenset({*FIGURES, "dissipation_error", "force", "displacement", "status"})
"""Figures that need no field above the contact."""
USUAL_HEIGHTS = 0.02, 0.8  # that are interpolated where no range is known
AROUND = 1.5  # times a scene's own height, which the range includes
KEPT = 8  # shared strips that are kept

R = TypeVar("R")


class Layout(NamedTuple):
    """Structure of a strip or of bodies whose numbers are one array."""

    tree: Any
    leaves: tuple[tuple[tuple[int, ...], str], ...]

    def strip(self, numbers: Array, scene: Scene) -> Strip:
        """Strip of a scene, of numbers that may be traced."""
        leaves, begin = [], 0
        for shape, dtype in self.leaves:
            end = begin + int(np.prod(shape))
            leaf = numbers[begin:end].reshape(shape)
            leaves.append(leaf.astype(dtype) if dtype == "bool" else leaf)
            begin = end
        shared = jax.tree.unflatten(self.tree, leaves)
        return shared.strip(scene) if isinstance(shared, Bodies) else shared


class Shared(NamedTuple):
    """Strips of scenes that differ in some numbers.

    Attributes
    ----------
    numbers : all numbers of a strip or of bodies, one array on the processor: few arrays are quick
        to hand over, and those of NumPy would be copied at each call
    layout : what they are
    heights : height ratios for which they hold; None for all
    """

    numbers: Array
    layout: Layout
    heights: Range | None

    @classmethod
    def of(cls, strips: Strip | Bodies, heights: Range | None, dtype: Any) -> Shared:
        leaves, tree = jax.tree.flatten(strips)
        arrays = [np.asarray(leaf) for leaf in leaves]
        kinds = tuple((a.shape, "bool" if a.dtype == bool else "number") for a in arrays)
        numbers = jax.device_put(np.concatenate([a.ravel().astype(dtype) for a in arrays]))
        return cls(numbers, Layout(tree, kinds), heights)

    def holds(self, scene: Scene, over: Sequence[str], values: Sequence[Any]) -> bool:
        """True if the strips hold for the scene with these values of the numbers that vary."""
        if self.heights is None:
            return True
        numbers = {key: float(value) for key, value in zip(over, values, strict=True)}
        return self.heights[0] <= float(scene.number(HEIGHT, numbers)) <= self.heights[1]


def shares(
    scene: Scene,
    over: Sequence[str],
    figures: Sequence[str],
    ranges: Mapping[str, Range] | None = None,
) -> bool:
    """True if scenes that differ in some numbers share strips, see `shared`."""
    if not scene.plan.on_contact_line or not OF_CONTACT.issuperset(figures) or is_traced(scene):
        return False
    vary = set(over)
    if vary <= LOADS:
        return scene.member.assembly != "frictional" or "contact.friction" not in vary
    known = ranges is not None or POISSON not in vary
    return known and may_be_interpolated(scene) and vary <= LOADS | SCALES | HEIGHTS | {POISSON}


def shared(
    scene: Scene,
    over: Sequence[str],
    figures: Sequence[str],
    ranges: Mapping[str, Range] | None = None,
) -> Shared | None:
    """Strips of scenes that differ in some numbers, or None if each must be condensed.

    Parameters
    ----------
    scene : scene on its contact line with all other numbers
    over : dotted keys of the numbers that vary
    figures : names of `jbeamshell.History` that are asked for
    ranges : least and most height ratio and Poisson's ratio, by key; None is not known
    """
    if not shares(scene, over, figures, ranges):
        return None
    vary, strip = set(over), scene.strip
    if vary <= LOADS:
        return _of_one(*_numbers(scene))
    assert strip.poisson_ratio is not None
    height, ratio = float(strip.height_ratio), float(strip.poisson_ratio)
    usual = min(USUAL_HEIGHTS[0], height / AROUND), max(USUAL_HEIGHTS[1], height * AROUND)
    varies = vary & HEIGHTS or (strip.derives(HEIGHT) and "strip.length" in vary)
    ends = {HEIGHT: usual if varies else (height, height), POISSON: (ratio, ratio)}
    ends |= dict(ranges or {})
    return _interpolated(*_numbers(scene), ends[HEIGHT], ends[POISSON])


def _numbers(scene: Scene) -> tuple[Template, bytes]:
    template, numbers = Template.of(alike(scene))
    return template, np.asarray(numbers, template.dtype).tobytes()


def _scene(template: Template, numbers: bytes) -> Scene:
    values = np.frombuffer(numbers, template.dtype)
    return doubled(template.scene([np.asarray(value) for value in values]))


@functools.lru_cache(KEPT)
def _of_one(template: Template, numbers: bytes) -> Shared:
    def build() -> Shared:
        return Shared.of(strip_of(_scene(template, numbers)).of_contact, None, template.dtype)

    return _built(build)


@functools.lru_cache(KEPT)
def _interpolated(
    template: Template, numbers: bytes, heights: Range, poisson_ratios: Range
) -> Shared | None:
    def build() -> Shared | None:
        bodies = built(_scene(template, numbers), heights, poisson_ratios)
        return None if bodies is None else Shared.of(bodies, heights, template.dtype)

    return _built(build)


def _built(build: Callable[[], R]) -> R:
    """Result of a function in double precision, also while another function is traced."""

    @on_one_core
    def precise() -> R:
        with jax.enable_x64(True):
            return build()

    return apart(precise)

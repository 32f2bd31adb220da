"""What a sweep varies: axes into lanes, which of them the model knows, and how hard they are."""

from __future__ import annotations

import dataclasses
import enum
import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import ArrayLike

from jbeamshell.common.checks import as_leaf, require
from jbeamshell.common.errors import InputError
from jbeamshell.mechanics.bar import bar_backbone
from jbeamshell.quasistatic.prediction import SMALLEST_SHARE
from jbeamshell.scene.keys import DERIVED, NUMBERS, check_key
from jbeamshell.scene.parts import FAR_ENDS
from jbeamshell.scene.pressure import resultant
from jbeamshell.scene.scene import Scene

LARGEST = 400_000_000  # bytes of a sweep's arrays: with what compiling takes less than 1 GB
# Where a number must lie, both ends excluded; as the scene's parts have it.
BOUNDS = {
    "strip.poisson_ratio": (-1.0, 0.5),
    "strip.deviation": (-math.inf, math.inf),
    "strip.curvature": (-math.inf, math.inf),
    "contact.smoothing": (1.0, math.inf),
    **dict.fromkeys(("contact.friction", "contact.bottom_pressure"), (-5e-324, math.inf)),
}


class Outcome(enum.IntEnum):
    """How a lane ended; up to NOT_REACHED the codes of `jbeamshell.Status`."""

    CONVERGED = 0
    MAX_ITERATIONS = 1
    NOT_FINITE = 2
    NOT_REACHED = 3
    OUTSIDE = 4  # the model's domain: not run
    UNDEFINED = 5  # solved, but a figure is nought over nought, such as a ratio without friction


@dataclasses.dataclass(frozen=True)
class Lanes:
    """The lanes of a sweep.

    Attributes
    ----------
    scene : what is not varied
    axes : values by dotted key, (n,) each; the lanes are their product, the last key running
        fastest, or, paired, the n rows of all
    paired : whether they are
    """

    scene: Scene
    axes: dict[str, np.ndarray]
    paired: bool = False

    @property
    def shape(self) -> tuple[int, ...]:
        """Of arrays with one number for each lane."""
        sizes = tuple(values.size for values in self.axes.values())
        return sizes[:1] if self.paired else sizes

    @property
    def size(self) -> int:
        return math.prod(self.shape)

    def columns(self, lanes: ArrayLike) -> np.ndarray:
        """What the keys are in lanes of these (flat) numbers, (keys, lanes)."""
        places = np.unravel_index(np.asarray(lanes), self.shape)
        if self.paired:
            places *= len(self.axes)
        axes = self.axes.values()
        return np.stack([values[at] for values, at in zip(axes, places, strict=True)])

    def grid(self, key: str) -> np.ndarray:
        """Values of a key that is varied, in a shape that broadcasts to that of the lanes."""
        values, place = self.axes[key], list(self.axes).index(key)
        if self.paired:
            return values
        return values.reshape([-1 if axis == place else 1 for axis in range(len(self.axes))])

    def value(self, key: str) -> np.ndarray:
        """A number of the scene in every lane, broadcasting; tables are the scene's own."""
        if key in self.axes:
            return self.grid(key)
        return np.asarray(self.scene.get(key), dtype=float)

    # --- quantities of the lanes, broadcasting to their shape -------------------------------------

    @property
    def half_height(self) -> np.ndarray:
        """H, length."""
        if "strip.half_height" in self.axes:
            return self.grid("strip.half_height")
        return 0.5 * self.value("strip.height_ratio") * self.value("strip.length")

    @property
    def height_ratio(self) -> np.ndarray:
        """Eta = H/(L/2)."""
        return 2.0 * self.half_height / self.value("strip.length")

    @property
    def stiffness(self) -> np.ndarray:
        """E' 2H, force per unit width."""
        strip = self.scene.strip
        if "strip.youngs_modulus" in self.axes:
            given = 2.0 * self.half_height * self.grid("strip.youngs_modulus")
            plane_stress = strip.plane == "stress"
            return given if plane_stress else given / (1.0 - self.value("strip.poisson_ratio") ** 2)
        if "strip.axial_stiffness" in self.axes:
            return self.grid("strip.axial_stiffness")
        return np.asarray(strip.stretching_stiffness, dtype=float)

    @property
    def resultant(self) -> tuple[np.ndarray, np.ndarray]:
        """Force of the pressures on the strip, down, and its moment about X = 0."""
        length = self.value("strip.length")
        (down, turning), (up, lifting) = (
            resultant(self.value(f"contact.{name}"), length, table=self._table(name))
            for name in ("pressure", "bottom_pressure")
        )
        return down - up, turning - lifting

    @property
    def gross_slip(self) -> np.ndarray:
        """End force at which the whole contact slides: mu times the pressures' force."""
        return self.value("contact.friction") * self.resultant[0]

    @property
    def amplitude_over_height(self) -> np.ndarray:
        """A/eta with A in units of mu F_N L/2: what the dissipation's ratio mostly depends on.

        An array of the lanes' shape; NaN without friction, and under displacement control, where
        the force is not known beforehand.
        """
        known = self.scene.load.control == "force"
        with np.errstate(divide="ignore", invalid="ignore"):
            scaled = self.value("load.amplitude") / (0.5 * self.gross_slip) / self.height_ratio
        return np.broadcast_to(np.where(known & np.isfinite(scaled), scaled, np.nan), self.shape)

    @property
    def difficulty(self) -> np.ndarray:
        """Estimate that puts lanes of like cost beside each other: the farther slip goes, more."""
        amplitude, load = self.value("load.amplitude"), self.scene.load
        if load.control == "displacement":
            amplitude = amplitude * self.stiffness / self.value("strip.length")
        with np.errstate(all="ignore"):
            ratio = amplitude / self.gross_slip / self.height_ratio
        return np.broadcast_to(np.nan_to_num(ratio, posinf=0.0, neginf=0.0), self.shape)

    # --- domain ---------------------------------------------------------------------------------

    def outside(self) -> np.ndarray:
        """Which lanes lie outside the model's domain, an array of the lanes' shape.

        What `Scene` and `jbeamshell.solve` refuse one by one, for all at once.
        """
        out = np.zeros(self.shape, bool)
        with np.errstate(all="ignore"):
            for refused in self._refusals():
                out |= refused
        return out

    def _refusals(self) -> Iterator[np.ndarray]:
        for key in self.axes:
            low, high = BOUNDS.get(key, (0.0, math.inf))
            values = self.grid(key)
            yield ~((values > low) & (values < high))
        strip, contact, model = self.scene.strip, self.scene.contact, self.scene.model
        length, friction = self.value("strip.length"), self.value("contact.friction")
        if "v" not in FAR_ENDS[strip.far_end] or model.solution == "closed-form":
            yield friction == 0.0
        if strip.layers is not None:
            thickness, height = np.sum(np.asarray(strip.layers)[:, 0]), 2.0 * self.half_height
            yield abs(thickness - height) > 1e-6 * height
        for name in ("pressure", "bottom_pressure"):
            if self._table(name):
                x = self.value(f"contact.{name}")[:, 0]
                yield (x.max() > length * (1.0 + 1e-12)) | (x.min() < 0.0)
        total, moment = self.resultant
        if contact.normal != "none":
            yield total <= 0.0
            if "beta" not in FAR_ENDS[strip.far_end] and "w" in model.fields:
                yield (moment < 0.0) | (moment > total * length)
        amplitude = self.value("load.amplitude")
        if self.scene.load.control == "force":
            slides = amplitude >= (1.0 - SMALLEST_SHARE) * friction * total
            yield slides & (friction > 0.0) & bool(self.scene.load.cycles)
        elif model.solution == "closed-form":
            limit = bar_backbone(friction * total, self.stiffness, friction * total / length)
            yield amplitude >= np.asarray(limit)

    def _table(self, name: str) -> bool:
        return f"contact.{name}" not in self.axes and getattr(self.scene.contact, name).ndim > 0


def lanes_of(scene: Scene, over: Mapping[str, ArrayLike], paired: bool = False) -> Lanes:
    """Lanes of axes that are checked; raises `InputError` with the fix where they make none."""
    some = isinstance(over, Mapping) and len(over) > 0
    require("over", over, some, "name at least one key and its values, in a dictionary")
    for key in over:
        check_key(key)
        number = key in NUMBERS and key != "strip.layers"
        require("over", key, number, "is no single number of the scene: give it to the scene")
        if DERIVED.get(key) in over:
            raise InputError(f"{key} and {DERIVED[key]} say the same thing: give one of them")
    axes = {}
    for key, given in over.items():
        as_leaf(given, key, "give numbers to run over")
        values = np.atleast_1d(np.asarray(given, dtype=float))
        fix = f"give a list of numbers, not an array of shape {values.shape}"
        require(f"over {key}", values.shape, values.ndim == 1, fix)
        require(f"over {key}", [], values.size > 0, "is empty: give at least one number")
        strange = values[~np.isfinite(values)]
        require(f"over {key}", strange, strange.size == 0, "must be finite numbers")
        axes[key] = values
    lanes = Lanes(scene, axes, paired)
    lengths = {key: values.size for key, values in axes.items()}
    alike = not paired or len(set(lengths.values())) == 1
    require("over", lengths, alike, "paired keys need equally many values")
    return lanes


def check_size(lanes: int, figures: int) -> None:
    """Refuse a sweep whose arrays would not fit into the memory that one may take."""
    need = lanes * (8 * (2 * figures + 4) + 3)
    if need > LARGEST:
        raise InputError(
            f"over: {lanes:,} lanes of {figures} figures take {_bytes(need)} of memory, of which a "
            f"sweep may take {_bytes(LARGEST)}: give fewer values, or split an axis and sweep "
            f"{-(-need // LARGEST)} times"
        )


def _bytes(count: int) -> str:
    size, units = float(count), iter(("bytes", "kB", "MB", "GB", "TB", "PB"))
    unit = next(units)
    while size >= 1000.0 and unit != "PB":
        size, unit = size / 1000.0, next(units)
    return f"{size:.3g} {unit}"

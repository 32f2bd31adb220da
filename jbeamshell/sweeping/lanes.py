"""Lanes of a sweep, one strip each: their numbers, their domain and an estimate of their cost."""

from __future__ import annotations

import dataclasses
import enum
import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jbeamshell.common.checks import as_leaf, require
from jbeamshell.common.errors import InputError
from jbeamshell.scene.domain import gross_slip, gross_slip_rule, support_rules
from jbeamshell.scene.keys import DERIVED, NUMBERS, TABLE, WIDTH_OF_ALL, check_key
from jbeamshell.scene.layers import fill_height
from jbeamshell.scene.linearisation import stretching
from jbeamshell.scene.scene import Scene

LARGEST = 400_000_000  # bytes of a sweep's arrays; with those of the compiler less than 1 GB


class Outcome(enum.IntEnum):
    """Outcome of a lane; up to NOT_REACHED the codes of `jbeamshell.Status`."""

    CONVERGED = 0
    MAX_ITERATIONS = 1
    NOT_FINITE = 2
    NOT_REACHED = 3
    OUTSIDE = 4  # the model's domain: not run
    UNDEFINED = 5  # solved, but a figure is 0/0, such as a ratio without friction
    NOT_RUN = 6  # the sweep was interrupted before


@dataclasses.dataclass(frozen=True, eq=False)
class Lanes:
    """Lanes of a sweep: strips that differ in some numbers.

    Attributes
    ----------
    scene : scene with all that is not varied
    axes : values (n,) by dotted key.  The lanes are their product, the last key running fastest;
        if they are paired, lane i has value i of every key
    paired : True if the keys' values go together
    """

    scene: Scene
    axes: dict[str, np.ndarray]
    paired: bool = False

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of arrays with one number for each lane."""
        sizes = tuple(values.size for values in self.axes.values())
        return sizes[:1] if self.paired else sizes

    @property
    def size(self) -> int:
        """Number of lanes."""
        return math.prod(self.shape)

    def columns(self, lanes: ArrayLike) -> np.ndarray:
        """Values of the keys in lanes of these flat numbers, (keys, lanes)."""
        places = np.unravel_index(np.asarray(lanes), self.shape)
        if self.paired:
            places *= len(self.axes)
        axes = self.axes.values()
        return np.stack([values[at] for values, at in zip(axes, places, strict=True)])

    def grid(self, key: str) -> np.ndarray:
        """Values of a varied key, in a shape that broadcasts to that of the lanes."""
        values, place = self.axes[key], list(self.axes).index(key)
        if self.paired:
            return values
        return values.reshape([-1 if axis == place else 1 for axis in range(len(self.axes))])

    def value(self, key: str) -> np.ndarray:
        """Number of the scene in every lane, broadcasting; a table is the same in all lanes.

        A number that depends on others, such as the half height, follows those that are varied.
        """
        return self.scene.number(key, {key: self.grid(key) for key in self.axes})

    # --- quantities of the lanes, broadcasting to their shape -------------------------------------

    @property
    def height_ratio(self) -> np.ndarray:
        """Height ratio eta = H/(L/2)."""
        return self.value("strip.height_ratio")

    @property
    def gross_slip(self) -> np.ndarray:
        """End force per unit of width at which the whole contact slides."""
        return self._pressed * gross_slip(self.value, self.scene.member.support)

    @property
    def _pressed(self) -> np.ndarray:
        """Part of the scene's pressures that acts: bolts press the less, the wider the joint."""
        varies = WIDTH_OF_ALL in self.axes and self.scene.contact.bolted
        if not varies:
            return np.ones(())
        return self.scene.number(WIDTH_OF_ALL) / self.value(WIDTH_OF_ALL)

    @property
    def amplitude_over_height(self) -> np.ndarray:
        """Load A/eta with A in units of mu F_N L/2, on which the dissipation ratio mostly depends.

        An array of the lanes' shape; NaN without friction, and under displacement control, where
        the force is not known beforehand.
        """
        known = self.scene.load.control == "force"
        with np.errstate(divide="ignore", invalid="ignore"):
            scaled = self.value("load.amplitude") / (0.5 * self.gross_slip) / self.height_ratio
        return np.broadcast_to(np.where(known & np.isfinite(scaled), scaled, np.nan), self.shape)

    @property
    def difficulty(self) -> np.ndarray:
        """Estimate of a lane's cost, which grows with the slip zone; an array of their shape."""
        amplitude, load = self.value("load.amplitude"), self.scene.load
        if load.control == "displacement":
            stiffness = stretching(self.scene.strip, self.value)
            amplitude = amplitude * stiffness / self.value("strip.length")
        with np.errstate(all="ignore"):
            ratio = amplitude / self.gross_slip / self.height_ratio
        return np.broadcast_to(np.nan_to_num(ratio, posinf=0.0, neginf=0.0), self.shape)

    # --- domain ---------------------------------------------------------------------------------

    def outside(self) -> np.ndarray:
        """True for lanes outside the model's domain, an array of the lanes' shape.

        `Scene` and `jbeamshell.solve` refuse them one by one, by the same rules.
        """
        out = np.zeros(self.shape, bool)
        with np.errstate(all="ignore"):
            for holds in self._conditions():
                out |= ~np.asarray(holds)
        return out

    def _conditions(self) -> Iterator[Any]:
        """Truths of every rule, broadcasting to the lanes' shape."""
        for key in self.axes:
            yield TABLE[key].holds(self.grid(key))
        scene = self.scene
        strip, contact, load, member = scene.strip, scene.contact, scene.load, scene.member
        if strip.layers is not None:
            thickness = np.sum(np.asarray(strip.layers)[:, 0])
            yield fill_height(thickness, 2.0 * self.value("strip.half_height"))
        targets = self.value("load.amplitude") if load.cycles else 0.0
        for rule in (
            *support_rules(strip, member, contact, scene.plan, load, self.value),
            gross_slip_rule(load, member, self.value, targets, self._pressed),
        ):
            yield rule.holds


def lanes_of(scene: Scene, over: Mapping[str, ArrayLike], paired: bool = False) -> Lanes:
    """Lanes of a sweep; raises `InputError` for axes that make none.

    Parameters
    ----------
    scene : scene with all that is not varied
    over : values (n,) by dotted key of a single number
    paired : True if the keys' values go together
    """
    some = isinstance(over, Mapping) and len(over) > 0
    require("over", over, some, "name at least one key and its values, in a dictionary")
    for key in over:
        check_key(key)
        number = key in NUMBERS and key not in ("strip.layers", "contact.bolts")
        require("over", key, number, "is no single number of the scene: set it in the scene")
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
    """Raise `InputError` for a sweep whose arrays are larger than `LARGEST`."""
    need = lanes * (8 * (2 * figures + 4) + 3)
    if need > LARGEST:
        raise InputError(
            f"over: {lanes:,} lanes of {figures} figures take {1e-6 * need:,.0f} MB of memory, of "
            f"which a sweep may take {1e-6 * LARGEST:,.0f} MB: give fewer values, or split an axis "
            f"and sweep {-(-need // LARGEST)} times"
        )

"""Free parameters of a fit: bounds, scales and ties, and the way to an unbounded search space.

The model knows nothing of this: it is run at plain values, and its derivatives are multiplied by
the slopes of these bijections.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import expit, logit

from jbeamshell.common.checks import shown
from jbeamshell.common.errors import InputError
from jbeamshell.scene.keys import NUMBERS, TABLE, check_key
from jbeamshell.scene.scene import Scene

SCALES = ("log", "linear")
FARTHEST = 40.0  # in the search space: exp of more than this says nothing
INSET = 1e-9  # of a box: the model is run inside its open bounds only
AT_BOUND = 1e-3  # of the box: a fit that ends so close to a bound is held by it


@dataclasses.dataclass(frozen=True)
class Parameter:
    """A number of the scene that a fit may change.

    Attributes
    ----------
    key : dotted key, such as "contact.friction"
    start : where the search starts; None is the scene's own value
    low, high : bounds, both excluded; None is the bound in the table of keys
    scale : "log" for a number known by its order of magnitude, or "linear"; None is the scale in
        the table of keys
    prior : mean and standard deviation of what is known beforehand, in the parameter's own units
    each : whether every specimen has a value of its own; else all share one

    Raises
    ------
    InputError
        naming the key, the value and the fix
    """

    key: str
    start: float | None = None
    low: float | None = None
    high: float | None = None
    scale: str | None = None
    prior: tuple[float, float] | None = None
    each: bool = False

    def __post_init__(self) -> None:
        check_key(self.key)
        if self.key not in NUMBERS or self.key == "load.amplitude":
            raise InputError(f"free {self.key!r}: is not a parameter of the strip or the contact")
        for name in ("start", "low", "high"):
            value = getattr(self, name)
            self._require(name, value, value is None or _is_number(value), "give a finite number")
        self._require("each", self.each, isinstance(self.each, bool), "give true or false")
        self._check_prior()
        fix = "choose 'log' or 'linear'"
        known = isinstance(self.scale, str) and self.scale in SCALES
        self._require("scale", self.scale, self.scale is None or known, fix)
        low, high = self.bounds
        least, most = TABLE[self.key].low, TABLE[self.key].high
        fix = f"the parameter lives between {least:g} and {most:g}: give a bound in there"
        self._require("low", self.low, least <= low < most, fix)
        self._require("high", self.high, least < high <= most, fix)
        self._require("low", self.low, low < high, f"must lie below high = {high:g}")
        fix = "needs positive values: give low, 0 or more, or take 'linear'"
        self._require("scale", self.scale, self.scale != "log" or low >= 0.0, fix)

    @property
    def bounds(self) -> tuple[float, float]:
        """The open interval in which to search."""
        least, most = TABLE[self.key].low, TABLE[self.key].high
        low = least if self.low is None else float(self.low)
        return low, most if self.high is None else float(self.high)

    @property
    def bounded(self) -> bool:
        """Whether both bounds are finite, so that a search can be spread between them."""
        return bool(np.all(np.isfinite(self.bounds)))

    def bijection(self, start: float) -> Bijection:
        """The way from the search space; raises `InputError` if the start is out of bounds."""
        low, high = self.bounds
        fix = f"must lie between low = {low:g} and high = {high:g}, both excluded: move one"
        self._require("start", start, low < start < high, fix)
        scale = TABLE[self.key].scale if self.scale is None else self.scale
        return Bijection(start, low, high, scale == "log")

    def _check_prior(self) -> None:
        if self.prior is None:
            return
        pair = isinstance(self.prior, tuple | list) and len(self.prior) == 2
        good = pair and all(map(_is_number, self.prior)) and self.prior[1] > 0.0
        fix = "give (mean, standard deviation), the latter positive"
        self._require("prior", self.prior, good, fix)

    def _require(self, name: str, value: Any, holds: bool, fix: str) -> None:
        if not holds:
            raise InputError(f"free {self.key!r}: {name} = {shown(value)}: {fix}")


class Bijection(NamedTuple):
    """From the whole real line, zero being the start, to an open interval.

    On the scale t = x, or t = log x: t0 + p where nothing bounds it, t_low + (t0-t_low) exp(p) with
    one bound, and a logistic curve in p between two.

    Attributes
    ----------
    start, low, high : of the parameter x
    log : whether the scale is logarithmic
    """

    start: float
    low: float
    high: float
    log: bool

    def value(self, point: float) -> float:
        """The parameter at a point of the search space."""
        return self._unscaled(self._at(point)[0])

    def slope(self, point: float) -> float:
        """Derivative of the parameter with respect to the point."""
        t, dt = self._at(point)
        return dt * self._unscaled(t) if self.log else dt

    def point(self, value: float) -> float:
        """The inverse of `value`; values on or beyond a bound are put inside."""
        start, low, high = map(self._scaled, (self.start, self.low, self.high))
        t = self._scaled(value)
        if np.isfinite(low) and np.isfinite(high):
            point = logit((t - low) / (high - low)) - logit((start - low) / (high - low))
        elif np.isfinite(low):
            point = np.log((t - low) / (start - low)) if t > low else -FARTHEST
        elif np.isfinite(high):
            point = -np.log((high - t) / (high - start)) if t < high else FARTHEST
        else:
            point = (t - start) / self._unit
            if not self.log:
                return float(point)
        return float(np.clip(point, -FARTHEST, FARTHEST))

    def straight(self) -> tuple[Bijection, tuple[float, float]]:
        """The same scale without bends, and the bounds as a box in its search space."""
        free = Bijection(self.start, 0.0 if self.log else -np.inf, np.inf, self.log)
        low, high = ((self._scaled(b) - self._scaled(self.start)) / self._unit for b in self[1:3])
        inset = INSET * (high - low) if np.isfinite(high - low) else INSET
        return free, (low + inset, high - inset)

    def held_by(self, value: float) -> float | None:
        """The bound at which a value stands; None inside."""
        low, high, t = map(self._scaled, (self.low, self.high, value))
        width = high - low if np.isfinite(high - low) else self._unit
        at_low, at_high = t - low < AT_BOUND * width, high - t < AT_BOUND * width
        return self.low if at_low else self.high if at_high else None

    @property
    def _unit(self) -> float:
        return 1.0 if self.log or self.start == 0.0 else abs(self.start)

    def _scaled(self, value: float) -> float:
        if not self.log:
            return float(value)
        return float(np.log(value)) if value > 0.0 else -np.inf

    def _unscaled(self, t: float) -> float:
        return float(np.exp(t)) if self.log else float(t)

    def _at(self, point: float) -> tuple[float, float]:
        """The scaled parameter and its derivative."""
        start, low, high = map(self._scaled, (self.start, self.low, self.high))
        endless = not (self.log or np.isfinite(low) or np.isfinite(high))
        p = float(point) if endless else float(np.clip(point, -FARTHEST, FARTHEST))
        if np.isfinite(low) and np.isfinite(high):
            part = expit(logit((start - low) / (high - low)) + p)
            return low + (high - low) * part, (high - low) * part * (1.0 - part)
        if np.isfinite(low):
            rise = (start - low) * np.exp(p)
            return low + rise, rise
        if np.isfinite(high):
            fall = (high - start) * np.exp(-p)
            return high - fall, fall
        return start + self._unit * p, self._unit


class Space(NamedTuple):
    """The search space of a fit of several specimens, n entries long.

    Attributes
    ----------
    keys : (k,) dotted keys
    names : (n,) of the entries: the key, with the specimen's label where each has its own
    bijections : (n,) from the search space to the values
    table : (specimens, k) the entry behind each key of each specimen
    parameters : (n,) what was asked for
    """

    keys: tuple[str, ...]
    names: tuple[str, ...]
    bijections: tuple[Bijection, ...]
    table: NDArray[np.int64]
    parameters: tuple[Parameter, ...]

    def values(self, point: ArrayLike) -> NDArray[np.float64]:
        """Parameters (n,) at a point (n,) of the search space."""
        pairs = zip(self.bijections, np.asarray(point), strict=True)
        return np.array([bijection.value(p) for bijection, p in pairs])

    def slopes(self, point: ArrayLike) -> NDArray[np.float64]:
        """Their derivatives (n,)."""
        pairs = zip(self.bijections, np.asarray(point), strict=True)
        return np.array([bijection.slope(p) for bijection, p in pairs])

    def point(self, values: ArrayLike) -> NDArray[np.float64]:
        """The point (n,) of the search space behind values (n,)."""
        pairs = zip(self.bijections, np.asarray(values), strict=True)
        return np.array([bijection.point(value) for bijection, value in pairs])

    def of(self, values: ArrayLike, specimen: int) -> dict[str, float]:
        """One specimen's values by key."""
        own = np.asarray(values)[self.table[specimen]]
        return dict(zip(self.keys, own.tolist(), strict=True))

    def straight(self) -> tuple[Space, NDArray[np.float64]]:
        """The space without bends, and its box (n, 2)."""
        pairs = [bijection.straight() for bijection in self.bijections]
        free, boxes = zip(*pairs, strict=True)
        return self._replace(bijections=free), np.array(boxes)

    def described(self, values: ArrayLike) -> str:
        """The values in one line."""
        pairs = zip(self.names, np.asarray(values), strict=True)
        return ", ".join(f"{name} = {value:.6g}" for name, value in pairs)


def as_parameters(free: Sequence[str | Parameter]) -> tuple[Parameter, ...]:
    """Parameters from keys or parameters; raises `InputError` for none or one named twice."""
    given = [free] if isinstance(free, str | Parameter) else free
    if not (isinstance(given, list | tuple) and given):
        raise InputError("free: name at least one key, such as contact.friction")
    parameters = []
    for item in given:
        if not isinstance(item, str | Parameter):
            raise InputError(f"free {item!r}: give a key or a Parameter")
        parameters.append(Parameter(item) if isinstance(item, str) else item)
    keys = [parameter.key for parameter in parameters]
    if len(set(keys)) < len(keys):
        raise InputError(f"free {keys}: names a key twice")
    return tuple(parameters)


def search_space(
    free: Sequence[Parameter], scenes: Mapping[str, Scene]
) -> tuple[Space, dict[str, Scene]]:
    """The space of several specimens' parameters, and their scenes at its start.

    Parameters
    ----------
    free : parameters, no key twice
    scenes : by the specimen's label

    Raises
    ------
    InputError
        for a key that is no number of a scene, a start out of bounds, or a shared parameter that
        the scenes start at different values
    """
    given = {p.key: p.start for p in free if p.start is not None}
    begun = {label: scene.replace(given) for label, scene in scenes.items()}
    names: list[str] = []
    owners: list[Parameter] = []
    bijections: list[Bijection] = []
    columns: list[list[int]] = []
    for parameter in free:
        starts = [_start(scene, parameter.key) for scene in begun.values()]
        if not parameter.each and len(set(starts)) > 1:
            low, high = min(starts), max(starts)
            raise InputError(
                f"free {parameter.key!r}: is shared, but the specimens start from {low:g} to "
                f"{high:g}: give one start, or each=True"
            )
        first, own = len(names), list(begun) if parameter.each and len(begun) > 1 else [""]
        names += [f"{parameter.key}[{label}]" if label else parameter.key for label in own]
        bijections += [parameter.bijection(start) for start in starts[: len(own)]]
        owners += [parameter] * len(own)
        columns.append([first + (i if len(own) > 1 else 0) for i in range(len(begun))])
    table = np.array(columns).T
    keys = tuple(parameter.key for parameter in free)
    return Space(keys, tuple(names), tuple(bijections), table, tuple(owners)), begun


def _start(scene: Scene, key: str) -> float:
    start = scene.get(key)
    if start is None:
        raise InputError(f"free {key!r}: the scene has none; give it a number to start from")
    if np.ndim(start) > 0:
        raise InputError(f"free {key!r}: is a table; only a single number can be fitted")
    if not np.isfinite(start):
        raise InputError(f"free {key!r}: is 'sharp'; give it a number to start from, such as 16")
    spread = -np.inf < TABLE[key].low < 0.0  # finite bounds around 0 give the search its scale
    if float(start) == 0.0 and not spread:
        raise InputError(f"free {key!r}: is 0; give it another number to start from")
    return float(start)


def _is_number(value: Any) -> bool:
    number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    return number and bool(abs(value) <= sys.float_info.max)  # a whole number may be beyond

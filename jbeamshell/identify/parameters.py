"""Free parameters of a fit: their keys, starts, bounds, scales and priors.

A fit knows the keys of the scene, of the rig, of laws of a joint, and of structures.  It searches
along one coordinate for each number, which has no bounds.
"""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.special import logit

from jbeamshell.common.checks import require, shown
from jbeamshell.common.errors import InputError
from jbeamshell.common.numbers_of import quiet
from jbeamshell.laws import LAWS, Law, law_named
from jbeamshell.scene.keys import NUMBERS, TABLE, check_key
from jbeamshell.scene.rows import Key

SCALES = ("log", "linear")
FARTHEST = 40.0  # largest coordinate and logarithm without a bound; exp overflows or vanishes
ON_BOUND = 20.0  # coordinate on a bound: a number stays inside, by e^-20 of the way to its start
AT_BOUND = 1e-3  # distance from a bound, over that of both, below which a fit ended at it

PREFIX = "rig."
OF_STRUCTURE = "structure."
ANY = -math.inf  # lower bound of a number of any sign


def _row(name: str, sentence: str, unit: str, low: float = 0.0, scale: str = "log") -> Key:
    return Key(PREFIX + name, "number", 0.0, sentence, unit=unit, low=low, scale=scale, closed=True)


RIG: dict[str, Key] = {
    row.name: row
    for row in (
        _row("compliance", "Compliance of a spring in series.", "length/(force/width)"),
        _row("stiffness", "Stiffness of a spring in parallel.", "(force/width)/length"),
        _row("loss", "Force of damping in parallel at the middle of the cycle.", "force/width"),
        _row("force_zero", "Reading of the force without load.", "force/width", ANY, "linear"),
        _row("displacement_zero", "Reading of the displacement.", "length", ANY, "linear"),
        _row("drift", "Change of the response's reading over the loop.", "mixed", ANY, "linear"),
    )
}


def law_of(key: object) -> type[Law] | None:
    """Law that has a number of a dotted key; None if there is none."""
    if not isinstance(key, str):
        return None
    heading = key.partition(".")[0]
    known = heading in LAWS or heading.removeprefix("sliders").isdecimal()
    law = law_named(heading) if known else None
    return law if law is not None and key in law.table() else None


def fitted_row(key: str) -> Key:
    """Row of a key of the scene, the rig, a law or a structure; raises `InputError` for others."""
    if law := law_of(key):
        return law.table()[key]
    if is_of_structure(key):
        return Key(key, "number", 1.0, "Number of a structure.", low=ANY, scale="log")
    of_rig = isinstance(key, str) and key.startswith(PREFIX)
    (check_rig_key if of_rig else check_key)(key)
    return RIG[key] if of_rig else TABLE[key]


def is_of_structure(key: object) -> bool:
    """True for a dotted key of a number of a structure, whose names users choose."""
    return isinstance(key, str) and key.startswith(OF_STRUCTURE) and len(key) > len(OF_STRUCTURE)


def check_rig_key(key: str) -> None:
    """Raise `InputError` for a key of the rig that does not exist."""
    if key not in RIG:
        raise InputError(f"unknown key {key!r}: keys of the rig are {', '.join(RIG)}")


def check_rig(values: Mapping[str, Any]) -> None:
    """Raise `InputError` for unknown keys of a rig, and values out of their domain."""
    for key, value in values.items():
        check_rig_key(key)
        low = RIG[key].low
        number = isinstance(value, int | float) and not isinstance(value, bool)
        fix = "give a number" + (", 0 or more" if low == 0.0 else "")
        require(key, value, number and math.isfinite(value) and value >= low, fix)


class Coordinate(NamedTuple):
    """Coordinate of a free number x on the whole real line, between whose ends lie the bounds of x.

    Zero is the start.  On the scale t = x or t = log x, the coordinate p has t = t_0 + p without
    bounds, t_low + (t_0 - t_low) exp(p) with one bound, and a logistic curve with two.

    Attributes
    ----------
    start, low, high : start and bounds of the number
    log : True if the scale is logarithmic
    """

    start: float
    low: float
    high: float
    log: bool

    @quiet
    def at(self, p: Any) -> tuple[Any, Any]:
        """Number at a coordinate, and its derivative; both may be traced."""
        numbers, (start, low, high) = jnp if isinstance(p, Array) else np, self._ends
        bounded, p = (np.isfinite(low), np.isfinite(high)), numbers.clip(p, *self._reach)
        if all(bounded):
            part = 1.0 / (1.0 + numbers.exp(-p - logit((start - low) / (high - low))))
            t, dt = low + (high - low) * part, (high - low) * part * (1.0 - part)
        elif bounded[0]:
            dt = (start - low) * numbers.exp(p)
            t = low + dt
        elif bounded[1]:
            dt = (high - start) * numbers.exp(-p)
            t = high - dt
        else:
            t, dt = start + self.unit * p, self.unit + 0.0 * p
        if not self.log:
            return t, dt
        x = numbers.exp(numbers.clip(t, start - FARTHEST, start + FARTHEST))
        x = numbers.clip(x, self.low, self.high)  # but for rounding
        return x, dt * x

    def of(self, x: float) -> float:
        """Coordinate of a number; numbers on or beyond a bound are moved inside."""
        (start, low, high), t = self._ends, self._scaled(x)
        if np.isfinite(low) and np.isfinite(high):
            p = logit(np.clip((t - low) / (high - low), 0.0, 1.0))
            p = p - logit((start - low) / (high - low))
        elif np.isfinite(low):
            p = np.log((t - low) / (start - low)) if t > low else -FARTHEST
        elif np.isfinite(high):
            p = -np.log((high - t) / (high - start)) if t < high else FARTHEST
        else:
            p = (t - start) / self.unit
        return float(np.clip(p, *self._reach))

    def between(self, part: float) -> float:
        """Coordinate at a part of the way from bound to bound, on the scale of the number.

        A missing bound, such as 0 of a logarithm, is a unit away from the start.
        """
        start, low, high = self._ends
        if not np.isfinite(high - low):
            low, high = max(low, start - self.unit), min(high, start + self.unit)
        t = low + part * (high - low)
        return self.of(float(np.exp(t)) if self.log else t)

    def bound_at(self, x: float) -> float | None:
        """Bound at which a number ended; None if it lies inside."""
        (_, low, high), t = self._ends, self._scaled(x)
        near = AT_BOUND * (high - low if np.isfinite(high - low) else self.unit)
        return self.low if t - low < near else self.high if high - t < near else None

    @property
    def unit(self) -> float:
        """Unit of the scale: a factor e of a logarithm, else the size of the start."""
        return 1.0 if self.log or self.start == 0.0 else abs(self.start)

    @property
    def _reach(self) -> tuple[float, float]:
        """Least and largest coordinate."""
        _, low, high = self._ends
        if not (self.log or np.isfinite(low) or np.isfinite(high)):
            return -np.inf, np.inf
        below, above = (ON_BOUND if np.isfinite(b) else FARTHEST for b in (low, high))
        return -below, above

    @property
    def _ends(self) -> tuple[float, float, float]:
        """Start and bounds on the scale."""
        return self._scaled(self.start), self._scaled(self.low), self._scaled(self.high)

    def _scaled(self, x: float) -> float:
        if not self.log:
            return float(x)
        return float(np.log(x)) if x > 0.0 else -np.inf


@dataclasses.dataclass(frozen=True)
class Parameter:
    """Number of the scene, of a law, a structure or the rig that a fit may change.

    Attributes
    ----------
    key : dotted key, such as "contact.friction", "iwan4.chi" or "rig.compliance"
    start : value at which the search starts; None takes the scene's own value
    low, high : bounds, both excluded; None takes the bounds in the table of keys.  A number of a
        structure that starts above zero stays there; give ``low`` if it may have any sign
    scale : "log" for a quantity known by its order of magnitude, or "linear"; None takes the scale
        in the table of keys, and "linear" for a number of a structure that may be negative
    prior : mean and standard deviation of prior knowledge, in the parameter's own units
    each : True if every specimen has a value of its own; False if all share one

    Raises
    ------
    InputError
        if the key is no number of the strip or the contact, or if an option does not suit the key

    Examples
    --------
    >>> from jbeamshell import identify
    >>> identify.Parameter("strip.height_ratio", low=0.05, high=0.5).bounds
    (0.05, 0.5)
    """

    key: str
    start: float | None = None
    low: float | None = None
    high: float | None = None
    scale: str | None = None
    prior: tuple[float, float] | None = None
    each: bool = False

    def __post_init__(self) -> None:
        row = fitted_row(self.key)
        other = law_of(self.key) is not None or is_of_structure(self.key)
        known = other or self.key in (*NUMBERS, *RIG)
        if not known or self.key == "load.amplitude":
            raise InputError(
                f"free {self.key!r}: is not a parameter of the strip or the contact; name one, "
                "such as contact.friction"
            )
        for name in ("start", "low", "high"):
            value = getattr(self, name)
            self._require(name, value, value is None or is_number(value), "give a finite number")
        self._require("each", self.each, isinstance(self.each, bool), "give true or false")
        self._check_prior()
        fix = "choose 'log' or 'linear'"
        known = isinstance(self.scale, str) and self.scale in SCALES
        self._require("scale", self.scale, self.scale is None or known, fix)
        low, high = self.bounds
        least, most = row.low, row.high
        fix = f"must lie between {least:g} and {most:g}"
        self._require("low", self.low, least <= low < most, fix)
        self._require("high", self.high, least < high <= most, fix)
        self._require("low", self.low, low < high, f"must lie below high = {high:g}")
        fix = "needs positive values: give low = 0 or more, or scale = 'linear'"
        self._require("scale", self.scale, self.scale != "log" or low >= 0.0, fix)

    @property
    def bounds(self) -> tuple[float, float]:
        """Open interval in which to search."""
        least, most = fitted_row(self.key).low, fitted_row(self.key).high
        high = most if self.high is None else float(self.high)
        if is_of_structure(self.key) and high > 0.0:
            least = 0.0
        return least if self.low is None else float(self.low), high

    @property
    def bounded(self) -> bool:
        """True if both bounds are finite, so that starts can be spread between them."""
        return bool(np.all(np.isfinite(self.bounds)))

    def coordinate(self, start: float) -> Coordinate:
        """Coordinate with a start; raises `InputError` if that lies out of bounds."""
        low, high = self.bounds
        if is_of_structure(self.key) and self.low is None and start < 0.0:
            low = ANY
        fix = f"must lie between low = {low:g} and high = {high:g}, both excluded"
        self._require("start", start, low < start < high, fix)
        scale = fitted_row(self.key).scale if self.scale is None else self.scale
        signed = is_of_structure(self.key) and low < 0.0
        return Coordinate(start, low, high, scale == "log" and not signed)

    def _check_prior(self) -> None:
        if self.prior is None:
            return
        pair = isinstance(self.prior, tuple | list) and len(self.prior) == 2
        valid = pair and all(map(is_number, self.prior)) and self.prior[1] > 0.0
        fix = "give (mean, standard deviation) with a positive standard deviation"
        self._require("prior", self.prior, valid, fix)

    def _require(self, name: str, value: Any, holds: bool, fix: str) -> None:
        if not holds:
            raise InputError(f"free {self.key!r}: {name} = {shown(value)}: {fix}")


def as_parameters(free: Sequence[str | Parameter]) -> tuple[Parameter, ...]:
    """Parameters from keys or parameters; raises `InputError` if there are none, or a key twice."""
    given = [free] if isinstance(free, str | Parameter) else free
    if not (isinstance(given, list | tuple) and given):
        raise InputError("free: name at least one key, such as contact.friction")
    parameters = []
    for item in given:
        if not isinstance(item, str | Parameter):
            raise InputError(f"free {item!r}: give a key or a jbeamshell.identify.Parameter")
        parameters.append(Parameter(item) if isinstance(item, str) else item)
    keys = [parameter.key for parameter in parameters]
    if len(set(keys)) < len(keys):
        raise InputError(f"free = {keys}: names a key twice; name each once")
    return tuple(parameters)


def is_number(value: Any) -> bool:
    """True for a finite real number, which True and False are not."""
    number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    return number and bool(abs(value) <= sys.float_info.max)  # a whole number may be larger

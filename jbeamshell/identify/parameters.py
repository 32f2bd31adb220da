"""Free parameters of a fit: their keys, starts, bounds, scales and priors.

A fit knows the keys of the scene, of the rig, of laws of a joint, and of structures.  A bijection
maps an unbounded search space to the open interval of a parameter.
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
from jbeamshell.laws import LAWS, Law, law_named
from jbeamshell.scene.keys import NUMBERS, TABLE, check_key
from jbeamshell.scene.rows import Key

SCALES = ("log", "linear")
FARTHEST = 40.0  # largest coordinate in the search space; beyond it exp overflows or vanishes
INSET = 1e-9  # distance of a box from its open bounds, over its width
AT_BOUND = 1e-3  # distance from a bound, over the box's width, below which a fit ended at it

PREFIX = "rig."
OF_STRUCTURE = "structure."
ANY = -math.inf  # lower bound of a number of any sign


def _row(
    name: str, sentence: str, unit: str, low: float = 0.0, scale: str = "log"
) -> tuple[str, Key]:
    key = PREFIX + name
    return key, Key(key, "number", 0.0, sentence, unit=unit, low=low, scale=scale, closed=True)


RIG: dict[str, Key] = dict(
    (
        _row("compliance", "Compliance of a spring in series.", "length/(force/width)"),
        _row("stiffness", "Stiffness of a spring in parallel.", "(force/width)/length"),
        _row("loss", "Force of damping in parallel at the middle of the cycle.", "force/width"),
        _row("force_zero", "Reading of the force without load.", "force/width", ANY, "linear"),
        _row("displacement_zero", "Reading of the displacement.", "length", ANY, "linear"),
        _row("drift", "Change of the response's reading over the loop.", "mixed", ANY, "linear"),
    )
)


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


class Bijection(NamedTuple):
    """Map from the real line to an open interval; zero maps to the start.

    On the scale t = x or t = log x it is t0 + p without bounds, t_low + (t0 - t_low) exp(p) with
    one bound, and a logistic curve in p with two.

    Attributes
    ----------
    start, low, high : start and bounds of the parameter x
    log : True if the scale is logarithmic
    """

    start: float
    low: float
    high: float
    log: bool

    def value(self, point: float) -> float:
        """Parameter at a point of the search space."""
        return self._unscaled(self._at(float(point))[0])

    def slope(self, point: float) -> float:
        """Derivative of the parameter with respect to the point."""
        t, dt = self._at(float(point))
        return float(dt * self._unscaled(t) if self.log else dt)

    def traced(self, point: Array) -> tuple[Array, Array]:
        """Parameter at a traced point, and the derivative of its scale t there."""
        t, dt = self._at(point, jnp)
        return (jnp.exp(t) if self.log else t), jnp.broadcast_to(jnp.asarray(dt), jnp.shape(point))

    def point(self, value: float) -> float:
        """Inverse of `value`; values on or beyond a bound are moved inside."""
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

    def boxed(self) -> tuple[Bijection, tuple[float, float]]:
        """Bijection on the same scale without bounds, and the bounds as a box in its space."""
        free = Bijection(self.start, 0.0 if self.log else -np.inf, np.inf, self.log)
        low, high = ((self._scaled(b) - self._scaled(self.start)) / self._unit for b in self[1:3])
        inset = INSET * (high - low) if np.isfinite(high - low) else INSET
        return free, (low + inset, high - inset)

    def bound_at(self, value: float) -> float | None:
        """Bound at which a value ended; None if it lies inside."""
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

    def _at(self, point: Any, numbers: Any = np) -> tuple[Any, Any]:
        """Parameter on its scale, and its derivative; ``numbers`` is numpy or jax.numpy."""
        start, low, high = map(self._scaled, (self.start, self.low, self.high))
        if not (self.log or np.isfinite(low) or np.isfinite(high)):
            return start + self._unit * point, self._unit
        p = numbers.clip(point, -FARTHEST, FARTHEST)
        if np.isfinite(low) and np.isfinite(high):
            part = 1.0 / (1.0 + numbers.exp(-p - logit((start - low) / (high - low))))
            return low + (high - low) * part, (high - low) * part * (1.0 - part)
        if np.isfinite(low):
            rise = (start - low) * numbers.exp(p)
            return low + rise, rise
        if np.isfinite(high):
            fall = (high - start) * numbers.exp(-p)
            return high - fall, fall
        return start + self._unit * p, self._unit


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

    def bijection(self, start: float) -> Bijection:
        """Map from the search space; raises `InputError` if the start lies out of bounds."""
        low, high = self.bounds
        if is_of_structure(self.key) and self.low is None and start < 0.0:
            low = ANY
        fix = f"must lie between low = {low:g} and high = {high:g}, both excluded"
        self._require("start", start, low < start < high, fix)
        scale = fitted_row(self.key).scale if self.scale is None else self.scale
        signed = is_of_structure(self.key) and low < 0.0
        return Bijection(start, low, high, scale == "log" and not signed)

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

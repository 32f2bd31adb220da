"""Free parameters of a fit: start, bounds, scale and prior of each."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from jbeamshell.common.checks import shown
from jbeamshell.common.errors import InputError
from jbeamshell.identify.bijection import Bijection
from jbeamshell.identify.rig_keys import RIG, fitted_row, is_of_structure, law_of
from jbeamshell.scene.keys import NUMBERS

SCALES = ("log", "linear")


@dataclasses.dataclass(frozen=True)
class Parameter:
    """Number of the scene, of a law, a structure or the rig that a fit may change.

    Attributes
    ----------
    key : dotted key, such as "contact.friction", "iwan4.chi" or "rig.compliance"
    start : value at which the search starts; None takes the scene's own value
    low, high : bounds, both excluded; None takes the bounds in the table of keys
    scale : "log" for a quantity known by its order of magnitude, or "linear"; None takes the scale
        in the table of keys
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
        low = least if self.low is None else float(self.low)
        return low, most if self.high is None else float(self.high)

    @property
    def bounded(self) -> bool:
        """True if both bounds are finite, so that starts can be spread between them."""
        return bool(np.all(np.isfinite(self.bounds)))

    def bijection(self, start: float) -> Bijection:
        """Map from the search space; raises `InputError` if the start lies out of bounds."""
        low, high = self.bounds
        fix = f"must lie between low = {low:g} and high = {high:g}, both excluded"
        self._require("start", start, low < start < high, fix)
        scale = fitted_row(self.key).scale if self.scale is None else self.scale
        return Bijection(start, low, high, scale == "log")

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

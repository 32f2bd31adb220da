"""A case of comparison: one source's numbers, ours, and how far they may lie apart."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

import jbeamshell as jb

Kind = Literal[
    "closed form", "dissertation", "finite elements", "other program", "second-hand", "measured"
]
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Source:
    """Source of numbers.

    Attributes
    ----------
    citation : author, year, title and place, or an address
    licence : of the numbers; "formula" if a formula was taken, which has none
    opened : sentence on what was read, if it is not the source itself
    """

    citation: str
    licence: str = "formula"
    opened: str = ""


@dataclass(frozen=True)
class Case:
    """One comparison.

    Attributes
    ----------
    name : words by which the command finds it
    kind : what the other numbers are
    source : where they come from
    compared : the quantities
    condition : what decides: how the force enters, plane, stick stiffness
    theirs : their numbers, or a function that reads them
    ours : function of our numbers, as many
    bound : largest difference that is allowed
    each : True if each number counts by its own size, False by the largest of all
    explained : why the difference is above one per cent, if it is
    settings : what was set beyond the problem itself; the defaults fail without it
    fitted : part of the data that was fitted, if any
    held_out : part of the data that was predicted, from 0 to 1
    """

    name: str
    kind: Kind
    source: Source
    compared: str
    condition: str
    theirs: ArrayLike | Callable[[], ArrayLike]
    ours: Callable[[], ArrayLike]
    bound: float
    each: bool = True
    explained: str = ""
    settings: str = ""
    fitted: str = ""
    held_out: float = 0.0

    def run(self) -> Result:
        """Compute our numbers and compare them."""
        begin = time.perf_counter()
        theirs = self.theirs() if callable(self.theirs) else self.theirs
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", jb.DoubtfulWarning)
            ours = self.ours()
        rows = (np.atleast_1d(np.asarray(values, dtype=float)) for values in (theirs, ours))
        return Result(self, *rows, time.perf_counter() - begin)


@dataclass(frozen=True)
class Result:
    """Outcome of a case: both sides' numbers, as many of each, and the seconds that ours took."""

    case: Case
    theirs: Floats
    ours: Floats
    seconds: float

    def __post_init__(self) -> None:
        if self.theirs.shape != self.ours.shape:
            raise ValueError(f"{self.case.name}: {self.theirs.shape} beside {self.ours.shape}")

    @property
    def difference(self) -> float:
        """Largest relative difference; NaN if any number is."""
        size = np.abs(self.theirs) if self.case.each else np.max(np.abs(self.theirs))
        return float(np.max(np.abs(self.ours - self.theirs) / size))

    @property
    def within(self) -> bool:
        """True if the difference is within its bound."""
        return self.difference <= self.case.bound

    def figures(self) -> dict[str, Any]:
        """Result as plain numbers and words for JSON."""
        case = self.case
        words = ("kind", "compared", "condition", "explained", "settings", "fitted", "held_out")
        source = {name: getattr(case.source, name) for name in ("citation", "licence", "opened")}
        return (
            {"name": case.name}
            | {name: getattr(case, name) for name in words}
            | source
            | {
                "theirs": rounded(self.theirs),
                "ours": rounded(self.ours),
                "difference": float(f"{self.difference:.3g}"),
                "bound": case.bound,
                "within": self.within,
                "seconds": round(self.seconds, 1),
            }
        )


def rounded(values: Floats) -> list[float]:
    """Numbers of six digits."""
    return [float(f"{value:.6g}") for value in values]

"""Rows of the table of keys, and the fields of a scene's parts that they declare."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import Any, ClassVar, Self

import equinox as eqx
import jax
import numpy as np

from jbeamshell.common.checks import (
    NOT_NEGATIVE,
    NUMBER,
    POSITIVE,
    as_leaf,
    as_words,
    require,
    require_choice,
    require_count,
)
from jbeamshell.common.pytrees import Tree

MOST_STEPS = 10**6  # largest count of nodes, steps or cycles
AUTO = "auto"  # value of a setting that the scene chooses itself


@dataclasses.dataclass(frozen=True)
class Key:
    """One row of the table.

    Attributes
    ----------
    name : dotted key, such as "contact.friction"
    kind : "number" (a leaf of the scene's pytree: it can be swept, fitted and differentiated),
        "setting" (a number that is fixed when the model is compiled) or "word"
    default : value of the standard strip; None is none
    sentence : meaning, in plain English
    symbol : symbol in TeX, without dollar signs; empty if there is none
    unit : unit in words, such as "length"; "1" is a pure number
    low, high : bounds of the domain, excluded
    closed : True if the bounds themselves are allowed
    scale : "log" for a number that is known by its order of magnitude, else "linear"
    whole : True if the setting is a whole number
    choices : words to choose from; empty if they are checked elsewhere
    former : words of old files, with what to say instead
    table : True if rows of numbers are allowed as well
    open : True if a scene chooses the value where it is `AUTO`, see `jbeamshell.scene.planning`
    through : key of the number that this one is another form of
    fix : fix in the message for a number outside its domain; None is made from the bounds
    """

    name: str
    kind: str
    default: Any
    sentence: str
    symbol: str = ""
    unit: str = "1"
    low: float = 0.0
    high: float = math.inf
    closed: bool = False
    scale: str = "log"
    whole: bool = False
    choices: tuple[str, ...] = ()
    former: tuple[tuple[str, ...], str] = ((), "")
    table: bool = False
    open: bool = False
    through: str = ""
    fix: str | None = None

    @property
    def words(self) -> str:
        """Domain in words, as a fix for a value outside it."""
        if self.fix is not None:
            return self.fix
        if math.isfinite(self.high):
            ends = "included" if self.closed else "excluded"
            return f"must lie between {self.low:g} and {self.high:g} (both {ends})"
        if self.low == 0.0:
            return NOT_NEGATIVE if self.closed else POSITIVE
        return NUMBER if self.low == -math.inf else f"must be a number above {self.low:g}"

    @property
    def optional(self) -> bool:
        """True if a scene may have no value, None, for the key."""
        return self.default is None and not self.through

    @property
    def label(self) -> str:
        """Symbol for a picture, or the name in words where there is none."""
        words = self.name.partition(".")[2].replace("_", " ")
        return f"${self.symbol}$" if self.symbol else words

    def holds(self, values: Any) -> Any:
        """True where numbers lie in the domain; any shape."""
        inside = (values > self.low) & (values < self.high)
        if self.closed:
            inside |= (values == self.low) | (values == self.high)
        return inside & np.isfinite(values)

    def convert(self, value: Any) -> Any:
        """Value as a scene holds it: a floating-point leaf, or plain Python."""
        if self.kind != "number":
            return as_words(value)
        return as_leaf(value, self.name, self.words if self.table else NUMBER)

    def check(self, value: Any) -> None:
        """Raise `InputError` unless a value lies in the domain; traced values and tables pass."""
        if self.open and isinstance(value, str) and value == AUTO:
            return
        if self.kind == "word":
            if self.choices:
                gone, instead = self.former
                require(self.name, value, value not in gone, f"is gone: {instead}")
                require_choice(self.name, value, (*self.choices, *[AUTO] * self.open))
        elif self.whole:
            require_count(self.name, value, int(self.low), int(self.high))
        elif not self.table:
            number = as_leaf(value, self.name, self.words)
            if not isinstance(number, jax.core.Tracer):
                fix = f"give one number, not an array of shape {number.shape}"
                require(self.name, number, number.ndim == 0, fix)
                require(self.name, number, bool(self.holds(np.asarray(number))), self.words)

    @property
    def shown_unit(self) -> str:
        """Unit in the printed table; empty for words."""
        return "" if self.kind == "word" else self.unit

    @property
    def shown_default(self) -> str:
        """Default as a user writes it."""
        if self.default is None:
            return "none"
        if isinstance(self.default, float):
            return "sharp" if math.isinf(self.default) else f"{self.default:g}"
        return ",".join(self.default) if isinstance(self.default, tuple) else str(self.default)


def number(default: float | None, sentence: str, *, left_out: Any = (), **facts: Any) -> Any:
    """Field and row of a number of the scene.

    Parameters
    ----------
    default : value of the standard strip
    sentence : meaning
    left_out : value of the field when it is not given, if that is not the default
    **facts : further entries of the `Key`
    """
    return _field("number", default, sentence, default if left_out == () else left_out, facts)


def setting(default: float | str, sentence: str, **facts: Any) -> Any:
    """Field and row of a number that is fixed when the model is compiled."""
    facts["open"] = default == AUTO
    return _field("setting", default, sentence, default, facts, static=True)


def count(default: int | str, low: int, sentence: str, high: int = MOST_STEPS) -> Any:
    """Field and row of a whole number from low to high, both included."""
    return setting(default, sentence, low=low, high=high, closed=True, whole=True)


def word(default: Any, choices: Any, sentence: str, **facts: Any) -> Any:
    """Field and row of a word, one of some choices."""
    facts |= {"choices": tuple(choices), "open": default == AUTO}
    return _field("word", default, sentence, default, facts, static=True)


def _field(
    kind: str, default: Any, sentence: str, value: Any, facts: Any, static: bool = False
) -> Any:
    row = Key("", kind, default, sentence, **facts)
    return eqx.field(default=value, static=static, metadata={"row": row})


class Part(Tree):
    """Section of the table as a frozen pytree, which converts and checks its values when made."""

    heading: ClassVar[str]

    def __post_init__(self) -> None:
        for name, key in rows(type(self)).items():
            if name not in vars(self):
                continue  # an argument that is no field, which the part checks
            value = getattr(self, name)
            if value is None and getattr(type(self), name) is None:
                continue  # None is what the field holds when it is not given
            value = key.convert(value)
            key.check(value)
            setattr(self, name, value)

    def __check_init__(self) -> None:
        """Raise `InputError` for values that do not go together."""

    def changed(self, **values: Any) -> Self:
        """Copy with other values of its keys."""
        return dataclasses.replace(self, **values)


@functools.cache
def rows(part: type[Part]) -> dict[str, Key]:
    """Rows of a part by the names of its fields, and of arguments that are no field."""
    return {
        name: dataclasses.replace(field.metadata["row"], name=f"{part.heading}.{name}")
        for name, field in part.__dataclass_fields__.items()
        if "row" in field.metadata
    }

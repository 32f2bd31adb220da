"""Pytrees with names and checks."""

from __future__ import annotations

from typing import Any, Self

import equinox as eqx


class Tree(eqx.Module):
    """Frozen dataclass that is a pytree; its attributes are as quick as those of any object.

    Equinox makes a pytree of every method that is taken from an object, which costs a tenth of a
    millisecond, more than most methods do.  Methods of this class are plain methods: pass functions
    to JAX instead.
    """

    __getattribute__ = object.__getattribute__

    def but(self, **values: Any) -> Self:
        """Copy with other values of some fields, which are neither converted nor checked.

        What the object has found of itself and kept is not copied.
        """
        copy, fields = object.__new__(type(self)), self.__dataclass_fields__
        vars(copy).update({k: v for k, v in vars(self).items() if k in fields} | values)
        return copy

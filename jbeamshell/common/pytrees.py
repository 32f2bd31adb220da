"""Pytrees with names and checks."""

from __future__ import annotations

import equinox as eqx


class Tree(eqx.Module):
    """Frozen dataclass that is a pytree; its attributes are as quick as those of any object.

    Equinox makes a pytree of every method that is taken from an object, which costs more than most
    methods do: a tenth of a millisecond.  Nothing here passes methods through transformations.
    """

    __getattribute__ = object.__getattribute__

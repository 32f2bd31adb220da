"""The grammar of CalculiX's input: cards of a keyword and data lines."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np


def card(keyword: str, rows: Iterable[Iterable[object]] = ()) -> str:
    """A keyword with its data lines; numbers to twelve digits, CalculiX reads twenty characters."""
    lines = [", ".join(map(_word, row)) for row in rows]
    return "\n".join([f"*{keyword}", *lines]) + "\n"


def node_set(name: str, nodes: Iterable[object]) -> str:
    """A named set of nodes."""
    return card(f"NSET, NSET={name}", ((node,) for node in nodes))


def equation(terms: Sequence[tuple[int, int, float]]) -> str:
    """A linear constraint: terms of node, direction and factor, of which the first goes."""
    return card("EQUATION", [(len(terms),), *terms])


def normal_behaviour(stiffness: float) -> str:
    """Contact pressure in proportion to the penetration."""
    return card("SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", [(stiffness,)])


def _word(value: object) -> str:
    if isinstance(value, float | np.floating):
        return f"{value:.12g}"
    return str(value)

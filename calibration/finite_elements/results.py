"""Results that CalculiX printed, as arrays over load levels and nodes."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

KINDS = {"displacements": "U", "forces": "RF", "total internal energy": "ELSE"}
HEADING = re.compile(
    r"^\s*(displacements|forces|total internal energy)[^\n]* for set (\S+) and time +(\S+)\s*$",
    re.MULTILINE,
)
LOST_E = re.compile(r"(?<=\d)([+-]\d{3})\b")  # Fortran writes 1.0E-100 as 1.0-100


class Printed(NamedTuple):
    """One quantity of one set of nodes at the load levels reached.

    Attributes
    ----------
    nodes : (n,) numbers of the nodes; empty for a total
    values : (levels, n, 3) components, or (levels,) totals
    """

    nodes: np.ndarray
    values: np.ndarray


def read(text: str, before: int = 0) -> dict[tuple[str, str], Printed]:
    """Printed results by quantity (U, RF, ELSE) and set.

    Only levels that are complete in all sets are returned.

    Parameters
    ----------
    text : of CalculiX's .dat file
    before : the first level's time is one later; those after it follow by unit time
    """
    headings = list(HEADING.finditer(text))
    ends = [*(heading.start() for heading in headings), len(text)][1:]
    tables: dict[tuple[str, str], dict[int, np.ndarray]] = {}
    for heading, end in zip(headings, ends, strict=True):
        kind, time = KINDS[heading[1]], float(heading[3])
        level = round(time) - before
        width = 1 if kind == "ELSE" else 4
        words = LOST_E.sub(r"E\1", text[heading.end() : end]).split()
        if words and len(words) % width == 0:
            table = np.array(words, dtype=float).reshape(-1, width)
            tables.setdefault((kind, heading[2]), {})[level] = table
    sizes = {key: max(len(t) for t in by_time.values()) for key, by_time in tables.items()}
    levels = 0
    while tables and all(len(t.get(levels + 1, ())) == sizes[key] for key, t in tables.items()):
        levels += 1
    return {key: _printed(key[0], t, levels) for key, t in tables.items()}


def _printed(kind: str, by_time: dict[int, np.ndarray], levels: int) -> Printed:
    reached = [by_time[level] for level in range(1, levels + 1)]
    if kind == "ELSE":
        return Printed(np.zeros(0, int), np.array([table[0, 0] for table in reached]))
    if not reached:
        return Printed(np.zeros(0, int), np.zeros((0, 0, 3)))
    return Printed(reached[0][:, 0].astype(int), np.stack([table[:, 1:] for table in reached]))

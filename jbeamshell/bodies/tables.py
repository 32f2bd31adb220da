"""Tables of numbers that users give: nodes, contacts and forces."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jbeamshell.common.checks import require, shown, whole_numbers
from jbeamshell.common.errors import InputError

NODES = "give rows of node, X, Y and Z"


def table_of(key: str, table: ArrayLike, columns: int, fix: str) -> NDArray[np.float64]:
    """Rows of finite numbers of a table; none of an empty one."""
    try:
        values = np.asarray(table, float)
    except (TypeError, ValueError):
        raise InputError(f"{key} = {shown(table)}: is no table of numbers: {fix}") from None
    values = values if values.size else np.zeros((0, columns))
    require(key, values.shape, values.ndim == 2 and values.shape[1] == columns, fix)
    finite = np.all(np.isfinite(values), axis=1)
    require(key, values[~finite], bool(np.all(finite)), "holds NaN or infinity: " + fix)
    return values


def node_table(nodes: ArrayLike) -> tuple[list[int], NDArray[np.float64]]:
    """Numbers (n) and places (n, 3) of a table of nodes."""
    table = table_of("nodes", nodes, 4, NODES)
    numbers = whole_numbers("nodes", table[:, 0]).tolist()
    fix = "names a node twice"
    require("nodes", len(numbers), len(set(numbers)) == len(numbers) > 0, fix)
    return numbers, table[:, 1:]

"""Tables of a joint: CSV or MATLAB, written and read back to the last digit."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import require
from jbeamshell.common.files import csv_text
from jbeamshell.dynamics.export.element import Element
from jbeamshell.measured.read_table import read_table

COLUMNS = ("displacement", "force", "stiffness", "limit")
SIDES = ("pull", "push")
ABOUT = ("width", "capacity")  # the same in all rows


def write(element: Element, draft: Path) -> None:
    """Write the backbone, and the sliders beside it; the last row holds the spring.

    The name of the file chooses: ``.mat`` for MATLAB, anything else for CSV.
    """
    notes = [
        "displacement, force: points of the first loading.  stiffness, limit: each slider; the",
        "last row is the spring, which has no limit.  capacity: force of gross slip, if it is",
        "known.  pull, push: displacements of each way at the forces, if they differ.",
    ]
    joint = element.joint
    capacity = joint.capacity if np.isfinite(joint.capacity) else np.nan
    given = {
        "displacement": joint.displacements,
        "force": joint.forces,
        "stiffness": np.append(joint.springs, joint.spring),
        "limit": np.append(joint.limits, np.nan),
        **({} if joint.sides is None else dict(zip(SIDES, joint.sides, strict=True))),
        "width": np.full(joint.forces.shape, joint.width),
        "capacity": np.full(joint.forces.shape, capacity),
    }
    columns = {name: np.asarray(column, float) for name, column in given.items()}
    if draft.suffix.lower() == ".mat":
        from scipy.io import savemat

        named = {name: column[:, None] for name, column in columns.items()}
        savemat(draft, {"about": [element.title, *element.facts, *notes], **named}, appendmat=False)
        return
    rows = np.stack(list(columns.values()), 1).tolist()
    cells = [["" if np.isnan(x) else repr(x) for x in row] for row in rows]
    text = element.comment("#", notes) + csv_text(tuple(columns), cells)
    draft.write_text(text, encoding="utf-8")


def read(
    path: str | os.PathLike[str],
) -> tuple[NDArray[np.float64], NDArray[np.float64], dict[str, Any]]:
    """Displacements and forces of the backbone in a table, and what else it says of the joint.

    Returns
    -------
    displacements and forces (k,), and a dictionary of width, capacity and sides, as far
    as the table has them

    Raises
    ------
    InputError
        if the file cannot be read, or holds no such columns
    """
    wanted = COLUMNS[:2]

    def recognised(titles: Sequence[str]) -> bool:
        return all(name in titles for name in wanted)

    table = read_table(path, recognised)
    fix = f"give columns {' and '.join(wanted)}, as joint.export('table', path) does"
    require(str(path), table.titles, recognised(table.titles), fix)

    def columns(names: Sequence[str]) -> NDArray[np.float64]:
        places = [table.titles.index(name) for name in names]
        table.units(places)
        return table.numbers(places).T

    u, f = _whole(path, columns(wanted))
    about: dict[str, Any] = {}
    for name in ABOUT:
        if name in table.titles:
            value = float(columns([name])[0, 0])
            about |= {name: value} if np.isfinite(value) else {}
    if all(name in table.titles for name in SIDES):
        about["sides"] = _whole(path, columns(SIDES))
    return u, f, about


def _whole(path: str | os.PathLike[str], columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Columns of a table, all of whose numbers must be finite."""
    finite = bool(np.all(np.isfinite(columns)))
    require(str(path), "a number is missing", finite, "export the joint again")
    return columns

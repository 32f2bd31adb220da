"""Tables of a joint: CSV or MATLAB, written and read back to the last digit."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import require
from jbeamshell.common.files import csv_text
from jbeamshell.dynamics.export.element import Element
from jbeamshell.measured.read_table import read_table

COLUMNS = ("displacement", "force", "stiffness", "limit")


def write(element: Element, draft: Path) -> None:
    """Write the backbone, and the sliders beside it; the last row holds the spring.

    The name of the file chooses: ``.mat`` for MATLAB, anything else for CSV.
    """
    notes = [
        "displacement, force: points of the first loading.  stiffness, limit: each slider; the",
        "last row is the spring, which has no limit.",
    ]
    stiffness = np.append(element.stiffness, element.spring)
    limit = np.append(element.limit, np.nan)
    columns = (element.displacement, element.force, stiffness, limit)
    if draft.suffix.lower() == ".mat":
        from scipy.io import savemat

        about = {"about": [element.title, *element.facts, *notes], "width": element.width}
        named = {name: column[:, None] for name, column in zip(COLUMNS, columns, strict=True)}
        savemat(draft, {**about, **named}, appendmat=False)
        return
    cells = [["" if np.isnan(x) else repr(x) for x in row] for row in np.stack(columns, 1).tolist()]
    draft.write_text(element.comment("#", notes) + csv_text(COLUMNS, cells), encoding="utf-8")


def read(path: str | os.PathLike[str]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Displacements and forces of the backbone in a table.

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
    places = [table.titles.index(name) for name in wanted]
    table.units(places)
    u, f = table.numbers(places).T
    whole = bool(np.all(np.isfinite([u, f])))
    require(str(path), "a number is missing", whole, "export the joint again")
    return u, f

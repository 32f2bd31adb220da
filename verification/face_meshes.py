"""Stated errors of the mesh of a face beside true ones: a rounded punch, and blocks on each other.

The punch has a closed form, see `calibration.finite_elements.punch`.  The truth of the blocks is
their loss on 16 x 8 x 4 quadratic bricks.  Blocks are pressed over all of their top, or on a patch
in its middle, and pulled at an end, along X or across it.
"""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

import jbeamshell as jb
from calibration.finite_elements import punch
from calibration.finite_elements.boxes import SIZES, two_blocks
from calibration.running import as_text

ELEMENTS = (6, 8, 12, 16, 24)  # over the contact of the punch
SHARES = (0.3, 0.6, 0.9)  # of the punch's gross slip
MESHES = (  # upper, lower (None: the same), quadratic
    ((6, 3, 2), None, False),
    ((9, 5, 3), None, False),
    ((12, 6, 3), None, False),
    ((16, 8, 4), None, False),
    ((12, 6, 3), (13, 7, 3), False),
    ((9, 5, 2), (8, 4, 2), False),
    ((6, 3, 2), (7, 4, 2), False),
    ((4, 2, 1), None, True),
    ((6, 3, 2), None, True),
    ((8, 4, 2), None, True),
    ((12, 6, 3), None, True),
)
FINE = ((16, 8, 4), None, True)
FRICTION, PRESS = 0.25, 12e3
Record = dict[str, Any]


def row(history: jb.ContactHistory, truth: float, **words: Any) -> Record:
    """True and stated errors of a loop's dissipation, over its own."""
    lost = float(history.dissipation)
    return words | {
        "points": int(history.places.shape[0]),
        "D": lost,
        "error": abs(truth / lost - 1.0),
        "stated": float(history.dissipation_error),
    }


def punches() -> Iterator[Record]:
    """Rows of the punch."""
    for quadratic in (True, False):
        for elements in ELEMENTS:
            made = punch.bodies(elements, quadratic)
            for part in SHARES:
                force = part * punch.FRICTION * punch.FORCE
                history, truth = punch.loop(made, force), punch.WIDTH * punch.loss(force)
                yield row(history, truth, elements=elements, quadratic=quadratic, part=part)


def blocks(parts: tuple[float, ...], **options: Any) -> Iterator[Record]:
    """Rows of two blocks.

    Parameters
    ----------
    parts : loads over friction times pressure
    options : of `calibration.finite_elements.boxes.two_blocks`
    """
    truths: dict[float, float] = {}
    for mesh in (FINE, *MESHES):
        upper, lower, quadratic = mesh
        made = two_blocks(*mesh, **options)
        for part in parts:
            load = {"friction": FRICTION, "bolts": PRESS, "amplitude": part * FRICTION * PRESS}
            history = jb.solve_contact(*made, **load, throw=False)
            truth = truths.setdefault(part, float(history.dissipation))
            words = {"upper": upper, "lower": lower, "quadratic": quadratic, "part": part}
            if mesh != FINE and float(history.dissipation) > 0.0:
                yield row(history, truth, **words)


def measured(rows: Iterator[Record]) -> Record:
    """Rows of a problem and their summary."""
    found = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", jb.DoubtfulWarning)
        for one in rows:
            found.append(one)
            print(as_text(one), flush=True)
    return {"summary": summary(found), "rows": found}


def summary(rows: list[Record]) -> Record:
    """How many errors are within the stated ones, and how much larger those are."""
    over = np.array([each["stated"] / each["error"] for each in rows])
    return {
        "rows": len(rows),
        "held": int(np.sum(over >= 1.0)),
        "held nearly": int(np.sum(over >= 0.8)),
        "least": float(np.min(over)),
        "median": float(np.median(over)),
        "largest": float(np.max(over)),
    }


SLIPS = (0.75, 0.85, 0.92)  # of all that friction bears
PROBLEMS: dict[str, Callable[[], Iterator[Record]]] = {
    "punch": punches,
    "blocks": functools.partial(blocks, SLIPS),
    "plates": functools.partial(blocks, SLIPS, sizes=(60.0, 30.0, 6.0)),
    "patch": functools.partial(blocks, SLIPS, patch=0.45),
    "cubes": functools.partial(blocks, (0.8, 0.88, 0.94), sizes=(30.0, 30.0, 30.0)),
    "across": functools.partial(blocks, (0.3, 0.38, 0.44), sizes=SIZES, way=2),
}


def _part(problem: Callable[[], Iterator[Record]]) -> Callable[[], Record]:
    return lambda: measured(problem())


PARTS = {name: _part(problem) for name, problem in PROBLEMS.items()}


def tell(record: Record) -> str:
    """Number of stated errors that hold, of each problem and of all."""
    rows = [row for name in PARTS if name in record for row in record[name]["rows"]]
    found = {name: record[name]["summary"] for name in PARTS if name in record}
    return as_text(found | {"all": summary(rows)})

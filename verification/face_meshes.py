"""Stated errors of the mesh of a face beside true ones: a rounded punch, and two blocks.

The punch has a closed form, see `calibration.finite_elements.punch`.  The truth of the blocks, of
60 x 30 x 15 mm, is their loss on 12 x 6 x 3 quadratic bricks.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any

import jax
import numpy as np

import jbeamshell as jb
from calibration.finite_elements import punch
from calibration.finite_elements.boxes import two_blocks
from calibration.running import as_text

ELEMENTS = (6, 8, 12, 16, 24)  # over the contact of the punch
SHARES = (0.3, 0.6, 0.9)  # of the punch's gross slip
MESHES = (  # upper, lower (None: the same), quadratic
    ((6, 3, 2), None, False),
    ((12, 6, 3), None, False),
    ((12, 6, 3), (13, 7, 3), False),
    ((9, 5, 2), (8, 4, 2), False),
    ((6, 3, 2), (7, 4, 2), False),
    ((4, 2, 1), None, True),
    ((6, 3, 2), None, True),
    ((8, 4, 2), None, True),
)
FINE = ((12, 6, 3), None, True)
FORCES = (1800.0, 2300.0, 2700.0)  # of the blocks, N; all slips at 3,000
BLOCKS: dict[str, Any] = {"friction": 0.25, "bolts": 12e3, "throw": False}
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
            jax.clear_caches()


def blocks() -> Iterator[Record]:
    """Rows of the blocks."""
    truths: dict[float, float] = {}
    for upper, lower, quadratic in (FINE, *MESHES):
        made = two_blocks(upper, lower, quadratic)
        for force in FORCES:
            history = jb.solve_contact(*made, amplitude=force, **BLOCKS)
            truth = truths.setdefault(force, float(history.dissipation))
            words = {"upper": upper, "lower": lower, "quadratic": quadratic, "force": force}
            if (upper, quadratic) != (FINE[0], FINE[2]):
                yield row(history, truth, **words)
        jax.clear_caches()


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


PARTS = {"punch": lambda: measured(punches()), "blocks": lambda: measured(blocks())}


def tell(record: Record) -> str:
    """How many stated errors hold."""
    return as_text({name: record[name]["summary"] for name in PARTS if name in record})

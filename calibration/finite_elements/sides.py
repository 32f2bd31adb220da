"""Strip of three dimensions whose sides are held or free, beside plane strain and plane stress.

A strip of C3D8I bricks lies on a rigid base under an even pressure.  Its far end cannot move along
X; the loaded end has an even traction.  With its sides held, and all nodes with them, nothing moves
across the width.  The matrices are those of CalculiX, the contact that of `solve_contact`.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import jbeamshell as jb
from calibration.finite_elements.bricks import (
    MODULUS,
    POISSON,
    box,
    cards_of,
    material,
    matrix,
    shares,
)
from calibration.finite_elements.cards import card

LENGTH, THICK, FRICTION, PRESSURE = 60.0, 6.0, 0.2, 10.0  # mm, MPa
WIDTHS = (1.0, 4.0, 10.0)  # over the thickness
LOADS = (0.3, 0.6, 0.9)  # over gross slip
COUNTS = (30, 6, 3)  # bricks along, across and through the strip
GROSS = FRICTION * PRESSURE * LENGTH


def body(width: float, free: bool) -> jb.Substructure:
    """Strip on its face; its forces are those of the whole width."""
    made = box(COUNTS, (LENGTH, width, THICK))
    number = made.number
    face, top, end, far = (
        nodes.ravel() for nodes in (number[:, :, 0], number[:, :, -1], number[-1], number[0])
    )
    areas = shares(COUNTS[:2], (LENGTH, width))
    press = np.column_stack([top, np.full(top.size, 3), -PRESSURE * areas])
    pull = np.column_stack([end, np.full(end.size, 1), shares(COUNTS[1:], (width, THICK)) / THICK])
    held = [number[0, COUNTS[1] // 2, 0]] if free else number.ravel()
    supports = [(node, 1, 1) for node in far] + [(node, 2, 2) for node in held]
    deck = cards_of(made, "STRIP", kind="C3D8I") + material() + card("BOUNDARY", supports)
    with tempfile.TemporaryDirectory() as name:
        model = matrix(deck, Path(name))
    nodes = np.column_stack([face, made.at(face)])
    return model.condensed(nodes, pull=pull, press=[press], tributary=areas)


def measure() -> dict[str, Any]:
    """Energy of a cycle and secant stiffness, per width, for all widths and loads."""
    rows = []
    for sides, width in [("held", 1.0)] + [("free", width) for width in WIDTHS]:
        strip = body(width * THICK, sides == "free")
        for load in LOADS:
            history = jb.solve_contact(
                strip, friction=FRICTION, amplitude=load * GROSS, bolts=1.0, throw=False
            )
            figures = {
                "dissipation": float(history.dissipation) / (width * THICK),
                "secant_stiffness": float(history.secant_stiffness) * width * THICK,
                "estimate": float(history.dissipation_error),
            }
            rows.append({"sides": sides, "width": width, "load": load} | figures)
    return {"rows": rows}


def plane(kind: str, load: float) -> jb.History:
    """The same strip in the plane, in "strain" or "stress"."""
    strip = {"length": LENGTH, "half_height": THICK / 2, "youngs_modulus": MODULUS}
    values = {f"strip.{key}": value for key, value in strip.items()} | {
        "strip.poisson_ratio": POISSON,
        "strip.plane": kind,
        "strip.far_end": "guided",
        "contact.friction": FRICTION,
        "contact.pressure": PRESSURE,
        "load.amplitude": load * GROSS,
        "load.entry": "traction",
        "model.section": "plane",
    }
    return jb.solve(jb.Scene().replace(values))


def tell(record: dict[str, Any]) -> str:
    """Table of the differences."""
    lines = ["sides  width/2H  load  D to its plane  stiffness to its plane"]
    for row in record["rows"]:
        beside = plane("strain" if row["sides"] == "held" else "stress", row["load"])
        work = row["dissipation"] / float(beside.dissipation) - 1.0
        stiffness = row["secant_stiffness"] / float(beside.secant_stiffness) - 1.0
        words = f"{row['sides']:5}  {row['width']:8g}  {row['load']:4g}"
        lines.append(f"{words}  {work:14.2%}  {stiffness:22.2%}")
    return "\n".join(lines)

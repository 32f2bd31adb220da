"""Example that ships: decks of a bolted lap for CalculiX, and the matrices that it wrote of them.

`python -m calibration.finite_elements.bolted_lap` writes them to calibration/data/bolted_lap.  The
plates are those of `calibration.finite_elements.flange`, of two layers of C3D8I bricks; the end of
the lower one is clamped, and that of the upper one is free.  The inner displacements of the bricks
are eliminated from the matrices that ship, which have 12 digits.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from calibration.finite_elements.bricks import MATRIX_STEP, cards_of, material, run
from calibration.finite_elements.cards import card
from calibration.finite_elements.flange import BOLTS, WASHER, Plate, flange, supports
from jbeamshell.bodies.deck import Deck
from jbeamshell.bodies.stiffness_model import StiffnessModel
from jbeamshell.measured.example import data_folder

LAP, LAYERS = (12, 6), 2  # bricks along and across the lap, and through a plate
BELOW, ABOVE, AHEAD = slice(4), slice(4, 8), [1, 2, 5, 6]  # corners of the sides S1, S2 and S4
DIGITS = 12
SAYS = "** {} plate of a bolted lap: mm, N, t. CalculiX writes {}.sti, .mas and .dof.\n"


def surfaces(plate: Plate, outer: np.ndarray, upper: bool) -> str:
    """Surfaces of the lap, of the washers on ``outer`` nodes, and of the pulled end."""
    made = plate.bricks
    inside, outside = (BELOW, ABOVE) if upper else (ABOVE, BELOW)
    sides = {"FACE": (plate.face, inside)}
    found = {
        name: (made.with_corner_in(nodes, corners), "S1" if corners == BELOW else "S2")
        for name, (nodes, corners) in sides.items()
    }
    on_outer = made.with_corner_in(outer.ravel(), outside)
    middles = np.mean(made.at(made.bricks[on_outer][:, outside]), axis=1)[:, :2]
    for k, at in enumerate(BOLTS, start=1):
        below = on_outer[np.linalg.norm(middles - at, axis=1) < WASHER]
        found[f"BOLT_{k}"] = below, "S2" if outside == ABOVE else "S1"
    if upper:
        ahead = np.isin(made.bricks[:, AHEAD], plate.far).all(axis=1)
        found["END"] = np.flatnonzero(ahead), "S4"
    return "".join(
        card(f"SURFACE, NAME={name}", ((1 + element, side) for element in elements))
        for name, (elements, side) in found.items()
    )


def decks() -> dict[str, str]:
    """Decks of both plates by name."""
    made = flange(LAP, LAYERS)
    beyond = made.upper.bricks.number.shape[0] - 1 - LAP[0]
    found = {}
    for name, plate in (("upper", made.upper), ("lower", made.lower)):
        upper = name == "upper"
        number = plate.bricks.number
        outer = number[: LAP[0] + 1, :, -1] if upper else number[beyond:, :, 0]
        found[name] = (
            SAYS.format(name.capitalize(), name)
            + cards_of(plate.bricks, "PLATE", kind="C3D8I")
            + material()
            + surfaces(plate, outer, upper)
            + ("" if upper else supports(plate, 1))
            + MATRIX_STEP
        )
    return found


def rounded(matrix: Any) -> np.ndarray:
    """Dense matrix, rounded to a part of its largest entry, which takes half of the space."""
    full = matrix.toarray()
    unit = 10.0 ** (np.ceil(np.log10(np.max(np.abs(full)))) - DIGITS)
    return np.round(full / unit) * unit


def main() -> None:
    """Write the decks, run CalculiX on them, and store what it wrote."""
    target = data_folder() / "bolted_lap"
    target.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for body, deck in decks().items():
            (target / f"{body}.inp").write_text(deck, encoding="ascii")
            run(deck, folder, body)
            model = StiffnessModel.read(folder / f"{body}.sti", mass=folder / f"{body}.mas")
            nodes = list(Deck.read(target / f"{body}.inp").places)
            model = model.reduced(np.intersect1d(nodes, model.dofs[:, 0]), modes=0)
            matrices = {"stiffness": rounded(model.matrix), "mass": rounded(model.mass)}
            np.savez_compressed(target / f"{body}.npz", dofs=model.dofs, **matrices)
            print(f"{body}: {len(model.dofs)} rows")


if __name__ == "__main__":
    main()

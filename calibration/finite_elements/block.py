"""Block of bricks on a rigid base: its matrix from CalculiX, and its contact here and there.

The bricks (C3D8) are the same in both.  CalculiX's contact is that of nodes (`TYPE=NODE TO
SURFACE`), whose springs have the softness that is given here too.  The block is pressed unevenly,
and a torque about the normal with a force beside it turns it to and fro.

`python -m calibration.finite_elements.block` compares dissipation and stiffness.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from calibration.finite_elements.bricks import (
    Box,
    box,
    cards_of,
    contact,
    displacement_there,
    loop_figures,
    material,
    matrix,
    run_both,
    shares,
    steps,
)
from calibration.finite_elements.cards import card
from jbeamshell.bodies.substructure import Substructure

LOAD: dict[str, Any] = {"friction": 0.3, "amplitude": 700.0, "bolts": 10.0, "cycles": 1}


class Block(NamedTuple):
    """Bricks of a block over the face z = 0, and what loads it.

    Attributes
    ----------
    bricks : nodes and bricks
    areas : (n,) of the nodes at z = 0
    pull, press : (k, 3) node, direction and force
    """

    bricks: Box
    areas: np.ndarray
    pull: np.ndarray
    press: np.ndarray

    @property
    def face(self) -> np.ndarray:
        """Numbers (n,) of the nodes at z = 0."""
        return self.bricks.number[:, :, 0].ravel()


def block(counts: tuple[int, int, int], sizes: tuple[float, float, float]) -> Block:
    """Block of even bricks, pressed on top with a pressure that fades to the edges."""
    made = box(counts, sizes)
    areas = shares(counts[:2], sizes[:2])
    x, y = (made.at(made.number[:, :, 0])[..., k].ravel() - 0.5 * sizes[k] for k in (0, 1))
    top = made.number[:, :, -1].ravel()
    pressure = (1.0 - 1.2 * (2.0 * x / sizes[0]) ** 2) * (1.0 - 0.5 * (2.0 * y / sizes[1]) ** 2)
    press = np.column_stack([top, np.full(top.size, 3), -pressure * areas])
    share = areas / np.sum(areas)
    arm = np.sum(share * (x**2 + y**2))
    pull = np.concatenate(
        [
            np.column_stack([top, np.full(top.size, 1), share * (0.3 - y * sizes[0] / 4 / arm)]),
            np.column_stack([top, np.full(top.size, 2), share * x * sizes[0] / 4 / arm]),
        ]
    )
    return Block(made, areas, pull, press)


def body_of(made: Block, folder: Path, program: str | None = None) -> Substructure:
    """Block as a body on its face, its matrix from CalculiX."""
    model = matrix(cards_of(made.bricks, "BLOCK") + material(), folder, program)
    nodes = np.column_stack([made.face, made.bricks.at(made.face)])
    return model.condensed(nodes, pull=made.pull, press=[made.press], tributary=made.areas)


def contact_deck(made: Block, loads: np.ndarray) -> str:
    """Deck of the block's contact: pressing, then the loads (levels,), a step for each."""
    number = made.bricks.number
    counts = (number.shape[0] - 1, number.shape[1] - 1, 1)
    extent = np.ptp(made.bricks.places, axis=0)
    first = len(made.bricks.bricks) + 1
    base = box(counts, (*extent[:2], 1.0), (0.0, 0.0, -1.0), first=int(number.max()) + 1)
    of_face = 1 + made.bricks.with_corner_in(made.face, slice(4))
    return (
        cards_of(made.bricks, "BLOCK")
        + cards_of(base, "BASE", first)
        + material()
        + contact(LOAD["friction"], of_face, range(first, first + len(base.bricks)))
        + card("BOUNDARY", [("BASE", 1, 3)])
        + steps([made.press], made.pull, LOAD["bolts"], loads, "BLOCK")
    )


def main(counts: tuple[int, int, int] = (8, 4, 3), steps: int = 16) -> None:
    """Compare the loop of the first cycle, its area and its stiffness; times beside them."""
    jax.config.update("jax_enable_x64", True)
    made = block(counts, (40.0, 20.0, 10.0))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        options = LOAD | {"steps_per_half_cycle": steps}
        body = body_of(made, folder)
        history, text, (ours, theirs) = run_both(
            [body], options, lambda loads: contact_deck(made, loads), folder
        )
    moved = np.asarray(history.displacement), displacement_there(made.pull, "BLOCK", text)
    here, there = (loop_figures(history, each) for each in moved)
    off = ", ".join(f"{key} {there[key] / value - 1.0:+.3%}" for key, value in here.items())
    print(f"{body.places.shape[0]} pairs; CalculiX - here: {off.replace('_', ' ')}")
    print(f"seconds: CalculiX {theirs:.1f}, here {ours:.3f}, ratio {theirs / ours:.0f}")


if __name__ == "__main__":
    main()

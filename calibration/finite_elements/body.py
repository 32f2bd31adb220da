"""Strip meshed in CalculiX, its stiffness matrix taken from there, and its hysteresis loop here.

The deck asks for ``*FREQUENCY, SOLVER=MATRIXSTORAGE``, which writes the stiffness matrix of the
whole model (``.sti``) and the node and direction of each row (``.dof``); no contact is in the deck.
A slice of unit width between two planes that keep u_z = 0 is in plane strain.

`python -m calibration.finite_elements.body` compares the loop with that of plane elasticity.
"""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np

import jbeamshell as jb
from calibration.finite_elements.cards import card, node_set
from calibration.finite_elements.mesh import weights
from calibration.finite_elements.program import find_program
from jbeamshell.mechanics.elements import vertices

GRADING = 1e-4, None, 0.3, 0.15, 0.3  # of the elements along the contact, see `vertices`
ROWS = 17  # of nodes over the height
RISE = 1e3  # of the element height from the contact to the top


class Slice(NamedTuple):
    """Input deck of a strip, and the tables that say what its nodes do.

    Attributes
    ----------
    deck : text of the input deck
    contact : (k, 2) node and X
    pull, press : (k, 3) node, direction and force of the unit end load, and of the pressure
    """

    deck: str
    contact: np.ndarray
    pull: np.ndarray
    press: np.ndarray


def strip_slice(scene: jb.Scene, nodes: int, rows: int = ROWS) -> Slice:
    """Slice of a strip under an even pressure, held at X = 0, pulled evenly, of graded bricks."""
    strip, height = scene.strip, 2.0 * float(scene.strip.half_height)
    x = np.asarray(vertices(nodes - 1, strip.length, strip.half_height, *GRADING))
    y = height * np.expm1(np.linspace(0.0, np.log1p(RISE), rows)) / RISE
    front = np.arange(1, x.size * rows + 1).reshape(x.size, rows)
    both = np.stack([front, front + front.size])
    table = [
        (both[k, i, j], x[i], y[j], float(k))
        for k in (0, 1)
        for i in range(x.size)
        for j in range(rows)
    ]
    corners = [both[:, :-1, :-1], both[:, 1:, :-1], both[:, 1:, 1:], both[:, :-1, 1:]]
    bricks = np.stack([corner[k].ravel() for k in (0, 1) for corner in corners], axis=1)
    numbers = np.arange(1, len(bricks) + 1)
    deck = (
        card("NODE, NSET=ALL", table)
        + card("ELEMENT, TYPE=C3D8I, ELSET=STRIP", np.column_stack([numbers, bricks]))
        + node_set("FAR", both[:, 0].ravel())
        + card("MATERIAL, NAME=STRIP")
        + card("ELASTIC", [(strip.youngs_modulus, strip.poisson_ratio)])
        + card("DENSITY", [(1.0,)])  # CalculiX asks for it and writes a mass matrix, unused here
        + card("SOLID SECTION, ELSET=STRIP, MATERIAL=STRIP")
        + card("BOUNDARY", [("ALL", 3, 3), ("FAR", 1, 1)])
        + card("STEP")
        + card("FREQUENCY, SOLVER=MATRIXSTORAGE", [(1,)])
        + card("END STEP")
    )
    half_x, half_y = 0.5 * weights(x, 1), 0.5 * weights(y, 1) / height
    pressure = float(scene.contact.pressure)
    return Slice(
        deck,
        np.array([(n, p) for face in both for n, p in zip(face[:, 0], x, strict=True)]),
        np.array([(n, 1, f) for face in both for n, f in zip(face[-1], half_y, strict=True)]),
        np.array(
            [
                (n, 2, -pressure * f)
                for face in both
                for n, f in zip(face[:, -1], half_x, strict=True)
            ]
        ),
    )


def body_of(made: Slice, folder: Path, program: str | None = None) -> jb.Substructure:
    """Substructure of a slice, by CalculiX in a folder."""
    path = find_program(program)
    (folder / "strip.inp").write_text(made.deck, encoding="ascii")
    subprocess.run([path, "strip"], cwd=folder, check=True, capture_output=True)
    model = jb.StiffnessModel.read(folder / "strip.sti")
    return model.condensed(made.contact, pull=made.pull, press=[made.press])


def main(nodes: int = 49) -> None:
    """Compare dissipation and stiffness with the section ``plane`` on as many contact nodes."""
    jax.config.update("jax_enable_x64", True)
    values = {"model.section": "plane", "model.nodes": nodes, "load.entry": "traction"}
    scene = jb.Scene().replace(values)
    with tempfile.TemporaryDirectory() as folder:
        body = body_of(strip_slice(scene, nodes), Path(folder))
    load = {"friction": scene.contact.friction, "amplitude": scene.load.amplitude}
    found = jb.solve_contact(body, **load, assembly="frictionless")
    plane = jb.solve(scene)
    for name in ("dissipation", "secant_stiffness"):
        ours, theirs = float(getattr(found, name)), float(getattr(plane, name))
        print(f"{name}: {ours:.6g}, plane {theirs:.6g}, {100.0 * (ours / theirs - 1.0):+.2f} %")


if __name__ == "__main__":
    main()

"""Block of bricks on a rigid base: its matrix from CalculiX, and its contact here and there.

The bricks (C3D8) are the same in both.  CalculiX's contact is that of nodes (`TYPE=NODE TO
SURFACE`), whose springs have the softness that is given here too.  The block is pressed unevenly,
and a torque about the normal with a force beside it turns it to and fro.

`python -m calibration.finite_elements.block` compares dissipation and stiffness.
"""

from __future__ import annotations

import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from calibration.finite_elements.cards import card
from calibration.finite_elements.program import find_program
from calibration.finite_elements.results import read
from jbeamshell.contact_face.body import FaceBody
from jbeamshell.contact_face.solve import solve_faces
from jbeamshell.contact_line.stiffness_model import StiffnessModel

MODULUS, POISSON = 210e3, 0.3
STEEL = [(MODULUS, POISSON)]
SOFTNESS = 0.3 / MODULUS  # of the pairs, displacement per stress
SMALLEST_PART = 1e-3  # of a level, below which CalculiX gives up
TIGHTENED = 8  # steps of the pressing, as `solve_faces` takes
LOAD: dict[str, Any] = {"friction": 0.3, "amplitude": 700.0, "bolts": 10.0, "cycles": 1}
TENSION = 1e-3  # stress that CalculiX lets an open pair carry


class Block(NamedTuple):
    """Bricks of a block over the face z = 0, and what loads it.

    Attributes
    ----------
    places : (N, 3) of its nodes, numbered from 1
    bricks : (k, 8) numbers of their corners
    face : numbers of the nodes at z = 0
    areas : (n,) of them
    pull, press : (k, 3) node, direction and force
    """

    places: np.ndarray
    bricks: np.ndarray
    face: np.ndarray
    areas: np.ndarray
    pull: np.ndarray
    press: np.ndarray


def block(counts: tuple[int, int, int], sizes: tuple[float, float, float]) -> Block:
    """Block of even bricks, pressed on top with a pressure that fades to the edges."""
    axes = [np.linspace(0.0, size, count + 1) for size, count in zip(sizes, counts, strict=True)]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    number = np.arange(1, places[..., 0].size + 1).reshape(places.shape[:3])
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    corners += [(a, b, 1) for a, b, _ in corners]
    nx, ny, nz = counts
    bricks = np.stack(
        [number[a : a + nx, b : b + ny, c : c + nz].ravel() for a, b, c in corners], axis=1
    )
    shares = [np.convolve(np.diff(axis), [0.5, 0.5]) for axis in axes]
    areas = np.outer(shares[0], shares[1]).ravel()
    x, y = (places[:, :, 0, k].ravel() - 0.5 * sizes[k] for k in (0, 1))
    top, face = number[:, :, -1].ravel(), number[:, :, 0].ravel()
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
    return Block(places.reshape(-1, 3), bricks, face, areas, pull, press)


def cards_of(made: Block) -> str:
    """Nodes, bricks and material of a block."""
    numbers = np.arange(1, len(made.bricks) + 1)
    return (
        card("NODE, NSET=ALL", [(i + 1, *place) for i, place in enumerate(made.places)])
        + card("ELEMENT, TYPE=C3D8, ELSET=BLOCK", np.column_stack([numbers, made.bricks]))
        + card("MATERIAL, NAME=STEEL")
        + card("ELASTIC", STEEL)
        + card("DENSITY", [(7.85e-9,)])
        + card("SOLID SECTION, ELSET=BLOCK, MATERIAL=STEEL")
    )


def body_of(made: Block, folder: Path, program: str | None = None) -> FaceBody:
    """Block as a body on its face, its matrix from CalculiX."""
    deck = cards_of(made) + card("STEP") + card("FREQUENCY, SOLVER=MATRIXSTORAGE", [(1,)])
    (folder / "matrix.inp").write_text(deck + card("END STEP"), encoding="ascii")
    subprocess.run([find_program(program), "matrix"], cwd=folder, check=True, capture_output=True)
    model = StiffnessModel.read(folder / "matrix.sti")
    nodes = np.column_stack([made.face, made.places[made.face - 1]])
    return FaceBody.of(model, nodes, pull=made.pull, press=[made.press], areas=made.areas)


def contact_deck(made: Block, loads: np.ndarray) -> str:
    """Deck of the block's contact: pressing, then the loads (levels,), a step for each."""
    n, count = len(made.places), len(made.bricks)
    base = n + 1 + np.arange(made.face.size)
    grid = {node: k for k, node in enumerate(made.face.tolist())}
    under = made.places[made.face - 1] - [0.0, 0.0, 1.0]
    below = base + made.face.size
    upper = made.places[made.face - 1]
    bricks = [b for b in made.bricks.tolist() if b[0] in grid]
    ground = [[below[grid[k]] for k in b[:4]] + [base[grid[k]] for k in b[:4]] for b in bricks]
    numbers = count + 1 + np.arange(len(ground))
    of_face = [i + 1 for i, b in enumerate(made.bricks.tolist()) if b[0] in grid]
    deck = (
        cards_of(made)
        + card("NODE, NSET=BASE", [(i, *p) for i, p in zip(base, upper, strict=True)])
        + card("NODE, NSET=BASE", [(i, *p) for i, p in zip(below, under, strict=True)])
        + card("ELEMENT, TYPE=C3D8, ELSET=GROUND", np.column_stack([numbers, np.array(ground)]))
        + card("SOLID SECTION, ELSET=GROUND, MATERIAL=STEEL")
        + card("SURFACE, NAME=GROUND", ((e, "S2") for e in numbers))
        + card("SURFACE, NAME=BOTTOM", ((e, "S1") for e in of_face))
        + card("SURFACE INTERACTION, NAME=CONTACT")
        + card("SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", [(1.0 / SOFTNESS, TENSION)])
        + card("FRICTION", [(LOAD["friction"], 1.0 / SOFTNESS)])
        + card("CONTACT PAIR, INTERACTION=CONTACT, TYPE=NODE TO SURFACE", [("BOTTOM", "GROUND")])
        + card("BOUNDARY", [("BASE", 1, 3)])
    )
    levels = [(part, 0.0) for part in np.arange(1, TIGHTENED + 1) / TIGHTENED] + [
        (1.0, load) for load in loads
    ]
    for part, load in levels:
        deck += card("STEP, INC=10000") + card("STATIC", [(1.0, 1.0, SMALLEST_PART, 1.0)])
        deck += card("CLOAD, OP=NEW", _forces(made, part * LOAD["bolts"], float(load)))
        deck += card("NODE PRINT, NSET=ALL, FREQUENCY=10000", [("U",)]) + card("END STEP")
    return deck


def _forces(made: Block, bolt: float, load: float) -> list[tuple[int, int, float]]:
    """Nodal forces of a level."""
    total: dict[tuple[int, int], float] = {}
    for table, size in ((made.press, bolt), (made.pull, load)):
        for node, way, force in table.tolist():
            total[int(node), int(way)] = total.get((int(node), int(way)), 0.0) + size * force
    return [(node, way, force) for (node, way), force in sorted(total.items())]


def displacement_there(made: Block, text: str, before: int = TIGHTENED) -> np.ndarray:
    """Displacement conjugate to the pull at the levels after the pressing."""
    printed = read(text)["U", "ALL"]
    row = {int(node): i for i, node in enumerate(printed.nodes)}
    moved = printed.values[before - 1 :] - printed.values[before - 1]
    return sum(force * moved[:, row[int(node)], int(way) - 1] for node, way, force in made.pull)


def area(force: np.ndarray, displacement: np.ndarray) -> float:
    """Area of the last cycle, straight from level to level."""
    return abs(float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(displacement))))


def main(counts: tuple[int, int, int] = (8, 4, 3), steps: int = 16) -> None:
    """Compare the loop of the first cycle, its area and its stiffness; times beside them."""
    jax.config.update("jax_enable_x64", True)
    made = block(counts, (40.0, 20.0, 10.0))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        body = body_of(made, folder)
        options = LOAD | {"steps_per_half_cycle": steps, "softness": SOFTNESS, "throw": False}
        jax.block_until_ready(solve_faces(body, **options).loads)
        begin = time.perf_counter()
        history = jax.block_until_ready(solve_faces(body, **options))
        ours = time.perf_counter() - begin
        loads = np.asarray(history.force)[1:]
        (folder / "contact.inp").write_text(contact_deck(made, loads), encoding="ascii")
        begin = time.perf_counter()
        subprocess.run([find_program(), "contact"], cwd=folder, check=True, capture_output=True)
        theirs = time.perf_counter() - begin
        there = displacement_there(made, (folder / "contact.dat").read_text(encoding="ascii"))
    start, _, stop = history.cycles[-1]
    force, here = (np.asarray(a)[start : stop + 1] for a in (history.force, history.displacement))
    there = there[start : stop + 1]
    work = area(force, there) / area(force, here) - 1.0
    stiffness = np.ptp(here) / np.ptp(there) - 1.0
    print(f"{body.areas.size} pairs; CalculiX - here: D {work:+.2%}, stiffness {stiffness:+.3%}")
    print(f"seconds: CalculiX {theirs:.1f}, here {ours:.3f}, ratio {theirs / ours:.0f}")


if __name__ == "__main__":
    main()

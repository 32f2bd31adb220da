"""Boxes of bricks (C3D8) in CalculiX: their cards, their matrix, and the contact of nodes there."""

from __future__ import annotations

import resource
import subprocess
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from calibration.finite_elements.cards import card
from calibration.finite_elements.program import find_program
from calibration.finite_elements.results import read
from jbeamshell.bodies.contact import solve_contact
from jbeamshell.bodies.stiffness_model import StiffnessModel
from jbeamshell.bodies.substructure import Substructure
from jbeamshell.history.contact_history import ContactHistory

MODULUS, POISSON = 210e3, 0.3
STEEL = [(MODULUS, POISSON)]
SOFTNESS = 0.3 / MODULUS  # of the pairs, displacement per stress
SMALLEST_PART = 1e-7  # of a level, below which CalculiX gives up
TIGHTENED = 8  # steps of the pressing, as `solve_contact` takes
MATRIX_STEP = card("STEP") + card("FREQUENCY, SOLVER=MATRIXSTORAGE", [(1,)]) + card("END STEP")
TENSION = 1e-3  # stress that CalculiX lets an open pair carry


class Runs(NamedTuple):
    """Contact of the same bodies here and in CalculiX.

    Attributes
    ----------
    history : here
    text : what CalculiX printed at the same loads
    seconds : of the processor here, warm, and there
    """

    history: ContactHistory
    text: str
    seconds: tuple[float, float]


class Box(NamedTuple):
    """Box of even bricks.

    Attributes
    ----------
    places : (N, 3) of its nodes
    number : (nx + 1, ny + 1, nz + 1) of its nodes
    bricks : (k, 8) numbers of their corners, those below first
    """

    places: np.ndarray
    number: np.ndarray
    bricks: np.ndarray

    def at(self, numbers: np.ndarray) -> np.ndarray:
        """Places (..., 3) of nodes."""
        return self.places[numbers - self.number[0, 0, 0]]

    def with_corner_in(self, numbers: np.ndarray, corners: slice) -> np.ndarray:
        """Indices of the bricks whose ``corners`` are all among ``numbers``."""
        return np.flatnonzero(np.isin(self.bricks[:, corners], numbers).all(axis=1))


def box(
    counts: tuple[int, int, int],
    sizes: tuple[float, float, float],
    at: tuple[float, float, float] = (0.0, 0.0, 0.0),
    first: int = 1,
) -> Box:
    """Box from the corner ``at``, its nodes numbered from ``first``."""
    axes = [a + np.linspace(0.0, s, n + 1) for a, s, n in zip(at, sizes, counts, strict=True)]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    number = np.arange(first, first + places[..., 0].size).reshape(places.shape[:3])
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    corners += [(a, b, 1) for a, b, _ in corners]
    nx, ny, nz = counts
    bricks = np.stack(
        [number[a : a + nx, b : b + ny, c : c + nz].ravel() for a, b, c in corners], axis=1
    )
    return Box(places.reshape(-1, 3), number, bricks)


def shares(counts: Sequence[int], sizes: Sequence[float]) -> np.ndarray:
    """Areas (nodes,) of the nodes of an even grid, by the shape functions of its elements."""
    along, across = (
        np.convolve(np.full(n, s / n), [0.5, 0.5]) for n, s in zip(counts, sizes, strict=True)
    )
    return np.outer(along, across).ravel()


def cards_of(made: Box, name: str, first: int = 1, kind: str = "C3D8") -> str:
    """Nodes and bricks of a box, both in sets of its name; its bricks numbered from ``first``."""
    start = int(made.number[0, 0, 0])
    nodes = [(start + i, *place) for i, place in enumerate(made.places)]
    numbers = np.arange(first, first + len(made.bricks))
    return (
        card(f"NODE, NSET={name}", nodes)
        + card(f"ELEMENT, TYPE={kind}, ELSET={name}", np.column_stack([numbers, made.bricks]))
        + card(f"SOLID SECTION, ELSET={name}, MATERIAL=STEEL")
    )


def material() -> str:
    """Steel."""
    return card("MATERIAL, NAME=STEEL") + card("ELASTIC", STEEL) + card("DENSITY", [(7.85e-9,)])


def matrix(deck: str, folder: Path, program: str | None = None) -> StiffnessModel:
    """Matrix of a deck without steps."""
    run(deck + MATRIX_STEP, folder, "matrix", program)
    return StiffnessModel.read(folder / "matrix.sti")


def run(deck: str, folder: Path, job: str, program: str | None = None) -> str:
    """Run a deck; what it printed, nothing if it printed no results."""
    (folder / f"{job}.inp").write_text(deck, encoding="ascii")
    subprocess.run([find_program(program), job], cwd=folder, check=True, capture_output=True)
    printed = folder / f"{job}.dat"
    return printed.read_text(encoding="ascii") if printed.exists() else ""


def run_both(
    bodies: Sequence[Substructure],
    options: dict[str, Any],
    deck_of: Callable[[np.ndarray], str],
    folder: Path,
) -> Runs:
    """Contact of bodies with `SOFTNESS` here, and of the deck of its loads (levels,) there."""
    options = options | {"softness": SOFTNESS, "throw": False}
    jax.block_until_ready(solve_contact(*bodies, **options).loads)
    begin = time.process_time()
    history = jax.block_until_ready(solve_contact(*bodies, **options))
    here = time.process_time() - begin
    deck = deck_of(np.asarray(history.force)[1:])
    begin = seconds_of_programs()
    text = run(deck, folder, "contact")
    return Runs(history, text, (here, seconds_of_programs() - begin))


def seconds_of_programs() -> float:
    """Seconds of the processor that programs run from here have used."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def contact(friction: float, above: Iterable[int], below: Iterable[int]) -> str:
    """Contact of the lower sides of bricks with the upper sides of others, with `SOFTNESS`."""
    pair = "CONTACT PAIR, INTERACTION=CONTACT, TYPE=NODE TO SURFACE"
    return (
        card("SURFACE, NAME=ABOVE", ((e, "S1") for e in above))
        + card("SURFACE, NAME=BELOW", ((e, "S2") for e in below))
        + card("SURFACE INTERACTION, NAME=CONTACT")
        + card("SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", [(1.0 / SOFTNESS, TENSION)])
        + card("FRICTION", [(friction, 1.0 / SOFTNESS)])
        + card(pair, [("ABOVE", "BELOW")])
    )


def steps(
    press: Sequence[np.ndarray], pull: np.ndarray, bolts: float, loads: np.ndarray, *sets: str
) -> str:
    """Steps of pressing, then of loads (levels,), each of which prints the sets of nodes."""
    levels = [(part, 0.0) for part in np.arange(1, TIGHTENED + 1) / TIGHTENED]
    levels += [(1.0, float(load)) for load in loads]
    deck = ""
    for part, load in levels:
        parts = [(table, part * bolts) for table in press]
        deck += card("STEP, INC=10000") + card("STATIC", [(1.0, 1.0, SMALLEST_PART, 1.0)])
        deck += card("CLOAD, OP=NEW", forces([*parts, (pull, load)]))
        for name in sets:
            deck += card(f"NODE PRINT, NSET={name}, FREQUENCY=10000", [("U",)])
        deck += card("END STEP")
    return deck


def forces(parts: Sequence[tuple[np.ndarray, float]]) -> list[tuple[int, int, float]]:
    """Nodal forces of tables (k, 3) of node, direction and force, each times its size."""
    total: dict[tuple[int, int], float] = {}
    for table, size in parts:
        for node, way, force in table.tolist():
            total[int(node), int(way)] = total.get((int(node), int(way)), 0.0) + size * force
    return [(node, way, force) for (node, way), force in sorted(total.items())]


def displacement_there(pull: np.ndarray, name: str, text: str) -> np.ndarray:
    """Displacement conjugate to the pull at the levels after the pressing, of a set of nodes."""
    printed = read(text)["U", name]
    row = {int(node): i for i, node in enumerate(printed.nodes)}
    moved = printed.values[TIGHTENED - 1 :] - printed.values[TIGHTENED - 1]
    return sum(force * moved[:, row[int(node)], int(way) - 1] for node, way, force in pull)


def loop_figures(history: ContactHistory, displacement: np.ndarray) -> dict[str, float]:
    """Area and secant stiffness of the last cycle of a displacement (levels,) at its loads."""
    start, _, stop = history.cycles[-1]
    force, moved = np.asarray(history.force)[start : stop + 1], displacement[start : stop + 1]
    return {
        "dissipation": area(force, moved),
        "secant_stiffness": float(np.ptp(force) / np.ptp(moved)),
    }


def area(force: np.ndarray, displacement: np.ndarray) -> float:
    """Area of the last cycle, straight from level to level."""
    return abs(float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(displacement))))

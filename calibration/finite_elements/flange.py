"""Single lap of two plates with two round bolts: its contact by `solve_contact` and by CalculiX.

Two plates of bricks (C3D8) lap over a face whose nodes match.  The far end of the lower one is
clamped.  That of the upper one is held across and pulled along X.  A bolt is an even pressure
below its two washers, equal and opposite; the plates have no holes.  Both programs have the same
bricks, the same softness of the pairs and the same load steps.  With bricks of its own the lower
plate does not match: the contact here then is on elements, and CalculiX's on the upper nodes.

`python -m calibration.finite_elements.flange` compares dissipation, stiffness and open area, and
`flange 18 8 1 8 15 7` with a lower plate of 15 x 7 bricks on the lap.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from calibration.finite_elements.bricks import (
    MODULUS,
    SOFTNESS,
    TIGHTENED,
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
from calibration.finite_elements.cards import card, node_set
from calibration.finite_elements.program import find_program, version
from calibration.finite_elements.results import read
from calibration.provenance import provenance
from jbeamshell.bodies.substructure import Substructure

RECORD = Path(__file__).with_name("flange.json")
LAP, FREE, WIDTH, THICK = 60.0, 20.0, 30.0, 8.0  # mm; of the lap, beyond it, across, of a plate
BOLTS = ((15.0, 15.0), (45.0, 15.0))  # their middles, from the lap's corner
WASHER = 9.0  # its radius
LOAD: dict[str, Any] = {"friction": 0.2, "amplitude": 2000.0, "bolts": 8000.0, "cycles": 1}


class Plate(NamedTuple):
    """Plate with its face and its loads.

    Attributes
    ----------
    bricks : nodes and bricks
    face : numbers of the nodes of the lap, along and across
    far : (k,) numbers of the nodes of the far end
    press : for each bolt, (k, 3) node, direction and force of its washer
    """

    bricks: Box
    face: np.ndarray
    far: np.ndarray
    press: list[np.ndarray]


class Flange(NamedTuple):
    """Lap of two plates: the plates, the areas (n,) of the upper face, and the pull (k, 3)."""

    upper: Plate
    lower: Plate
    areas: np.ndarray
    pull: np.ndarray

    @property
    def matches(self) -> bool:
        """True if the faces match node by node."""
        return self.upper.face.shape == self.lower.face.shape


def flange(lap: tuple[int, int], layers: int, under: tuple[int, int] | None = None) -> Flange:
    """Flange of ``lap`` bricks along and across the lap, and ``layers`` through a plate.

    The lower plate has ``under`` bricks along and across the lap; as the upper one if left out.
    """
    under = lap if under is None else under
    past, beyond = (round(count * FREE / LAP) for count, _ in (lap, under))
    counts, sizes = (lap[0] + past, lap[1], layers), (LAP * (1 + past / lap[0]), WIDTH, THICK)
    above = box(counts, sizes)
    others, size = (under[0] + beyond, under[1], layers), LAP * (1 + beyond / under[0])
    start = (LAP - size, 0.0, -THICK)
    below = box(others, (size, WIDTH, THICK), start, first=int(above.number.max()) + 1)
    on_upper, on_lower = above.number[: lap[0] + 1], below.number[beyond:]
    areas = shares(lap, (LAP, WIDTH))
    end = above.number[-1]
    pull = np.column_stack(
        [end.ravel(), np.full(end.size, 1), shares(counts[1:], sizes[1:]) / (WIDTH * THICK)]
    )
    upper, lower = (
        Plate(made, face, far.ravel(), [washer(made, outer, at, sign) for at in BOLTS])
        for made, face, far, outer, sign in (
            (above, on_upper[:, :, 0], end, on_upper[:, :, -1], -1.0),
            (below, on_lower[:, :, -1], below.number[0], on_lower[:, :, 0], 1.0),
        )
    )
    return Flange(upper, lower, areas, pull)


def washer(made: Box, outer: np.ndarray, middle: tuple[float, float], sign: float) -> np.ndarray:
    """Unit force (k, 3) along Z, even over the nodes of an outer face below a washer."""
    counts = outer.shape[0] - 1, outer.shape[1] - 1
    distance = np.linalg.norm(made.at(outer)[..., :2] - middle, axis=-1)
    inside = distance.ravel() <= WASHER * (1.0 + 1e-9)
    part = shares(counts, (LAP, WIDTH))[inside]
    nodes = outer.ravel()[inside]
    return np.column_stack([nodes, np.full(nodes.size, 3), sign * part / np.sum(part)])


def bodies_of(made: Flange, folder: Path) -> tuple[Substructure, Substructure]:
    """Upper and lower plate on their face, their matrices from CalculiX."""
    upper, lower = (
        matrix(cards_of(plate.bricks, "PLATE") + material() + held, folder).condensed(
            np.column_stack([plate.face.ravel(), plate.bricks.at(plate.face.ravel())]),
            pull=pull,
            press=plate.press,
            **({"tributary": made.areas} if made.matches else {"elements": quads(plate.face)}),
        )
        for plate, held, pull in (
            (made.upper, supports(made.upper, 2), made.pull),
            (made.lower, supports(made.lower, 1), None),
        )
    )
    return upper, lower


def quads(face: np.ndarray) -> list[list[int]]:
    """Nodes of the elements of a face, in turn."""
    corners = face[:-1, :-1], face[1:, :-1], face[1:, 1:], face[:-1, 1:]
    found: list[list[int]] = np.stack([corner.ravel() for corner in corners], axis=1).tolist()
    return found


def supports(plate: Plate, first: int) -> str:
    """Supports of the far end in the directions from ``first`` to 3."""
    return card("BOUNDARY", ((node, first, 3) for node in plate.far))


def contact_deck(made: Flange, loads: np.ndarray) -> str:
    """Deck of the contact: pressing, then the loads (levels,), a step for each."""
    upper, lower = made.upper, made.lower
    first = len(upper.bricks.bricks) + 1
    above = 1 + upper.bricks.with_corner_in(upper.face, slice(4))
    below = first + lower.bricks.with_corner_in(lower.face, slice(4, 8))
    press = [np.concatenate(both) for both in zip(upper.press, lower.press, strict=True)]
    return (
        cards_of(upper.bricks, "UPPER")
        + cards_of(lower.bricks, "LOWER", first)
        + material()
        + node_set("END", upper.far)
        + node_set("TOP", upper.face.ravel())
        + node_set("BOTTOM", lower.face.ravel())
        + supports(upper, 2)
        + supports(lower, 1)
        + contact(LOAD["friction"], above, below)
        + steps(press, made.pull, LOAD["bolts"], loads, "END", "TOP", "BOTTOM")
    )


def gaps_there(made: Flange, text: str) -> np.ndarray:
    """Gaps (levels, n) of the pairs after the pressing."""
    printed = read(text)
    above, below = (
        table.values[TIGHTENED - 1 :, np.searchsorted(table.nodes, face.ravel()), 2]
        for table, face in (
            (printed["U", "TOP"], made.upper.face),
            (printed["U", "BOTTOM"], made.lower.face),
        )
    )
    return above - below


def compare(
    lap: tuple[int, int],
    layers: int,
    steps_per_half_cycle: int,
    under: tuple[int, int] | None = None,
) -> dict[str, Any]:
    """Figures of the last cycle here and by CalculiX, and seconds of the processor."""
    made = flange(lap, layers, under)
    options = LOAD | {"steps_per_half_cycle": steps_per_half_cycle}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        history, text, (ours, theirs) = run_both(
            bodies_of(made, folder), options, lambda loads: contact_deck(made, loads), folder
        )
    _, turn, stop = history.cycles[-1]
    opened = np.sum(made.areas) - np.asarray(history.contact_extent)
    there = (gaps_there(made, text) > 0.0) @ made.areas if made.matches else None
    both = {
        "here": (np.asarray(history.displacement), opened if made.matches else None),
        "calculix": (displacement_there(made.pull, "END", text), there),
    }
    found: dict[str, Any] = {
        "pairs": int(history.places.shape[0]),
        "matches": made.matches,
        "mesh_error": float(history.mesh_error),
        "steps_per_half_cycle": steps_per_half_cycle,
        "softness_times_modulus": SOFTNESS * MODULUS,
        "seconds_here": ours,
        "seconds_calculix": theirs,
        "slipping": float(np.mean(history.slipping[turn])),
    }
    for key, (moved, opened) in both.items():
        found[key] = loop_figures(history, moved)
        if opened is not None:
            found[key]["open_area_end"] = float(opened[stop])
            found[key]["open_area_turn"] = float(opened[turn])
    return found


def main(
    lap: tuple[int, int] = (18, 8),
    layers: int = 1,
    steps_per_half_cycle: int = 8,
    under: tuple[int, int] | None = None,
) -> None:
    """Compare and print; plates that match are recorded."""
    jax.config.update("jax_enable_x64", True)
    found = compare(lap, layers, steps_per_half_cycle, under)
    what = "pairs" if found["matches"] else f"points (mesh error {found['mesh_error']:.0%})"
    print(f"{found['pairs']} {what}, {found['slipping']:.0%} of them slip at the turn")
    for key, value in found["here"].items():
        there = found["calculix"][key]
        off = f", CalculiX {there / value - 1.0:+.2%}" if value else ""
        print(f"  {key.replace('_', ' ')}: here {value:.6g}, CalculiX {there:.6g}{off}")
    times = found["seconds_calculix"], found["seconds_here"]
    print(f"  seconds of the processor: CalculiX {times[0]:.1f}, here {times[1]:.3f}")
    if not found["matches"]:
        return
    record = {"provenance": provenance(), "program": version(find_program()), "load": LOAD}
    RECORD.write_text(json.dumps(record | found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    words = [int(word) for word in sys.argv[1:]]
    under = (words[4], words[5]) if len(words) > 4 else None
    main((words[0], words[1]), *words[2:4], under=under) if words else main()

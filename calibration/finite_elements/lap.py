"""Single lap with two bolts in CalculiX, beside plane elasticity on the contact line.

Two equal members, the lower one clamped at X = 0 and the upper one pulled at X = L, are pressed
together under two bolts, rub, and lift off between and beside them.  Their contact is
penalty contact, face to face, as in `calibration.finite_elements.deck`.

`python -m calibration.finite_elements.lap` compares dissipation, stiffness and the open length, and
writes lap.json beside this file.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np

import jbeamshell as jb
from calibration.finite_elements.cards import card, node_set, normal_behaviour
from calibration.finite_elements.deck import (
    MOST_PARTS,
    SMALLEST_PART,
    SMOOTH,
    SOFTER,
    Penalty,
)
from calibration.finite_elements.mesh import Mesh, make_mesh, nodal_loads
from calibration.finite_elements.program import find_program, run, version
from calibration.finite_elements.results import read
from calibration.provenance import provenance
from jbeamshell.common.files import write_text
from jbeamshell.scene import library, load_path

RECORD = Path(__file__).with_name("lap.json")
BOLTS = [[0.6, 10.0, 0.3], [1.4, 10.0, 0.3]]  # X, force and width of the patch
STEPS = 20  # per half cycle
NORMAL, STICK = 300.0, 100.0  # stiffness of the contact, in units of E'/H
SETS = ("END", "ABOVE", "BELOW")  # of printed nodes
TOUCHES = 1e-3  # of the largest gap, above which the members are apart


class Loop(NamedTuple):
    """Answer of the joint.

    Attributes
    ----------
    force, displacement : (levels,) from the pressing on
    x : (n,) stations of the contact
    gap : (levels, n) distance of the members
    """

    force: np.ndarray
    displacement: np.ndarray
    x: np.ndarray
    gap: np.ndarray

    def figures(self) -> dict[str, float]:
        """Figures of the last cycle, and the open length at its start and its turn."""
        turn, stop = self.force.size - 1 - STEPS, self.force.size - 1
        start = turn - STEPS
        f, u = self.force[start:], self.displacement[start:]
        area = float(np.sum(0.5 * (f[1:] + f[:-1]) * np.diff(u)))
        return {
            "dissipation": area,
            "secant_stiffness": float(np.ptp(f) / np.ptp(u)),
            "open_at_pull": self.open_length(stop),
            "open_at_push": self.open_length(turn),
        }

    def open_length(self, level: int) -> float:
        """Length of the contact over which the members are apart."""
        gap = self.gap[level] - TOUCHES * np.max(self.gap[level])
        fine = np.linspace(self.x[0], self.x[-1], 20 * self.x.size)
        return float(np.mean(np.interp(fine, self.x, gap) > 0.0) * np.ptp(self.x))


def joint() -> jb.Scene:
    """Scene of the joint."""
    values = {"contact.bolts": BOLTS, "load.amplitude": 0.6, "load.cycles": 1}
    values |= {"contact.assembly": "frictionless"}
    return library.single_lap().replace(values | {"load.steps_per_half_cycle": STEPS})


def write_deck(scene: jb.Scene, mesh: Mesh) -> str:
    """Input deck of the joint; the lower member is the upper one's mirror image."""
    path, _ = load_path.check(scene)
    strip = scene.strip
    unit = float(strip.plane_modulus / strip.half_height)
    stiffness = Penalty(NORMAL * unit, STICK * unit)
    i, j = np.nonzero(mesh.number)
    below = np.where(mesh.number > 0, mesh.number + mesh.number.max(), 0)
    turned = mesh.elements[:, [3, 2, 1, 0, 6, 5, 4, 7]] + mesh.number.max()
    count = len(mesh.elements)
    text = (
        card("NODE", zip(mesh.number[i, j], mesh.x[i], mesh.y[j], strict=True))
        + card("NODE", zip(below[i, j], mesh.x[i], -mesh.y[j], strict=True))
        + card("ELEMENT, TYPE=CPE8R, ELSET=BOTH", _numbered(mesh.elements, 1))
        + card("ELEMENT, TYPE=CPE8R, ELSET=BOTH", _numbered(turned, count + 1))
        + node_set("END", mesh.number[-1])
        + node_set("CLAMP", below[0])
        + node_set("ABOVE", mesh.number[:, 0])
        + node_set("BELOW", below[:, 0])
        + card("MATERIAL, NAME=STRIP")
        + card("ELASTIC", [(strip.youngs_modulus, strip.poisson_ratio)])
        + card("SOLID SECTION, ELSET=BOTH, MATERIAL=STRIP", [(1.0,)])
        + card("SURFACE, NAME=UPPER", ((e + 1, "S1") for e in mesh.bottom_elements))
        + card("SURFACE, NAME=LOWER", ((count + e + 1, "S3") for e in mesh.bottom_elements))
        + card("SURFACE INTERACTION, NAME=CONTACT")
        + normal_behaviour(SOFTER[0] * stiffness.normal)
        + card("FRICTION", [(SMOOTH * float(scene.contact.friction), stiffness.stick)])
        + card("CONTACT PAIR, INTERACTION=CONTACT, TYPE=SURFACE TO SURFACE", [("UPPER", "LOWER")])
    )
    press = nodal_loads(mesh.columns, mesh.order, scene.contact.pressure)
    loads = [(n, 2, -p) for n, p in zip(mesh.number[:, -1], press, strict=True) if p]
    loads += [(n, 2, p) for n, p in zip(below[:, -1], press, strict=True) if p]
    clamp: list[tuple[object, ...]] = [("CLAMP", 1, 2), ("END", 2, 2)]
    keeps_place = (int(mesh.number[-1, 0]), 1, 1)  # while nothing rubs
    rough = card("CHANGE FRICTION, INTERACTION=CONTACT")
    rough += card("FRICTION", [(float(scene.contact.friction), stiffness.stick)])
    wanted = [card(f"NODE PRINT, NSET={s}, FREQUENCY={MOST_PARTS}", [("U",)]) for s in SETS]
    for softer in (*SOFTER, 1.0):
        change = card("CHANGE SURFACE BEHAVIOR, INTERACTION=CONTACT")
        change += normal_behaviour(softer * stiffness.normal)
        if softer == SOFTER[0]:
            change += card("BOUNDARY", [*clamp, keeps_place]) + "".join(wanted)
        text += _step(mesh, loads, 0.0, change)
    for level, force in enumerate(np.asarray(path.target)[scene.load.pressure_steps :]):
        change = rough + card("BOUNDARY, OP=NEW", clamp) if level == 0 else ""
        text += _step(mesh, loads, float(force), change)
    return text


def _numbered(elements: np.ndarray, first: int) -> np.ndarray:
    return np.column_stack([np.arange(first, first + len(elements)), elements])


def _step(mesh: Mesh, loads: list[tuple[int, int, float]], force: float, change: str) -> str:
    """One step with what changes in it; it keeps the rest of the step before."""
    even = zip(mesh.number[-1], force * mesh.shares, strict=True)
    return (
        card(f"STEP, INC={MOST_PARTS}")
        + card("STATIC", [(1.0, 1.0, SMALLEST_PART, 1.0)])
        + change
        + card("CLOAD", [*loads, *((node, 1, part) for node, part in even)])
        + card("END STEP")
    )


def by_elements(scene: jb.Scene, refinement: float, program: str | None = None) -> Loop:
    """Joint by CalculiX."""
    mesh = make_mesh(scene, "quadratic", refinement)
    path, _ = load_path.check(scene)
    force = np.asarray(path.target)[scene.load.pressure_steps - 1 :]
    levels = force.size + len(SOFTER)
    outcome = run(write_deck(scene, mesh), levels, find_program(program))
    if not outcome.finished:
        raise SystemExit(f"CalculiX stopped: {outcome.message} (files in {outcome.folder})")
    printed = read(outcome.data, len(SOFTER))
    end = printed["U", "END"]
    order = np.argsort(mesh.number[-1])
    shares = mesh.shares[order][np.searchsorted(np.sort(mesh.number[-1]), end.nodes)]
    above, below = printed["U", "ABOVE"].values, printed["U", "BELOW"].values
    return Loop(
        force,
        end.values[:, :, 0] @ shares - end.values[0, :, 0] @ shares,
        mesh.x,
        above[:, :, 1] - below[:, :, 1],
    )


def on_contact_line(scene: jb.Scene) -> Loop:
    """Joint by plane elasticity on its contact line."""
    history = jb.solve(scene)
    start = history.pressed
    return Loop(
        *(np.asarray(a[start:]) for a in (history.force, history.displacement)),
        np.asarray(history.x),
        np.asarray(history.gap[start:]),
    )


def main(refinements: tuple[float, ...] = (0.5, 1.0)) -> int:
    """Compare, print and record."""
    jax.config.update("jax_enable_x64", True)
    scene = joint()
    rows = {"plane": on_contact_line(scene).figures()}
    for refinement in refinements:
        rows[f"CalculiX, refinement {refinement:g}"] = by_elements(scene, refinement).figures()
    for name, figures in rows.items():
        print(f"{name:28}", "  ".join(f"{k} {v:.5g}" for k, v in figures.items()))
    record = provenance() | {"calculix": version(find_program()), "bolts": BOLTS, "joint": rows}
    write_text(RECORD, json.dumps(record, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())

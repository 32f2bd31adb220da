"""Lap joints in CalculiX, beside plane elasticity on the contact line.

Two members are pressed together, rub, and lift off where nothing presses.  Their contact is penalty
contact, face to face, as in `calibration.finite_elements.deck`.  The lower member is clamped at
X = 0 (single lap), or its bottom is a symmetry plane (double shear); the upper one is pulled at
X = L.

Members that go on are pressed together first, with free ends and only kept from moving as a whole.
Then they are tied to their lengths beyond the contact, without stress, and held at the outer ends.

`python -m calibration lap` compares dissipation, stiffness and the open length.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

import jbeamshell as jb
from calibration.finite_elements.cards import card, node_set, normal_behaviour
from calibration.finite_elements.deck import (
    MOST_PARTS,
    SMALLEST_PART,
    SMOOTH,
    SOFTER,
    Penalty,
    block_cards,
    nodes_of,
    tie,
)
from calibration.finite_elements.mesh import (
    ROWS,
    Block,
    block,
    columns_beyond,
    contact_columns,
    nodal_loads,
    row_heights,
)
from calibration.finite_elements.program import find_program, run, version
from calibration.finite_elements.results import read
from jbeamshell.common.checks import require_choice
from jbeamshell.scene import library, load_path

BOLTS = [[0.6, 10.0, 0.3], [1.4, 10.0, 0.3]]  # X, force and width of the patch
STEPS = 20  # per half cycle
CYCLE = {"load.cycles": 1, "load.steps_per_half_cycle": STEPS}
NODES = 257  # of plane elasticity
INNER = 0.2  # height ratio of the half of an inner member
NORMAL, STICK = 300.0, 100.0  # stiffness of the contact, in units of E'/H
SETS = ("END", "ABOVE", "BELOW")  # of printed nodes
TOUCHES = 1e-3  # of the largest gap, above which the members are apart
KNOWN = ("traction", "member")  # entries of the force

Force = tuple[int, int, float]  # node, direction and force
Held = list[tuple[object, int]]  # nodes, or their set, and a direction


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


class Member(NamedTuple):
    """Meshes of a member.

    Attributes
    ----------
    name : of its elements and its material
    strip : its section
    mesh : on the contact
    beyond : where it goes on, or None
    end : column at which it goes on: -1 at X = L, 0 at X = 0
    """

    name: str
    strip: jb.Strip
    mesh: Block
    beyond: Block | None
    end: int

    @property
    def section(self) -> np.ndarray:
        """(k,) numbers of the nodes of the section where the contact ends."""
        return self.mesh.number[self.end]

    @property
    def blocks(self) -> tuple[Block, ...]:
        """All its meshes."""
        return (self.mesh,) if self.beyond is None else (self.mesh, self.beyond)

    @property
    def outer(self) -> np.ndarray:
        """(k,) numbers of the nodes of its outer end."""
        return self.blocks[-1].number[self.end]

    @property
    def softness(self) -> float:
        """Even stretch of the length beyond for each unit of load."""
        stretches = 2.0 * self.strip.half_height * self.strip.plane_modulus
        return float(sum(np.ptp(block.x) for block in self.blocks[1:]) / stretches)


def joint(entry: str = "traction") -> jb.Scene:
    """Scene of a single lap with two bolts."""
    values = {"contact.bolts": BOLTS, "load.amplitude": 0.6, "load.entry": entry}
    return library.single_lap().replace(values | {"member.assembly": "frictionless"} | CYCLE)


def double_shear(entry: str = "traction") -> jb.Scene:
    """Scene of a strip on the half of a thicker inner member."""
    values = {"member.height_ratio": INNER, "load.amplitude": 1.3, "load.entry": entry}
    return library.double_shear().replace(values | CYCLE)


def make_members(scene: jb.Scene, refinement: float) -> tuple[Member, Member]:
    """Upper and lower member, with a node of each at every place of the contact."""
    require_choice("load.entry", scene.load.entry, KNOWN)
    x, rows = contact_columns(scene, refinement), max(1, round(ROWS * refinement))
    strips = scene.strip, scene.member.beside(scene.strip)
    heights = [float(strip.half_height) for strip in strips]
    above, below = row_heights(heights[0], rows), -row_heights(heights[1], rows)[::-1]
    upper = block(x, above, 2)
    lower = block(x, below, 2, upper)
    right = left = None
    if scene.load.entry == "member":
        after, before = (columns_beyond(height, refinement) for height in heights)
        right = block(x[-1] + after, above, 2, lower)
        left = block(-before[::-1], below, 2, right)
    return (
        Member("UPPER", strips[0], upper, right, -1),
        Member("LOWER", strips[1], lower, left, 0),
    )


def write_deck(scene: jb.Scene, members: tuple[Member, Member]) -> str:
    """Input deck of the joint."""
    upper, lower = members
    path, _ = load_path.check(scene)
    unit = float(scene.strip.plane_modulus / scene.strip.half_height)
    stiffness = Penalty(NORMAL * unit, STICK * unit)
    mounted = _mounting(scene, upper.outer, lower.outer)
    text = "".join(map(_member_cards, members)) + _contact_cards(scene, members, stiffness)
    pressed, frozen = mounted, ""
    if upper.beyond is not None:
        ties, pressed = _ties(scene, members)
        text += ties
        frozen = _boundary("BOUNDARY, FIXED", [("DISTANCES", 1), ("DISTANCES", 2)])
    pressed = [*pressed, (int(upper.mesh.number[0, 0]), 1)]  # while nothing rubs
    forces = _pressing(scene, members)
    for softer in (*SOFTER, 1.0):
        change = card("CHANGE SURFACE BEHAVIOR, INTERACTION=CONTACT")
        change += normal_behaviour(softer * stiffness.normal)
        if softer == SOFTER[0]:
            change += _boundary("BOUNDARY", pressed)
            for nodes in SETS:
                change += card(f"NODE PRINT, NSET={nodes}, FREQUENCY={MOST_PARTS}", [("U",)])
        text += _step(forces, change)
    rough = card("CHANGE FRICTION, INTERACTION=CONTACT")
    rough += card("FRICTION", [(float(scene.contact.friction), stiffness.stick)])
    rough += _boundary("BOUNDARY, OP=NEW", mounted) + frozen
    for level, load in enumerate(np.asarray(path.target)[scene.load.pressure_steps :]):
        even = zip(upper.outer, load * upper.mesh.shares, strict=True)
        pulled = [*forces, *((n, 1, part) for n, part in even)]
        text += _step(pulled, "" if level else rough)
    return text


def _member_cards(member: Member) -> str:
    name, strip = member.name, member.strip
    return (
        "".join(block_cards(each, "CPE8R", name) for each in member.blocks)
        + card(f"MATERIAL, NAME={name}")
        + card("ELASTIC", [(strip.youngs_modulus, strip.poisson_ratio)])
        + card(f"SOLID SECTION, ELSET={name}, MATERIAL={name}", [(1.0,)])
    )


def _contact_cards(scene: jb.Scene, members: tuple[Member, Member], stiffness: Penalty) -> str:
    upper, lower = members
    smooth = SMOOTH * float(scene.contact.friction)
    return (
        node_set("ABOVE", upper.mesh.number[:, 0])
        + node_set("BELOW", lower.mesh.number[:, -1])
        + node_set("END", upper.outer)
        + node_set("PLANE", np.concatenate([each.number[1:, 0] for each in lower.blocks]))
        + card("SURFACE, NAME=ABOVE", ((e, "S1") for e in upper.mesh.bottom_elements))
        + card("SURFACE, NAME=BELOW", ((e, "S3") for e in lower.mesh.top_elements))
        + card("SURFACE INTERACTION, NAME=CONTACT")
        + normal_behaviour(SOFTER[0] * stiffness.normal)
        + card("FRICTION", [(smooth, stiffness.stick)])
        + card("CONTACT PAIR, INTERACTION=CONTACT, TYPE=SURFACE TO SURFACE", [("ABOVE", "BELOW")])
    )


def _mounting(scene: jb.Scene, right: np.ndarray, left: np.ndarray) -> Held:
    """Supports of the joint, at the upper member's right and the lower member's left end."""
    held: Held = [(n, 1) for n in left]
    if scene.member.support == "rolling":
        held += [("PLANE", 2), (left[0], 2)]
    else:
        held += [(n, 2) for n in left]
    return held + [(n, 2) for n in right if scene.member.loaded_end == "level"]


def _ties(scene: jb.Scene, members: tuple[Member, Member]) -> tuple[str, Held]:
    """Ties of members to the lengths beyond, and what holds them all before they are mounted."""
    further = [member.blocks[-1] for member in members]
    text, last = node_set("BEYOND", np.concatenate([*map(nodes_of, further)])), further[-1].last
    for member, beyond in zip(members, further, strict=True):
        distances = last + 1 + np.arange(member.section.size)
        twin, mesh, last = beyond.number[-1 - member.end], member.mesh, distances[-1]
        text += tie(member.section, twin, distances, mesh.x[member.end], mesh.y)
    face = members[1].mesh.number[-1]  # of the lower member, which is free
    held: Held = [("BEYOND", 1), ("BEYOND", 2), (face[-1], 1)]
    if scene.member.support == "rolling":
        return text, [*held, ("PLANE", 2), (distances[0], 2)]
    return text, [*held, (face[-1], 2), (face[0], 1)]


def _boundary(keyword: str, held: Held) -> str:
    return card(keyword, [(nodes, direction, direction) for nodes, direction in held])


def _pressing(scene: jb.Scene, members: tuple[Member, Member]) -> list[Force]:
    """Forces of the pressures on the outer faces of both members."""
    forces: list[Force] = []
    pressures = scene.contact.pressure, scene.contact.bottom_pressure
    for member, sign, row, pressure in zip(members, (-1.0, 1.0), (-1, 0), pressures, strict=True):
        loads = sign * nodal_loads(member.mesh.columns, member.mesh.order, pressure)
        nodes = member.mesh.number[:, row]
        forces += [(n, 2, load) for n, load in zip(nodes, loads, strict=True) if load]
    return forces


def _step(forces: list[Force], change: str) -> str:
    """One step with what changes in it; it keeps the rest of the step before."""
    return (
        card(f"STEP, INC={MOST_PARTS}")
        + card("STATIC", [(1.0, 1.0, SMALLEST_PART, 1.0)])
        + change
        + card("CLOAD", forces)
        + card("END STEP")
    )


def by_elements(scene: jb.Scene, refinement: float, program: str | None = None) -> Loop:
    """Joint by CalculiX."""
    upper, lower = members = make_members(scene, refinement)
    path, _ = load_path.check(scene)
    force = np.asarray(path.target)[scene.load.pressure_steps - 1 :]
    levels = force.size + len(SOFTER)
    outcome = run(write_deck(scene, members), levels, find_program(program))
    if not outcome.finished:
        raise SystemExit(f"CalculiX stopped: {outcome.message} (files in {outcome.folder})")
    printed = read(outcome.data, len(SOFTER))
    end = printed["U", "END"]
    moved = end.values[:, np.searchsorted(end.nodes, upper.outer), 0] @ upper.mesh.shares
    above, below = printed["U", "ABOVE"].values, printed["U", "BELOW"].values
    return Loop(
        force,
        moved - moved[0] - (upper.softness + lower.softness) * force,
        upper.mesh.x,
        above[:, :, 1] - below[:, :, 1],
    )


def on_contact_line(scene: jb.Scene) -> Loop:
    """Joint by plane elasticity on its contact line; it goes on as far as the elements do."""
    history = jb.solve(scene, throw=False)
    start = history.pressed
    return Loop(
        *(np.asarray(a[start:]) for a in (history.force, history.displacement)),
        np.asarray(history.x),
        np.asarray(history.gap[start:]),
    )


def measure() -> dict[str, Any]:
    """Compare all joints on three meshes."""
    record = {"calculix": version(find_program()), "bolts": BOLTS, "inner": INNER}
    for name, scene in scenes().items():
        rows = {"plane": on_contact_line(scene.replace({"model.nodes": NODES})).figures()}
        for refinement in (0.5, 1.0, 2.0):
            rows[f"CalculiX, refinement {refinement:g}"] = by_elements(scene, refinement).figures()
        print(name)
        for source, figures in rows.items():
            print(f"  {source:26}", "  ".join(f"{k} {v:.5g}" for k, v in figures.items()))
        record[name] = rows
    return record


def scenes() -> dict[str, jb.Scene]:
    """Scenes by their names in the record."""
    return {
        "joint": joint(),
        "joint that goes on": joint("member"),
        "double shear": double_shear(),
        "double shear that goes on": double_shear("member"),
    }

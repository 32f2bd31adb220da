"""A scene as a CalculiX input deck.

The strip stands on a base whose nodes are all fixed; between them is penalty contact, face to face
(`*CONTACT PAIR, TYPE=SURFACE TO SURFACE`), which suits quadratic elements.  All loads are
work-equivalent nodal forces (`*CLOAD`): they stay dead loads when the strip turns, and they keep
clear of a trap of CalculiX 2.20, where a second `*DLOAD` face of an element makes the pressure of
an earlier step ramp up again from zero.

Every load level is a step of CalculiX, of unit time.  The first ones press the strip down with next
to no friction, then the friction is raised to mu (`*CHANGE FRICTION`).  CalculiX keeps no memory of
slip where there is no friction at all, and would count the slip of the pressing; with a millionth
of mu the contact slides freely, and starts afresh.

A face that is rigid is an equation between its nodes.  A length beyond the contact has nodes of its
own in the section X = L.  It is held while the strip is pressed down, and then tied to it with the
distance that the two sections have by then, so it is free of stress.

Where a strip lifts off, CalculiX does not find a stiff contact from nowhere: springs open and close
for ever.  So the first level is walked with soft springs before, each time ten or a hundred times
stiffer (`*CHANGE SURFACE BEHAVIOR`), which settles in a few iterations each.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from calibration.finite_elements.cards import card, equation, node_set, normal_behaviour
from calibration.finite_elements.mesh import Block, Mesh, after, nodal_loads
from jbeamshell.scene.load_path import LoadPath
from jbeamshell.scene.scene import Scene

NORMAL_STIFFNESS = 1000.0  # of the contact, in units of E'/H
SOFTER = (1e-3, 1e-2, 1e-1)  # of it, in the steps before the first level
ELASTIC_SLIP = 1e-3  # elastic part of the slip at the loaded end, at the amplitude
HEIGHT_EFFECT = 13.0  # D/D_bar is about 1/(1 + 13 (eta a mu F_N/A)^2) by finite elements
SMOOTH = 1e-6  # of mu, while the strip is pressed down
SMALLEST_PART = 1e-4  # of a load level, below which CalculiX gives up
MOST_PARTS = 10_000
SUM = (1.0, -1.0, -1.0)  # a displacement is the sum of two


class Penalty(NamedTuple):
    """Stiffness of the contact, stress per length.

    Attributes
    ----------
    normal : k_n, reaction over penetration
    stick : k_t, traction over elastic slip
    """

    normal: float
    stick: float


class Step(NamedTuple):
    """A step of CalculiX.

    Attributes
    ----------
    load : at its end: F, or the driven displacement
    pressure : part of the pressures that acts at its end
    rough : whether there is friction
    begins : whether it is the first of its kind, where supports and contact change
    softer : part of the contact's normal stiffness
    """

    load: float
    pressure: float
    rough: bool
    begins: bool
    softer: float = 1.0


def penalty(scene: Scene, path: LoadPath) -> Penalty:
    """Contact stiffnesses that are nearly rigid, in any units.

    The stick slope allows an elastic slip of a thousandth of the slip at the loaded end, which is
    that of a bar under the largest load, F^2/(2 E'2H q), less what the strip's height spares it.
    """
    strip, contact = scene.strip, scene.contact
    modulus, half_height = float(strip.plane_modulus), float(strip.half_height)
    normal = NORMAL_STIFFNESS * modulus / half_height
    stretch, cap = 2.0 * half_height * modulus, float(contact.friction * contact.largest_pressure)
    force = float(np.max(np.abs(path.target)))
    if cap == 0.0 or force == 0.0:
        return Penalty(normal, normal)
    if scene.load.control == "displacement":
        force = min(np.sqrt(2.0 * stretch * cap * force), cap * float(strip.length))
    slip = force**2 / (2.0 * stretch * cap)
    slip /= 1.0 + HEIGHT_EFFECT * (half_height * cap / force) ** 2
    return Penalty(normal, cap / (ELASTIC_SLIP * slip))


def write_deck(scene: Scene, path: LoadPath, mesh: Mesh) -> str:
    """The whole input deck.

    Parameters
    ----------
    scene : what is loaded
    path : (levels,) each, the pressing first
    mesh : of the strip and the base
    """
    parts, stiffness = [_strip(scene, mesh)], penalty(scene, path)
    parts += [_base(scene, mesh, stiffness)] if scene.contact.normal != "none" else []
    parts.append(_constraints(scene, mesh))
    target, pressure, rough = (np.asarray(values, dtype=float).tolist() for values in path)
    before = SOFTER[: steps_before(scene)]
    steps = [Step(0.0, pressure[0], False, softer == before[0], softer) for softer in before]
    for level, (load, part, friction) in enumerate(zip(target, pressure, rough, strict=True)):
        begins = level in (0, scene.load.pressure_steps)
        steps.append(Step(load, part, friction > 0.0, begins))
    pressing = _pressing(scene, mesh)
    parts += [_step(scene, mesh, step, stiffness, pressing) for step in steps]
    return "".join(parts)


def steps_before(scene: Scene) -> int:
    """Number of CalculiX's steps before the first load level."""
    return 0 if scene.contact.normal == "none" else len(SOFTER)


def _strip(scene: Scene, mesh: Mesh) -> str:
    strip = scene.strip
    kind = {"strain": "CPE", "stress": "CPS"}[strip.plane] + {1: "4", 2: "8R"}[mesh.order]
    return (
        "".join(block_cards(block, kind, "STRIP") for block in mesh.blocks)
        + node_set("FAR", mesh.number[0])
        + (node_set("BEYOND", nodes_of(mesh.beyond)) if mesh.beyond is not None else "")
        + card("MATERIAL, NAME=STRIP")
        + card("ELASTIC", [(strip.youngs_modulus, strip.poisson_ratio)])
        + card("SOLID SECTION, ELSET=STRIP, MATERIAL=STRIP", [(1.0,)])
    )


def block_cards(block: Block, kind: str, name: str) -> str:
    """Nodes and elements of a block, in a node set and an element set of one name."""
    (i, j), numbers = np.nonzero(block.number), block.first + np.arange(len(block.elements))
    places = zip(block.number[i, j], block.x[i], block.y[j], strict=True)
    elements = np.column_stack([numbers, block.elements])
    return card(f"NODE, NSET={name}", places) + card(
        f"ELEMENT, TYPE={kind}, ELSET={name}", elements
    )


def nodes_of(block: Block) -> np.ndarray:
    """Numbers of the nodes of a block."""
    return block.number[block.number > 0]


def _base(scene: Scene, mesh: Mesh, stiffness: Penalty) -> str:
    depth = mesh.y[-1]
    rows = (
        np.column_stack([mesh.base_x, np.full(mesh.base_x.size, -depth)]),
        np.column_stack([mesh.base_x, np.zeros(mesh.base_x.size)]),
    )
    nodes = [
        (number, *point)
        for numbers, points in zip(mesh.base.T, rows, strict=True)
        for number, point in zip(numbers, points, strict=True)
    ]
    numbers = after(mesh.blocks[-1]) + np.arange(len(mesh.base_elements))
    text = (
        card("NODE, NSET=BASE", nodes)
        + card("ELEMENT, TYPE=CPE4, ELSET=BASE", np.column_stack([numbers, mesh.base_elements]))
        + node_set("GROUND", mesh.base[:, 1])
        + card("SOLID SECTION, ELSET=BASE, MATERIAL=STRIP", [(1.0,)])
        + card("SURFACE, NAME=BOTTOM", ((e, "S1") for e in mesh.bottom_elements))
        + card("SURFACE, NAME=GROUND", ((e, "S3") for e in numbers))
        + card("SURFACE INTERACTION, NAME=CONTACT")
        + normal_behaviour(stiffness.normal)
    )
    if float(scene.contact.friction) > 0.0:
        smooth = SMOOTH * float(scene.contact.friction)
        text += card("FRICTION", [(smooth, stiffness.stick)])
    return text + card(
        "CONTACT PAIR, INTERACTION=CONTACT, TYPE=SURFACE TO SURFACE", [("BOTTOM", "GROUND")]
    )


def _constraints(scene: Scene, mesh: Mesh) -> str:
    """What the nodes of a face have in common, also with reference nodes.

    Under displacement control the end face's mean u_x is the sum of two: one is free while the
    strip is pressed down and frozen then, the other is driven.  Without a foundation the far face's
    mean u_y is held, an even shear traction.
    """
    free, driven = references(mesh)
    text = card("NODE", [(free, mesh.x[-1], 0.0), (driven, mesh.x[-1], 0.0)])
    text += _entry(scene, mesh)
    if scene.load.control == "displacement":
        terms = [(n, 1, w) for n, w in zip(mesh.number[-1, ::-1], mesh.shares[::-1], strict=True)]
        text += equation([*terms, (free, 1, -1.0), (driven, 1, -1.0)])
    if scene.contact.normal == "none":
        text += equation([(n, 2, w) for n, w in zip(mesh.number[0], mesh.shares, strict=True)])
    return text


def _entry(scene: Scene, mesh: Mesh) -> str:
    """Equations of the section X = L, by how the force enters there."""
    section, top = mesh.number[-1], int(mesh.number[-1, -1])
    if scene.load.entry == "guided":
        return "".join(equation([(n, 1, 1.0), (top, 1, -1.0)]) for n in section[:-1])
    if scene.load.entry == "face":
        parts = zip(section[1:-1], mesh.y[1:-1] / mesh.y[-1], strict=True)
        return "".join(
            equation([(n, 1, 1.0), (section[0], 1, y - 1.0), (top, 1, -y)]) for n, y in parts
        )
    if mesh.beyond is None:
        return ""
    distances = references(mesh)[-1] + 1 + np.arange(section.size)
    return tie(section, mesh.beyond.number[0], distances, mesh.x[-1], mesh.y)


def tie(
    section: np.ndarray, twin: np.ndarray, distances: np.ndarray, x: float, y: np.ndarray
) -> str:
    """Equations of a section with its twin; between them are the nodes of the set DISTANCES.

    Parameters
    ----------
    section, twin, distances : (k,) numbers of the nodes
    x, y : position of the section, and heights (k,) of its nodes
    """
    places = ((n, x, height) for n, height in zip(distances, y, strict=True))
    text = card("NODE, NSET=DISTANCES", places)
    for nodes in zip(section, twin, distances, strict=True):
        for direction in (1, 2):
            text += equation([(n, direction, f) for n, f in zip(nodes, SUM, strict=True)])
    return text


def references(mesh: Mesh) -> tuple[int, int]:
    """Numbers of the reference nodes of displacement control: the free one and the driven one."""
    last = int(mesh.base[-1, 1])
    return last + 1, last + 2


def _step(
    scene: Scene, mesh: Mesh, step: Step, stiffness: Penalty, pressing: list[tuple[int, float]]
) -> str:
    """One step; what stays as it was in the step before, CalculiX keeps."""
    contact, controlled = scene.contact, scene.load.control == "displacement"
    founded = contact.normal != "none"
    text = card(f"STEP, INC={MOST_PARTS}{', NLGEOM' if scene.plan.kinematics == 'exact' else ''}")
    text += card("STATIC", [(1.0, 1.0, SMALLEST_PART, 1.0)])
    if founded and not step.rough and (step.begins or step.softer < 1.0):
        text += card("CHANGE SURFACE BEHAVIOR, INTERACTION=CONTACT")
        text += normal_behaviour(step.softer * stiffness.normal)
    if founded and step.rough and step.begins and float(contact.friction) > 0.0:
        text += card("CHANGE FRICTION, INTERACTION=CONTACT")
        text += card("FRICTION", [(float(contact.friction), stiffness.stick)])
    free, driven = references(mesh)
    if step.begins:
        text += card("BOUNDARY, OP=NEW", _supports(scene, mesh, step.rough))
        frozen = [(free, 1, 1)] if controlled else []
        frozen += [("DISTANCES", 1, 2)] if mesh.beyond is not None else []
        text += card("BOUNDARY, FIXED", frozen) if frozen and step.rough else ""
    if controlled and step.rough:
        text += card("BOUNDARY", [(driven, 1, 1, step.load)])
    text += card("CLOAD", [(node, 2, step.pressure * force) for node, force in pressing])
    if not controlled:
        even = zip(mesh.loaded, step.load * mesh.shares, strict=True)
        text += card("CLOAD", [(node, 1, force) for node, force in even])
    if step.begins:
        wanted = {"STRIP": "U", "FAR": "RF"} | ({"GROUND": "RF"} if founded else {})
        for nodes, what in wanted.items():
            text += card(f"NODE PRINT, NSET={nodes}, FREQUENCY={MOST_PARTS}", [(what,)])
        text += card(f"EL PRINT, ELSET=STRIP, TOTALS=ONLY, FREQUENCY={MOST_PARTS}", [("ELSE",)])
    return text + card("END STEP")


def _supports(scene: Scene, mesh: Mesh, rough: bool) -> list[tuple[object, ...]]:
    free, driven = references(mesh)
    held: list[tuple[object, ...]] = [(free, 2, 3), (driven, 2, 3)]
    if scene.strip.far_end == "guided":
        held.append(("FAR", 1, 1))
    elif scene.strip.far_end == "pinned" or not rough:  # a free end is held by friction alone
        held.append((int(mesh.number[0, 0]), 1, 1))
    if scene.contact.normal != "none":
        held.append(("BASE", 1, 3))
    if scene.load.control == "force":
        held += [(free, 1, 1), (driven, 1, 1)]
    elif not rough:
        held.append((driven, 1, 1))
    if mesh.beyond is not None and not rough:
        held.append(("BEYOND", 1, 2))
    return held


def _pressing(scene: Scene, mesh: Mesh) -> list[tuple[int, float]]:
    """Nodes on which the pressures act, and their forces upwards."""
    contact = scene.contact
    found: list[tuple[int, float]] = []
    for sign, pressure, row in ((-1.0, contact.pressure, -1), (1.0, contact.bottom_pressure, 0)):
        forces = sign * nodal_loads(mesh.columns, mesh.order, pressure)
        acts = forces != 0.0
        found += zip(mesh.number[acts, row].tolist(), forces[acts].tolist(), strict=True)
    return found

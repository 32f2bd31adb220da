"""Cards for CalculiX and Abaqus: cubes in simple shear on the same eight nodes.

A spring of a table there has no hysteresis.  A cube of side a between two plates that only shift
along x is sheared by gamma = u/a and carries F = G a u up to F = tau_y a^2.  With nu = 0 its stress
is shear alone, so that with G = k/a and the yield stress sqrt(3) phi/a^2 (von Mises, perfectly
plastic) it is the slider exactly.  Cubes on the same nodes are in parallel.
"""

from __future__ import annotations

import math
from pathlib import Path

from jbeamshell.dynamics.export.element import Element

FIRST = 90001  # number of the first node and element
LARGEST_SHEAR = 1e-4
CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))


def write(element: Element, draft: Path) -> None:
    """Write the cards of a joint between two reference nodes."""
    reach, base, top = element.reach, FIRST + 8, FIRST + 9
    side = 10.0 ** math.ceil(math.log10(reach / LARGEST_SHEAR))
    notes = [
        "In a model: *INCLUDE this file before the first step.  Degree of freedom 1 of node",
        f"{base} (set JOINT_BASE) and of node {top} (JOINT_END) are the two ends: fix one, or tie",
        "each to its member; u is the second less the first.",
        "Limits: one direction, no lift, linear geometry.  Shear strains stay below "
        f"{LARGEST_SHEAR:g}.",
        "The cards are those of CalculiX, which was run with them, and of Abaqus, which was not.",
        "Numbers have 14 digits, because a field of a card has 20 characters.",
    ]
    lines = ["*NODE, NSET=JOINT"]
    for z, plate in ((0.0, FIRST), (side, FIRST + 4)):
        for i, (x, y) in enumerate(CORNERS):
            lines.append(f"{plate + i},{x * side!r},{y * side!r},{z!r}")
    lines += [f"{base},0.,0.,{-side!r}", f"{top},0.,0.,{2.0 * side!r}"]
    lines += ["*NSET, NSET=JOINT_BASE", f"{base}", "*NSET, NSET=JOINT_END", f"{top}"]
    spring = [] if element.slides else [(element.spring, None)]
    for number, (stiffness, limit) in enumerate([*element.sliders, *spring]):
        lines += _cube(number, stiffness, limit, side)
    for i in range(8):
        lines += ["*EQUATION", "2", f"{FIRST + i},1,1.,{base if i < 4 else top},1,-1."]
    lines.append("*BOUNDARY")
    lines += [f"{FIRST + i},2,3" for i in range(10)]
    draft.write_text(element.comment("**", notes) + "\n".join(lines) + "\n", encoding="ascii")


def _cube(number: int, stiffness: float, limit: float | None, side: float) -> list[str]:
    """Element and material of a slider; without a limit, of the spring."""
    name, nodes = f"JOINT{number}", ",".join(str(FIRST + i) for i in range(8))
    cards = [f"*ELEMENT, TYPE=C3D8, ELSET={name}", f"{FIRST + number},{nodes}"]
    cards += [f"*MATERIAL, NAME={name}", "*ELASTIC", f"{2.0 * stiffness / side:.13e},0."]
    if limit is not None:
        cards += ["*PLASTIC", f"{math.sqrt(3.0) * limit / side**2:.13e},0."]
    return [*cards, f"*SOLID SECTION, ELSET={name}, MATERIAL={name}"]

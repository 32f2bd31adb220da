"""OpenSeesPy lines: ElasticPP materials in Parallel, on a zeroLength element."""

from __future__ import annotations

from pathlib import Path

from jbeamshell.dynamics.export.element import Element, rows

CODE = '''

def add_joint(element, start, end, first_material=1, direction=1):
    """Add the joint between two nodes at one place; returns the tag of its material.

    It takes len(SLIDERS) + 2 tags of materials from first_material on.
    """
    tags = range(first_material, first_material + len(SLIDERS) + 1)
    for tag, (stiffness, limit) in zip(tags, SLIDERS):
        ops.uniaxialMaterial("ElasticPP", tag, stiffness, limit / stiffness)
    ops.uniaxialMaterial("Elastic", tags[-1], SPRING)
    joint = tags[-1] + 1
    ops.uniaxialMaterial("Parallel", joint, *tags)
    ops.element("zeroLength", element, start, end, "-mat", joint, "-dir", direction)
    return joint


def forces(path):
    """Forces on a path of displacements, one static step for each of them."""
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    ops.node(1, 0.0)
    ops.node(2, 0.0)
    ops.fix(1, 1)
    add_joint(1, 1, 2)
    ops.timeSeries("Path", 1, "-time", *range(len(path) + 1), "-values", 0.0, *path)
    ops.pattern("Plain", 1, 1)
    ops.sp(2, 1, 1.0)
    ops.constraints("Lagrange")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.test("NormUnbalance", 1.0, 10)
    ops.algorithm("Linear")
    ops.integrator("LoadControl", 1.0)
    ops.analysis("Static")
    found = []
    for _ in path:
        if ops.analyze(1) != 0:
            raise RuntimeError("OpenSees found no equilibrium")
        found.append(ops.basicForce(1)[0])
    return found


if __name__ == "__main__":
    cycle = [REACH * k / 20 for k in [*range(1, 21), *range(19, -21, -1), *range(-19, 21)]]
    for u, force in zip(cycle, forces(cycle)):
        print(f"{u:.12g},{force:.12g}")
'''


def write(element: Element, draft: Path) -> None:
    """Write a module with `add_joint`; run as a script it prints a loop."""
    notes = [
        "In a model: import this file and call add_joint(element, start, end) between two nodes",
        "at one place.  OpenSees takes changes of u below 2.2e-16 for none: choose a unit of",
        "length in which u is well above.",
    ]
    draft.write_text(
        element.comment("#", notes)
        + "\nimport openseespy.opensees as ops\n\n"
        + "# stiffness and slip force of each slider\nSLIDERS = "
        + rows(element.sliders)
        + f"SPRING = {element.spring!r}\nREACH = {element.reach!r}\n"
        + CODE,
        encoding="utf-8",
    )

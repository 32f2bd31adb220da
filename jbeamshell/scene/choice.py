"""Choice of the settings that a scene leaves open: kinematics, solution, grid and load steps.

A setting whose value is `AUTO` is chosen when a scene is made, for its ``model.tolerance``.  The
rules were measured (calibration/campaign.py, calibration/default_settings.py).

* Rotations are linear where the bound on what that leaves out is a small part of the tolerance,
  see `jbeamshell.scene.linearisation`.
* A lap joint is linear, and solved on its contact line.
* A linear strip on a rigid base with sharp friction is solved on its contact line, which is exact
  in time.  Any other strip is solved in load steps.
* A strip that bends may lift off.  Where strips that lift were held down, their dissipation was off
  by 1 to 10 %.  Linear load steps with sharp friction keep the fields that they are given.
* Where the corner may open, elements are smaller at the loaded end.  In load steps this is so only
  if friction is without elastic slip, and not under curved strips, whose large motions round off on
  small elements.  On the contact line elastic sliders have far smaller ones.  The strip rests on
  its last node there, and the slider of a single node is as stiff as the node is long: in the limit
  it holds nothing.

In a JAX transformation numbers are unknown: settings stay as they were chosen for the scene that
was changed.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import numpy as np

from jbeamshell.common.checks import is_traced
from jbeamshell.mechanics.elements import END_SIZE
from jbeamshell.mechanics.friction import SharpSlip
from jbeamshell.scene.buckling import weakest_column
from jbeamshell.scene.domain import Numbers
from jbeamshell.scene.keys import ARC_LENGTH, CONTROLS, KAPPA_S, TABLE
from jbeamshell.scene.linearisation import Parts, linear_errors
from jbeamshell.scene.parts import Model
from jbeamshell.scene.rows import AUTO
from jbeamshell.scene.rungs import CONDENSED, FIELDS_OF, PLANE_NODES
from jbeamshell.scene.section_error import known_beforehand

SQUEEZE = FIELDS_OF["squeeze"]
WHOLE = ("v", "w", *SQUEEZE[1:])
LINEAR_PART = 0.2  # of the tolerance that linear rotations may take
SECTION_PART = 0.8  # of the tolerance that the section may take
FEW_STEPS = 1  # load steps per half cycle where only figures of a cycle are asked of exact events


class Grid(NamedTuple):
    """Grid of a kind of strip, and its error as it was measured.

    Attributes
    ----------
    nodes : number of nodes for `KNOWN`
    end_size : smallest elements before scaling, in units of H
    order : order of the error in the number of nodes
    steps : load steps per half cycle, which draw a loop; exact events need none of them
    halvings : times that elements are halved to keep the tolerance, at most
    """

    nodes: int
    end_size: float
    order: float
    steps: int
    halvings: int = 0


KNOWN = 0.005  # tolerance for which the grids were measured
MOST_CONDENSED = 129  # nodes that are given, beyond which events cost more than load steps
CONTACT_LINE = Grid(65, 1.0 / 48.0, 2.0, 20, halvings=2)
SOFT_CONTACT_LINE = Grid(97, 2.0**-16 / 48.0, 2.0, 20, halvings=1)  # of sliders with elastic slip
MOST_REFINED = 513  # nodes of a grid that was refined
PLANE = Grid(PLANE_NODES, END_SIZE, 2.0, 20)
MOST_JUMPS = 4  # of the pressure that add nodes
PER_STEP = 0.5  # of the elements, for each step of the pressure inside the strip
BOTH_ENDS = 1.75  # of the elements, for corners at both ends of a lap joint
STEPWISE = Grid(161, END_SIZE, 1.5, 40)
LIFTING = Grid(161, 1.0 / 48.0, 1.5, 40)  # load steps of a strip whose corner may open
ARC_STEPS = 120  # load steps per half cycle, whose chords are shorter than a bending path


def choose(scene: Parts, numbers: Numbers | None = None) -> tuple[dict[str, Any], ...]:
    """Values for a scene's load and its model that differ from those it has.

    Parameters
    ----------
    scene : scene, some of whose settings may be `AUTO`
    numbers : values by dotted key of many scenes, for settings that serve all of them; None is
        those of the scene
    """
    load, model = scene.load, scene.model
    open_load, open_model = load.open, model.open
    if not load.as_given and not model.as_given and not open_load and not open_model:
        return {}, {}
    found: dict[str, Any] = {}
    if "kinematics" in open_model:
        found["kinematics"] = _kinematics(scene, numbers)
    linear = found.get("kinematics", model.kinematics) == "linear"
    fields, sharp = model.given("fields"), isinstance(scene.contact.law, SharpSlip)
    enough = SECTION_PART * model.tolerance
    elastic = linear and is_elastic(scene, numbers) and _squeeze_error(scene, numbers) > enough
    fields = SQUEEZE if fields == AUTO else fields
    if elastic:
        found["solution"], fields = "plane", WHOLE
    elif "solution" in open_model:
        found["solution"] = "condensed" if linear and may_condense(scene) else "stepwise"
        simple = found["solution"] == "stepwise" and linear and sharp
        bends = "beta" in fields and scene.contact.normal != "none"
        if bends and not simple and "w" not in fields:
            fields = ("v", "w", *fields[1:])
    found["fields"] = fields
    solution = found.get("solution", model.solution)
    adapts = "nodes" in open_model or solution not in CONDENSED
    opens = "w" in fields and scene.strip.curvature is None
    grid = _grid(solution, opens, adapts and _is_soft(scene, numbers))
    if "end_size" in open_model:
        found["end_size"] = grid.end_size
    if "nodes" in open_model:
        found["nodes"] = _nodes(grid, scene)
    many = ARC_STEPS if load.control == ARC_LENGTH else grid.steps
    steps = {"steps_per_half_cycle": many} if "steps_per_half_cycle" in open_load else {}
    return tuple(
        {name: value for name, value in values.items() if getattr(part, name) != value}
        for part, values in ((load, steps), (model, found))
    )


def is_elastic(scene: Parts, numbers: Numbers | None = None) -> bool:
    """True if a scene leaves its section open, and plane elasticity can stand for it.

    A squeeze-shear factor of the user's own is a number that elasticity does not have.  A traced
    one may be any number where a scene is made; in a scene that was made before it is as it was.

    Parameters
    ----------
    scene, numbers : see `choose`
    """
    model, kappa_s = scene.model, scene.strip.kappa_s
    left_open = {"fields", "solution"} <= set(model.open) and model.order == 0
    if not left_open or model.constants != "consistent":
        return False
    if is_traced(kappa_s):
        return model.solution != AUTO and may_condense(scene)
    factors = (numbers or scene.number)(KAPPA_S)
    return bool(np.all(factors == TABLE[KAPPA_S].default)) and may_condense(scene)


def _squeeze_error(scene: Parts, numbers: Numbers | None) -> float:
    """Error of the squeeze section beside plane elasticity; infinite where it is not known."""
    if is_traced(scene.strip, scene.contact, scene.load):
        return float(np.inf)
    with jax.ensure_compile_time_eval():
        known = known_beforehand(scene, "squeeze", numbers or scene.number)
    return float(np.inf) if known is None else known.largest


def _grid(solution: str, opens: bool, soft: bool) -> Grid:
    """Grid of a kind of strip for the tolerance `KNOWN`."""
    if solution == "plane":
        return PLANE
    if solution in CONDENSED:
        return SOFT_CONTACT_LINE if soft else CONTACT_LINE
    return LIFTING if opens and not soft else STEPWISE


def _is_soft(scene: Parts, numbers: Numbers | None) -> bool:
    """True if sliders are elastic, in any of many scenes."""
    if numbers is None or scene.contact.stick_stiffness is not None:
        return scene.contact.stick_stiffness is not None
    return not np.all(np.isnan(numbers("contact.stick_stiffness")))


def _nodes(grid: Grid, scene: Parts) -> int:
    """Odd number of nodes of a grid for a scene's tolerance."""
    elements = (grid.nodes - 1) * (KNOWN / scene.model.tolerance) ** (1.0 / grid.order)
    if grid in (CONTACT_LINE, SOFT_CONTACT_LINE):
        elements *= 1.0 + PER_STEP * min(scene.contact.jumps, MOST_JUMPS)
    elif grid is PLANE and scene.member.support != "none":
        elements *= BOTH_ENDS
    return 2 * int(np.ceil(elements / 2.0)) + 1


def refinements(scene: Parts) -> int:
    """Number of times that a scene's elements may be halved to keep its tolerance.

    The grid must be open and the contact line a section's: a finer one of plane elasticity takes
    longer than what it leaves is worth.
    """
    model = scene.model
    if "nodes" not in model.open:
        return 0
    grid = _grid(model.solution, "w" in model.fields, _is_soft(scene, None))
    halvings = range(1, grid.halvings + 1)
    return sum(2**times * (model.nodes - 1) < MOST_REFINED for times in halvings)


def finer(model: Model) -> dict[str, Any]:
    """Values for a model with elements half as large."""
    ends = {"end_size": 0.5 * model.end_size} if "end_size" in model.open else {}
    return {"nodes": 2 * model.nodes - 1, **ends}


def elasticity(scene: Parts) -> dict[str, Any]:
    """Values for the model of a scene that is to be plane elasticity on a grid of its own."""
    model = scene.model
    found: dict[str, Any] = {"solution": "plane", "fields": WHOLE}
    if "end_size" in model.open:
        found["end_size"] = PLANE.end_size
    if "nodes" in model.open:
        found["nodes"] = _nodes(PLANE, scene)
    return found


def _kinematics(scene: Parts, numbers: Numbers | None) -> str:
    """Linear kinematics where rotations do not matter, exact ones elsewhere or where unknown."""
    strip, contact, load, model = scene.strip, scene.contact, scene.load, scene.model
    if scene.member.support != "none":
        return "linear"
    if is_traced(strip, contact, load):
        before = model.kinematics
        return "exact" if before == AUTO else before
    bounded = strip.curvature is None and contact.normal == "rigid" and scene.energy is None
    if not bounded or load.control not in CONTROLS:
        return "exact"
    elastic = model.order > 0 or model.given("solution") == "plane" or is_elastic(scene, numbers)
    # Numbers stay numbers within a caller's jit; the largest there are may overflow.
    with jax.ensure_compile_time_eval(), np.errstate(all="ignore"):
        error = linear_errors(strip, load, elastic, numbers or scene.number)
        column = weakest_column(scene, numbers)
    known = error[np.isfinite(error)]  # lanes of a sweep outside the domain have none
    allowed = LINEAR_PART * model.tolerance
    if is_elastic(scene, numbers):  # better linear than a section that is further off
        allowed = max(allowed, _squeeze_error(scene, numbers))
    small = known.size > 0 and np.max(known) <= allowed
    return "linear" if small and not column.near else "exact"


def may_condense(scene: Parts) -> bool:
    """True if a strip with linear kinematics can be solved on its contact line, and soon."""
    contact, load, model = scene.contact, scene.load, scene.model
    if scene.member.support != "none":
        return True
    few = "nodes" in model.open or model.nodes <= MOST_CONDENSED
    fields = model.given("fields")
    section = fields == AUTO or "beta" in fields
    section = section and model.squeeze == "field" and scene.energy is None
    base = contact.normal == "rigid" and isinstance(contact.law, SharpSlip)
    straight = scene.strip.curvature is None and model.grid == "finite-difference"
    return few and section and base and straight and load.control in CONTROLS and load.cycles > 0


def in_words(scene: Parts) -> str:
    """One line that says what a scene has chosen; empty if it left nothing open."""
    load, model = scene.load, scene.model
    lifts = "w" in model.fields and "w" not in model.given("fields")
    lifts = lifts and model.solution != "plane"
    shown = {
        "solution": f"rung {model.rung}" + " that may lift off" * lifts,
        "kinematics": f"{model.kinematics} kinematics",
        "nodes": f"{model.nodes} nodes",
        "steps_per_half_cycle": f"{load.steps_per_half_cycle} steps per half cycle",
    }
    found = [words for name, words in shown.items() if name in (*model.open, *load.open)]
    if not found:
        return ""
    percent = 100.0 * model.tolerance
    return f"chosen to be within {percent:g} % of {reference(scene)}: {', '.join(found)}"


def reference(scene: Parts) -> str:
    """Words for what a scene's tolerance is relative to."""
    elastic = scene.model.solution == "plane" or is_elastic(scene)
    return "plane elasticity" if elastic else "its own fine mesh"

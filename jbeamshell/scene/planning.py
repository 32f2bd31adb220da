"""Rules by which a scene is planned: section, kinematics, engine, grid and load steps.

A setting that is `AUTO` is decided here, when a scene is made, for its ``model.tolerance``.  The
rules were measured (verification/campaign.py, verification/default_settings.py).

* A strip is plane elasticity wherever that can stand for it, whatever its numbers are.  Else it is
  the beamshell with its squeeze strain.
* Plane elasticity has linear rotations.  Where these are known to be far off, or a part without
  pressure comes near to buckling, the beamshell with exact rotations takes its place.  The
  beamshell has linear ones where the bound on what they leave out is a small part of the tolerance,
  see `jbeamshell.scene.linearisation`.
* A strip that is only pressed, and unevenly, is plane elasticity on small elements.
* A linear strip on a rigid base with sharp friction is solved on its contact line, which is exact
  in time; its strain energy may be a quadratic one of the user's own.  So are plane elasticity and
  lap joints.  Any other strip is solved in load steps.
* A strip that bends may lift off.  Where strips that lift were held down, their dissipation was off
  by 1 to 10 %.
* Where the corner may open, elements are smaller at the loaded end.  In load steps this is so only
  if friction is without elastic slip, and not under curved strips, whose large motions round off on
  small elements.  On the contact line elastic sliders have far smaller ones.  The strip rests on
  its last node there, and the slider of a single node is as stiff as the node is long: in the limit
  it holds nothing.

In a JAX transformation numbers are unknown: a plan stays that of the scene that was changed.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import numpy as np

from jbeamshell.common.checks import is_traced
from jbeamshell.mechanics.elements import END_SIZE
from jbeamshell.mechanics.friction import SharpSlip
from jbeamshell.scene.buckling import weakest_column
from jbeamshell.scene.domain import Numbers
from jbeamshell.scene.keys import ARC_LENGTH, CONTROLS, KAPPA_S, TABLE
from jbeamshell.scene.linearisation import Parts, linear_errors
from jbeamshell.scene.plan import LINE, STEPS, Plan
from jbeamshell.scene.quadratic import is_quadratic
from jbeamshell.scene.rows import AUTO

LINEAR_PART = 0.2  # of the tolerance that the beamshell's linear rotations may take
ROTATES = 0.05  # error of linear rotations from which on exact ones are worth the plainer section
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
PLANE_NODES = 67  # of plane elasticity for that
CONTACT_LINE = Grid(65, 1.0 / 48.0, 2.0, 20, halvings=2)
BAR = Grid(97, 1.0 / 16.0, 2.0, 20, halvings=2)  # D within a tenth of the tolerance
SOFT_CONTACT_LINE = Grid(97, 2.0**-16 / 48.0, 2.0, 20, halvings=1)  # of sliders with elastic slip
MOST_REFINED = 513  # nodes of a grid that was refined
PLANE = Grid(PLANE_NODES, END_SIZE, 2.0, 20, halvings=2)
PRESSED_SIZE = 0.125  # largest elements over H of a strip that is only pressed
MOST_JUMPS = 4  # of the pressure that add nodes
PER_STEP = 0.5  # of the elements, for each step of the pressure inside the strip
BOTH_ENDS = 3.0  # of the elements, for corners at both ends of a lap joint and bolts between
STEPWISE = Grid(161, END_SIZE, 1.5, 40)
LIFTING = Grid(161, 1.0 / 48.0, 1.5, 40)  # load steps of a strip whose corner may open
ARC_STEPS = 120  # load steps per half cycle, whose chords are shorter than a bending path


def plan(scene: Parts, numbers: Numbers | None = None) -> Plan:
    """Plan of a scene: settings that are given stay, and those that are open are decided.

    Parameters
    ----------
    scene : scene, some of whose settings may be `AUTO`; its plan is that of the scene that was
        changed, or None if it is new
    numbers : values by dotted key of many scenes, all of which the plan is to serve; None is those
        of the scene
    """
    load, model, contact = scene.load, scene.model, scene.contact
    kinematics, section = model.kinematics, model.section
    if kinematics == AUTO:
        kinematics = _kinematics(scene, numbers)
    if section == AUTO:
        elastic = kinematics == "linear" and may_be_elastic(scene, numbers)
        section = "plane" if elastic else "squeeze"
    engine = _engine(scene, section, kinematics)
    lifts = section != "bar" and contact.normal != "held"
    opens = lifts and scene.strip.curvature is None
    grid = _grid(section, engine, opens, _is_soft(scene, numbers))
    steps = ARC_STEPS if load.control == ARC_LENGTH else grid.steps
    return Plan(
        section,
        kinematics,
        engine,
        lifts,
        nodes=_nodes(grid, scene, numbers) if model.nodes == AUTO else model.nodes,
        end_size=grid.end_size if model.end_size == AUTO else float(model.end_size),
        steps=steps if load.steps_per_half_cycle == AUTO else load.steps_per_half_cycle,
    )


def _engine(scene: Parts, section: str, kinematics: str) -> str:
    """Engine of a section: the contact line where it can stand for it."""
    if scene.model.by == "steps":
        return STEPS
    if section == "plane" or scene.member.support != "none":
        return LINE
    line = kinematics == "linear" and section != "assumed" and has_contact_line(scene)
    return LINE if line and _is_linear(scene, section) else STEPS


def _is_linear(scene: Parts, section: str) -> bool:
    """True if a strain energy of the user's own, if there is one, makes a linear section.

    It could bend a bar, which is held down then.
    """
    energy, half_height = scene.energy, scene.strip.half_height
    if energy is None or section == "bar":
        return energy is None
    if is_traced(energy, half_height):
        return scene.plan is not None and scene.plan.on_contact_line
    return is_quadratic(energy, half_height, section != "shell")


def has_contact_line(scene: Parts) -> bool:
    """True if a strip with linear kinematics can be solved on its contact line."""
    if scene.member.support != "none":
        return True
    return _is_straight(scene) and scene.load.control in CONTROLS and scene.load.cycles > 0


def only_pressed(scene: Parts) -> bool:
    """True if a single strip on its base has no load but a pressure that may leave gaps."""
    pressed = scene.load.cycles == 0 and scene.contact.pressure.ndim > 0
    return pressed and scene.member.support == "none" and _is_straight(scene)


def _is_straight(scene: Parts) -> bool:
    """True for a straight strip on a rigid base with sharp friction."""
    base = scene.contact.normal == "rigid" and isinstance(scene.contact.law, SharpSlip)
    return base and scene.strip.curvature is None and scene.model.grid == "finite-difference"


def may_be_elastic(scene: Parts, numbers: Numbers | None = None) -> bool:
    """True if a scene leaves its section open, and plane elasticity can stand for it.

    A squeeze-shear factor of the user's own is a number that elasticity does not have.  A traced
    one may be any number in a new scene; in a scene that was made before it has kept its value.

    Parameters
    ----------
    scene, numbers : see `plan`
    """
    model, kappa_s = scene.model, scene.strip.kappa_s
    if model.section != AUTO or model.by != AUTO or model.constants != "consistent":
        return False
    if scene.energy is not None:
        return False
    if is_traced(kappa_s):
        return scene.plan is not None and has_contact_line(scene)
    default = TABLE[KAPPA_S].default
    in_either_precision = default, float(np.float32(default))
    factors = (numbers or scene.number)(KAPPA_S)
    solvable = has_contact_line(scene) or only_pressed(scene)
    return bool(np.all(np.isin(factors, in_either_precision))) and solvable


def _kinematics(scene: Parts, numbers: Numbers | None) -> str:
    """Linear kinematics where rotations do not matter, exact ones elsewhere or where unknown.

    Strips of a sweep that may be plane elasticity are so together; `turning` says which need exact
    rotations and have a plan of their own.
    """
    strip, contact, load, model = scene.strip, scene.contact, scene.load, scene.model
    if scene.member.support != "none" or model.section in ("plane", "bar"):
        return "linear"
    may_be = may_be_elastic(scene, numbers)
    if is_traced(strip, contact, load):
        unknown = "linear" if may_be else "exact"
        return unknown if scene.plan is None else scene.plan.kinematics
    bounded = strip.curvature is None and contact.normal in ("rigid", "held")
    if not bounded or scene.energy is not None or load.control not in CONTROLS:
        return "exact"
    allowance = ROTATES if may_be else LINEAR_PART * model.tolerance
    errors, near = _errors_of_rotations(scene, numbers, may_be)
    known = np.isfinite(errors)  # lanes of a sweep outside the domain have none
    turns = ((errors > allowance) | near)[known]
    exact = np.all(turns) if may_be else np.any(turns)
    return "exact" if exact else "linear"


def turning(scene: Parts, numbers: Numbers) -> np.ndarray:
    """True for strips of a sweep that need exact rotations while the others are plane elasticity.

    Parameters
    ----------
    scene : scene with all that is not varied, whose settings are open
    numbers : values by dotted key of the strips

    Returns
    -------
    array of bool
        of the shape that the numbers broadcast to
    """
    if scene.model.kinematics != AUTO or scene.member.support != "none":
        return np.zeros((), bool)
    if not may_be_elastic(scene, numbers):
        return np.zeros((), bool)
    errors, near = _errors_of_rotations(scene, numbers, True)
    return np.isfinite(errors) & ((errors > ROTATES) | near)


def _errors_of_rotations(
    scene: Parts, numbers: Numbers | None, elastic: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Errors of linear rotations, and True where a part without pressure may buckle."""
    # Numbers stay numbers within a caller's jit; the largest there are may overflow.
    with jax.ensure_compile_time_eval(), np.errstate(all="ignore"):
        errors = linear_errors(scene.strip, scene.load, elastic, numbers or scene.number)
        near = weakest_column(scene, numbers).near
    errors, near = np.broadcast_arrays(errors, near)
    return errors, near


def _grid(section: str, engine: str, opens: bool, soft: bool) -> Grid:
    """Grid of a kind of strip for the tolerance `KNOWN`."""
    if section == "plane":
        return PLANE
    if engine == LINE and section == "bar":
        return BAR
    if engine == LINE:
        return SOFT_CONTACT_LINE if soft else CONTACT_LINE
    return LIFTING if opens and not soft else STEPWISE


def _is_soft(scene: Parts, numbers: Numbers | None) -> bool:
    """True if sliders are elastic, in any of many scenes."""
    if numbers is None or scene.contact.stick_stiffness is not None:
        return scene.contact.stick_stiffness is not None
    return not np.all(np.isnan(numbers("contact.stick_stiffness")))


def _nodes(grid: Grid, scene: Parts, numbers: Numbers | None = None) -> int:
    """Odd number of nodes of a grid for a scene's tolerance."""
    if grid is PLANE and only_pressed(scene) and is_traced(scene.strip) and scene.plan is not None:
        return scene.plan.nodes
    elements = (grid.nodes - 1) * (KNOWN / scene.model.tolerance) ** (1.0 / grid.order)
    if grid in (CONTACT_LINE, SOFT_CONTACT_LINE, BAR):
        elements *= 1.0 + PER_STEP * min(scene.contact.jumps, MOST_JUMPS)
    elif grid is PLANE and scene.member.support != "none":
        elements *= BOTH_ENDS
    elif grid is PLANE and only_pressed(scene) and not is_traced(scene.strip):
        length, height = map(numbers or scene.number, ("strip.length", "strip.half_height"))
        even = float(np.max(length / height)) / PRESSED_SIZE
        elements = min(elements + even, max(elements, MOST_REFINED - 1))
    return 2 * int(np.ceil(elements / 2.0)) + 1


def refinements(scene: Parts) -> int:
    """Number of times that a scene's elements may be halved to keep its tolerance.

    The grid must be open.  That of a lap joint in plane elasticity stays: a finer one takes longer
    than what it leaves is worth.
    """
    plan = scene.plan
    if scene.model.nodes != AUTO or (plan.elastic and scene.member.support != "none"):
        return 0
    opens = plan.lifts and scene.strip.curvature is None
    grid = _grid(plan.section, plan.engine, opens, _is_soft(scene, None))
    halvings = range(1, grid.halvings + 1)
    return sum(2**times * (plan.nodes - 1) < MOST_REFINED for times in halvings)


def finer(scene: Parts) -> Plan:
    """Plan of a scene on elements half as large."""
    plan = scene.plan
    end_size = 0.5 * plan.end_size if scene.model.end_size == AUTO else plan.end_size
    return plan._replace(nodes=2 * plan.nodes - 1, end_size=end_size)


def in_words(scene: Parts) -> str:
    """One line that says for what a grid is planned; empty if it was given."""
    if scene.model.nodes != AUTO:
        return ""
    return f"planned to be within {100.0 * scene.model.tolerance:g} % of {reference(scene)}"


def reference(scene: Parts) -> str:
    """Words for what a scene's tolerance is relative to."""
    return "plane elasticity" if scene.plan.elastic else "its own fine mesh"

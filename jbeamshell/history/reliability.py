"""Reliability of a run: how far its own fields let one trust its figures.

Newton's method finds the equilibrium of a grid, no matter if the grid resolves the contact.  Four
errors would stay unseen.  So few nodes may slip that the grid decides how much they dissipate.  The
reaction may gather in the last node at the corner: the finer the grid, the more, and a strip that
may not lift is even held down there by tension.  And a strip that lifts may rest on single nodes.
The elastic slider of such a node is as stiff as the node is long, so that it holds the less, the
finer the grid.  And load steps may be so long that the reaction changes much within one.

A doubt is a sentence that says what may be wrong, by how much, and what to change.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import jax
import numpy as np
from jax import Array

from jbeamshell.mechanics.friction import coulomb_cap
from jbeamshell.scene.buckling import sway, weakest_column
from jbeamshell.scene.choice import may_condense
from jbeamshell.scene.keys import ARC_LENGTH
from jbeamshell.scene.linearisation import linear_error
from jbeamshell.scene.rungs import general_rung
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.section_error import doubt_of_section

NEGLIGIBLE = 1e-9  # slip over the sticking range, or tension over the pressure, taken as zero
CLOSES = 1e-3  # distance between the ends of a steady loop, over its width
SAFETY = 1.2  # factor on the estimated error of the corner
STEPS = 1.5  # factor on the estimated error of a grid that steps of the pressure share
REFINED = 0.15  # least error of a refined grid, over that of the rule: measured .02 to .13
RESTING = 2.0  # error of the dissipation over the part of the load that single sliders hold
WITHIN_STEPS = 0.1  # error of the dissipation over the work of caps that change within load steps
TOLERANCE = 0.02  # relative error of the dissipation below which there is never a doubt
OVERSHOOT = 1.0  # error under arc-length control, times the load steps per half cycle
FINER = "take a smaller model.end_size or more model.nodes"


class Run(Protocol):
    """Parts of a `jbeamshell.History` that doubts are found from."""

    scene: Scene
    x: Array
    reaction: Array
    cycles: tuple[tuple[int, int, int], ...]
    change: Array | None

    @property
    def converged(self) -> bool: ...
    @property
    def dissipation(self) -> Array: ...
    @property
    def secant_stiffness(self) -> Array: ...
    @property
    def closure(self) -> Array: ...
    @property
    def slip_length(self) -> Array: ...
    @property
    def slip_cycle(self) -> SlipCycle: ...


class SlipCycle(NamedTuple):
    """One load cycle at the nodes of the contact, as arrays of NumPy or of JAX.

    Attributes
    ----------
    x : (n,) positions X, length
    tributary : (n,) contact length of each node
    v : (levels, n) tangential displacement, length
    traction, reaction : (levels, n) friction traction and normal reaction, stress
    friction : Coulomb friction coefficient mu
    slip_stiffness : (n,) k_t, traction per slip
    half_height : H, length
    """

    x: Array
    tributary: Array
    v: Array
    traction: Array
    reaction: Array
    friction: Array
    slip_stiffness: Array
    half_height: Array


def dissipation_errors(cycle: SlipCycle) -> tuple[Array, ...]:
    """Estimated relative errors of a cycle's dissipation: of the grid, and of the loaded corner.

    With the friction work W_i of node i, the number of nodes that share the work is the
    participation ratio P = (sum W_i)^2 / sum W_i^2.  The error of the grid is P^(-3/2).  The error
    of the corner is the part of the work that comes from the jumps of the reaction between
    neighbouring nodes, times the relative fall of the slip over the last H before the end.  Both
    are measured rules, rather too large than too small (calibration/failure_map.py).

    Returns
    -------
    grid, corner : scalars; infinite if nothing slips
    """
    numbers: Any = np if isinstance(cycle.v, np.ndarray) else jax.numpy
    slip, cap = slip_and_cap(cycle)
    work = numbers.sum(slip * cap, axis=0) * cycle.tributary
    total = numbers.sum(work)
    slips = total > 0.0
    whole = numbers.where(slips, total, 1.0)
    grid = grid_error(work)

    excess = numbers.abs(numbers.diff(cycle.reaction, axis=1)) * cycle.tributary[1:]
    excess = 0.5 * cycle.friction * (excess[1:] + excess[:-1])
    gathered = SAFETY * numbers.sum(excess * slip[:, 1:]) / whole
    path = numbers.sum(slip, axis=0)
    x = cycle.x / cycle.half_height  # in units of H: JAX takes very small steps of x as none
    inside = numbers.interp(x[-1] - 1.0, x, path)
    at_end = numbers.where(path[-1] > 0.0, path[-1], numbers.max(path) + 1.0)
    fall = numbers.clip(1.0 - inside / at_end, 0.0, 1.0)
    both = grid, gathered * fall
    return tuple(numbers.where(slips, error, numbers.inf) for error in both)


def grid_error(work: Array) -> Array:
    """Estimated relative error by the grid, P^(-3/2), from the friction work (n,) of its nodes."""
    numbers: Any = np if isinstance(work, np.ndarray) else jax.numpy
    total = numbers.sum(work)
    slips = total > 0.0
    whole = numbers.where(slips, total, 1.0)
    grid = numbers.sum((work / whole) ** 2) ** 1.5
    return numbers.where(slips, grid, numbers.inf)


def slip_and_cap(cycle: SlipCycle) -> tuple[Array, Array]:
    """Amounts of slip (levels - 1, n) in each step of a cycle, and the mean caps there."""
    numbers: Any = np if isinstance(cycle.v, np.ndarray) else jax.numpy
    cap = coulomb_cap(cycle.friction, cycle.reaction)
    cap = 0.5 * (cap[1:] + cap[:-1])
    elastic = numbers.diff(cycle.traction, axis=0) / cycle.slip_stiffness
    slip = numbers.abs(numbers.diff(cycle.v, axis=0) - elastic)
    elastic_slip = numbers.isfinite(cycle.slip_stiffness)
    stiffness = numbers.where(elastic_slip, cycle.slip_stiffness, 1.0)
    some = numbers.where(elastic_slip, stiffness * slip > NEGLIGIBLE * cap, slip > 0.0)
    return numbers.where(some, slip, 0.0), cap


def step_error(cycle: SlipCycle) -> Array:
    """Estimated relative error of a cycle's dissipation by the length of its load steps.

    A load step knows a node's cap only at its beginning and its end.  The larger the change in
    between, the larger the error.  With the changes as caps, friction would do some work; the error
    is taken as `WITHIN_STEPS` times the ratio of that work to the real one.  Strips with mu from .5
    to 1 in 1, 2 and 4 steps per half cycle were off by less than .1 times that ratio, one by .13.

    Returns
    -------
    scalar, zero if nothing slips
    """
    numbers: Any = np if isinstance(cycle.v, np.ndarray) else jax.numpy
    slip, cap = slip_and_cap(cycle)
    change = numbers.abs(numbers.diff(coulomb_cap(cycle.friction, cycle.reaction), axis=0))
    changed, work = (numbers.sum(slip @ cycle.tributary) for slip in (slip * change, slip * cap))
    return WITHIN_STEPS * changed / numbers.where(work > 0.0, work, 1.0)


def slider_error(cycle: SlipCycle) -> Array:
    """Estimated relative error of a cycle's dissipation by elastic sliders of single nodes.

    A node rests alone so far as its reaction R_i exceeds those of its neighbours,
    a_i = 1 - (R_(i-1) + R_(i+1))/R_i.  The stiffness of its slider is k_t l_i, so that on ever
    finer grids it lets go of the friction T_i = max(a_i t_i l_i).  The error is twice the part of
    the load that is let go.  On strips that rest on their corner, the dissipation or the secant
    stiffness was off by .4 to .9 times that part most often, and by 2.3 times at most.

    Returns
    -------
    scalar, zero if sliders are rigid until they slip
    """
    numbers: Any = np if isinstance(cycle.v, np.ndarray) else jax.numpy
    if numbers is np and np.all(np.isinf(cycle.slip_stiffness)):
        return np.zeros(())  # type: ignore[return-value]
    beside = numbers.pad(cycle.reaction, ((0, 0), (1, 1)))
    beside = numbers.maximum(beside[:, 2:] + beside[:, :-2], 0.0)
    pressed = cycle.reaction > 0.0
    alone = 1.0 - beside / numbers.where(pressed, cycle.reaction, 1.0)
    alone = numbers.where(pressed, numbers.maximum(alone, 0.0), 0.0)
    force = cycle.traction * cycle.tributary
    let_go = numbers.sum(numbers.max(numbers.abs(alone * force), axis=0))
    load = 0.5 * numbers.max(numbers.sum(numbers.abs(force - force[0]), axis=1))
    error = RESTING * let_go / numbers.where(load > 0.0, load, 1.0)
    yields = numbers.any(numbers.isfinite(cycle.slip_stiffness))
    return numbers.where(yields & (load > 0.0), error, 0.0)


def doubted_from(tolerance: float) -> float:
    """Estimated error of the dissipation from which on a run is doubted, for its model.tolerance.

    Estimates are rather too large than too small, so that one above a tolerance finer than
    `TOLERANCE` is no doubt yet; a coarser tolerance allows for as much.
    """
    return max(TOLERANCE, tolerance)


def estimates(scene: Scene, cycle: SlipCycle, change: Array | None = None) -> tuple[Array, ...]:
    """Estimated relative errors of a scene's dissipation.

    They are those of the grid, of the loaded corner, of single nodes and of load steps.  That of a
    grid that was refined is the change that this made, which is larger than what is left, and not
    less than a part of the rule's, because two coarse grids may agree by chance.

    The corner has none where it may open, unless friction is elastic: the point reaction then holds
    the last node by a slider that is the softer, the shorter the elements.  A refined grid has told
    what that makes.

    Single nodes hold rigid sliders on any grid that is used.

    Where the pressure has steps, small elements lie there too, and the slip zone holds larger ones
    (measured by calibration/campaign.py).
    """
    grid, corner = dissipation_errors(cycle)
    numbers: Any = np if isinstance(cycle.v, np.ndarray) else jax.numpy
    if change is not None:
        grid = numbers.maximum(change, REFINED * grid)
    elif scene.contact.jumps > 1:
        grid = STEPS * grid
    soft = scene.contact.stick_stiffness is not None
    opens = "w" in scene.model.fields and scene.model.solution != "plane"
    if opens or scene.member.support != "none":
        corner = corner if soft and change is None else numbers.zeros(())
    slider = slider_error(cycle) if soft else numbers.zeros(())
    steps = step_error(cycle) if scene.model.solution == "stepwise" else numbers.zeros(())
    return grid, corner, slider, steps


def change_of(coarse: Run, fine: Run) -> Array:
    """Relative change of dissipation or secant stiffness between two grids, the larger one.

    Where much of a strip lifts off, two grids may agree in one of them by chance.
    """
    one, other = (np.array([run.dissipation, run.secant_stiffness]) for run in (coarse, fine))
    with np.errstate(divide="ignore", invalid="ignore"):  # nothing slips on either
        return jax.numpy.max(np.nan_to_num(np.abs(one / other - 1.0), nan=np.inf))


def misses_tolerance(history: Run) -> bool:
    """True if the estimated error of a run exceeds its tolerance; never without friction."""
    plain = jax.tree.map(np.asarray, history)  # quicker than JAX where nothing is compiled
    if not plain.scene.contact.friction > 0.0:
        return False
    with np.errstate(over="ignore", invalid="ignore"):  # infinite where nothing slips
        errors = estimates(plain.scene, plain.slip_cycle, plain.change)
    return bool(max(errors) > plain.scene.model.tolerance)


def doubts_of_run(history: Run) -> tuple[str, ...]:
    """Doubts about a run that was solved."""
    plain = jax.tree.map(np.asarray, history)  # quicker than JAX where nothing is compiled
    if not plain.converged:
        return ("a load step found no equilibrium: that step and all after it hold NaN",)
    scene = plain.scene
    if scene.model.solution == "closed-form":
        return _section(plain)
    if scene.contact.normal == "none":
        return _buckling(scene)
    if not plain.cycles:
        return _tension(plain)
    resolution = _resolution(plain) if scene.contact.friction > 0.0 else ()
    found = *_unsteady(plain), *resolution, *_tension(plain)
    return *found, *_section(plain), *doubts_of_scene(scene)


def doubts_of_scene(scene: Scene) -> tuple[str, ...]:
    """Doubts about the loop of a scene that need no run."""
    model, found = scene.model, []
    error = linear_error(scene) + sway(scene) if model.kinematics == "linear" else 0.0
    if error > doubted_from(model.tolerance):
        found.append(f"{_off(error)}: kinematics are linear; {_exact(scene)}")
    found += _buckling(scene)
    bent = OVERSHOOT / scene.load.steps_per_half_cycle
    if scene.load.control == ARC_LENGTH and bent > doubted_from(model.tolerance):
        found.append(
            f"{_off(bent)}: arc length is measured along the load steps, and goes too far where "
            "the path bends; take more load.steps_per_half_cycle"
        )
    return tuple(found)


def _exact(scene: Scene) -> str:
    """Fix that makes a scene's kinematics exact."""
    model = scene.model
    if scene.member.support != "none":
        return "a lap joint knows no others: take a smaller load.amplitude"
    rung = f"model.rung = {general_rung(model.rung)} with " if model.condensed else ""
    return f"take {rung}model.kinematics = exact"


def _buckling(scene: Scene) -> tuple[str, ...]:
    """Doubt about a part of a strip under compression, of which linear kinematics know nothing."""
    model = scene.model
    if model.kinematics == "exact" or "w" not in model.fields:
        return ()
    column = weakest_column(scene)
    if not column.near:
        return ()
    part = "part without pressure" if scene.member.support == "none" else "column"
    return (
        f"the {part} from X = {column.begin:.4g} to {column.end:.4g} may buckle: "
        f"its Euler load is {column.limit:.3g} and the compression reaches {column.force:.3g}, "
        f"which linear kinematics do not see; {_exact(scene)}, or press more of the strip",
    )


def _unsteady(history: Run) -> tuple[str, ...]:
    """Doubt about a loop that does not close."""
    with np.errstate(invalid="ignore"):  # a loop without width
        open_by = abs(history.closure)
    if not open_by > CLOSES:
        return ()
    return (
        f"the last loop does not close (by {open_by:.2g} of its width): take more load.cycles "
        "until it is steady",
    )


def _resolution(history: Run) -> tuple[str, ...]:
    """Doubts about the slip zone's resolution by the grid."""
    with np.errstate(over="ignore", invalid="ignore"):  # infinite where nothing slips
        cycle = jax.tree.map(np.asarray, history.slip_cycle)
        errors = estimates(history.scene, cycle, history.change)
        grid, corner, slider, steps = map(float, errors)
    plane, finer = history.scene.model.solution == "plane", finer_grid(history.scene)
    if np.isinf(grid):
        return (
            "nothing slips in the last cycle: slip that is smaller than the elements would not be "
            f"seen; {finer}",
        )
    tolerance = history.scene.model.tolerance
    found, allowed = [], doubted_from(tolerance) if history.change is None else tolerance
    if grid > allowed:
        refined = history.change is not None
        halved = ", and halving the elements changed the loop by as much" * refined
        found.append(f"{_off(grid)}: few nodes do the slipping{halved}; {finer}")
    if corner > allowed:
        fix = "compare with more model.nodes" if plane else "compare with a smaller model.end_size"
        if "w" not in history.scene.model.fields:
            fix = "add w to model.fields and " + fix
        found.append(f"{_off(corner)}: the reaction gathers in the corner at the loaded end; {fix}")
    if slider > allowed:
        found.append(
            f"{_off(slider)}: the strip rests on single nodes, whose elastic sliders are the "
            f"softer, the shorter the elements; {_slider_fix(history.scene)}"
        )
    if steps > allowed:
        found.append(
            f"{_off(steps)}: the reaction changes much within a load step; take more "
            "load.steps_per_half_cycle"
        )
    return tuple(found)


def finer_grid(scene: Scene) -> str:
    """Fix that makes a scene's grid finer."""
    if "nodes" in scene.model.open:  # given nodes may change how the scene is solved
        return "take a smaller model.tolerance"
    plane = scene.model.solution == "plane"  # it has a grid of its own
    return "take more model.nodes" if plane else FINER


def _section(history: Run) -> tuple[str, ...]:
    """Doubt about a section that the user names."""
    model = history.scene.model
    if {"fields", "solution"} <= set(model.open) or not history.cycles:
        return ()
    allowed = doubted_from(model.tolerance)
    doubt = doubt_of_section(history.scene, float(history.slip_length), allowed)
    return (doubt,) if doubt else ()


def _slider_fix(scene: Scene) -> str:
    """Fix for a strip that rests on single nodes with elastic sliders."""
    others = "no contact.stick_stiffness, or model.rung = plane"
    if scene.model.condensed:
        return f"take {others}"
    if scene.model.kinematics == "linear" and may_condense(scene):
        return f"leave model.solution open, or take {others}"
    return f"take {others}, or a smaller model.end_size"


def doubts_of_mesh(error: float) -> tuple[str, ...]:
    """Doubt about the contact of bodies whose mesh has such a `grid_error`."""
    fix = "mesh the contact finer where it slips"
    if np.isinf(error):
        return (
            "nothing slips in the last cycle: slip that is smaller than the elements would not be "
            f"seen; {fix}",
        )
    return (f"{_off(error)}: few nodes do the slipping; {fix}",) if error > TOLERANCE else ()


def _off(error: float) -> str:
    """Beginning of a doubt about the dissipation."""
    by = f"about {100.0 * error:.2g} %" if error < 0.995 else "100 % or more"
    return f"the dissipation may be off by {by}"


def _tension(history: Run) -> tuple[str, ...]:
    """Doubt about a strip that is held down; in a cycle, the corner is left to `_resolution`."""
    reaction, scene = history.reaction, history.scene
    if history.cycles and scene.contact.friction > 0.0:
        reaction = reaction[:, history.x < history.x[-1] - scene.strip.half_height]
    least = float(np.min(reaction, initial=0.0))
    if "w" in scene.model.fields or least >= -NEGLIGIBLE * np.max(np.abs(history.reaction)):
        return ()
    return (
        f"tension at the contact (reaction_min = {least:.4g}): the strip may not lift; add w to "
        "model.fields for unilateral contact, or take fewer model.nodes",
    )

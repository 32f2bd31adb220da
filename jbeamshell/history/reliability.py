"""Reliability of a run: how far its own fields let one trust its figures.

A doubt is a sentence that says what may be wrong, by how much, and what to change.  Sizes are those
of `jbeamshell.history.error_estimates`.
"""

from __future__ import annotations

from typing import Protocol, Self

import numpy as np
from jax import Array

from jbeamshell.history.error_estimates import CLOSES
from jbeamshell.scene.buckling import sway, weakest_column
from jbeamshell.scene.keys import ARC_LENGTH
from jbeamshell.scene.linearisation import linear_error
from jbeamshell.scene.mounting import OVERHANGS, left_open, overhang
from jbeamshell.scene.rows import AUTO
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.section_error import doubt_of_section

NEGLIGIBLE = 1e-9  # tension over the pressure, taken as zero
TOLERANCE = 0.02  # relative error of the dissipation below which there is never a doubt
OVERSHOOT = 1.0  # error under arc-length control, times the load steps per half cycle
FINER = "take more model.nodes"
ALLOW, LESS = "allow for that error", "take a smaller load.amplitude"


class Run(Protocol):
    """Parts of a `jbeamshell.History` that doubts are found from."""

    scene: Scene
    x: Array
    reaction: Array
    cycles: tuple[tuple[int, int, int], ...]
    change: Array | None
    overhung: Array | None

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
    def errors(self) -> tuple[Array, ...]: ...
    @property
    def plain(self) -> Self: ...


def doubted_from(tolerance: float) -> float:
    """Estimated error of the dissipation from which on a run is doubted, for its model.tolerance.

    Estimates are rather too large than too small, so that one above a tolerance finer than
    `TOLERANCE` is no doubt yet; a coarser tolerance allows for as much.
    """
    return max(TOLERANCE, tolerance)


def change_of(coarse: Run, fine: Run) -> Array:
    """Relative change of dissipation or secant stiffness between two grids, the larger one.

    Where much of a strip lifts off, two grids may agree in one of them by chance.
    """
    one, other = (np.array([run.dissipation, run.secant_stiffness]) for run in (coarse, fine))
    with np.errstate(divide="ignore", invalid="ignore"):  # nothing slips on either
        return np.max(np.nan_to_num(np.abs(one / other - 1.0), nan=np.inf))


def ratio_of_losses(one: Run, other: Run) -> Array:
    """Dissipation of a run over that of another; NaN if it did not converge."""
    if not one.converged:
        return np.asarray(np.nan)  # type: ignore[return-value]
    lost, own = np.asarray(one.dissipation), np.asarray(other.dissipation)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(lost == own, 1.0, lost / own)  # type: ignore[return-value]


def misses_tolerance(history: Run) -> bool:
    """True if the estimated error of a run exceeds its tolerance; never without friction."""
    plain = history.plain
    if not plain.scene.contact.friction > 0.0:
        return False
    return bool(max(plain.errors) > plain.scene.model.tolerance)


def doubts_of_run(plain: Run) -> tuple[str, ...]:
    """Doubts about a run that was solved, in arrays of NumPy."""
    if not plain.converged:
        return ("a load step found no equilibrium: that step and all after it hold NaN",)
    scene = plain.scene
    if scene.contact.normal == "none":
        return _buckling(scene)
    if not plain.cycles:
        return _tension(plain)
    resolution = _resolution(plain) if scene.contact.friction > 0.0 else ()
    found = *_unsteady(plain), *resolution, *_tension(plain)
    return *found, *_mounting(plain), *_section(plain), *doubts_of_scene(scene)


def doubts_of_scene(scene: Scene) -> tuple[str, ...]:
    """Doubts about the loop of a scene that need no run."""
    allowed, found = doubted_from(scene.model.tolerance), []
    linear = scene.plan.kinematics == "linear" and scene.plan.section != "bar"  # which never turns
    swayed = sway(scene) if linear else 0.0
    error = linear_error(scene) + swayed if linear else 0.0
    if error > allowed:
        bends = ""
        if swayed > 0.0:
            bends = f", and the load is {100.0 * swayed:.2g} % of what buckles the joint"
        found.append(f"{_off(error)}: kinematics are linear{bends}; {_exact(scene, ALLOW)}")
    found += [*_buckling(scene), *_wide(scene)]
    bent = OVERSHOOT / scene.plan.steps
    if scene.load.control == ARC_LENGTH and bent > allowed:
        found.append(
            f"{_off(bent)}: arc length is measured along the load steps, and goes too far where "
            "the path bends; take more load.steps_per_half_cycle"
        )
    return tuple(found)


def _wide(scene: Scene) -> tuple[str, ...]:
    """Doubt about free sides that are far apart, between which a joint is nearly in plane strain.

    A strip of bricks as wide as its contact is long lost 5 % less than in plane stress at .3 of
    gross slip, and as much from .6 on (calibration/finite_elements/sides.py).  Both planes bound
    the energy: that of a bar goes as 1/E', where they differ by a factor 1 - nu^2.
    """
    strip = scene.strip
    if strip.width is None or strip.plane == "strain" or strip.width <= strip.length:
        return ()
    nu = 0.3 if strip.poisson_ratio is None else float(strip.poisson_ratio)
    return (
        f"the joint is wider (strip.width = {float(strip.width):.4g}) than its contact is long "
        f"({float(strip.length):.4g}), so that its middle is nearer to plane strain, where a force "
        f"dissipates about {100.0 * nu**2:.2g} % less: compare with strip.plane = strain",
    )


def _exact(scene: Scene, instead: str) -> str:
    """Fix that makes a scene's kinematics exact, or what a lap joint does instead."""
    if scene.member.support != "none":
        given = [key for key in OVERHANGS if overhang(scene, key) is not None]
        nearer = f", or hold the joint nearer to its overlap, by a smaller {' and '.join(given)}"
        return f"a lap joint knows no others: {instead}" + nearer * bool(given)
    section = "model.section = squeeze with " if scene.plan.elastic else ""
    return f"take {section}model.kinematics = exact"


def _buckling(scene: Scene) -> tuple[str, ...]:
    """Doubt about a part of a strip under compression, of which linear kinematics know nothing."""
    if scene.plan.kinematics == "exact" or not scene.plan.lifts:
        return ()
    column = weakest_column(scene)
    if not column.near:
        return ()
    part = "part without pressure" if scene.member.support == "none" else "column"
    return (
        f"the {part} from X = {column.begin:.4g} to {column.end:.4g} may buckle: "
        f"its Euler load is {scene.wide * column.limit:.3g} and the compression reaches "
        f"{scene.wide * column.force:.3g}, "
        f"which linear kinematics do not see; {_exact(scene, LESS)}, or press more of the strip",
    )


def _mounting(history: Run) -> tuple[str, ...]:
    """Doubt about a single lap whose scene leaves open how far it goes on."""
    scene, ratio = history.scene, history.overhung
    if ratio is None or abs(ratio - 1.0) <= doubted_from(scene.model.tolerance):
        return ()
    keys = left_open(scene)
    longer = f"{' = '.join(keys)} = {float(scene.strip.length):.4g}, as long as the overlap, "
    if np.isnan(ratio):
        longer += "it finds no equilibrium"
    elif np.isinf(ratio):
        longer += "it loses energy, and here it loses none"
    else:
        longer += f"it loses {float(ratio):.3g} times as much"
    return (
        "a single lap bends by the lengths between its supports, which the scene leaves open: with "
        f"{longer}; give {' and '.join(keys)}, or load.entry = face or guided if its members end "
        "with the overlap",
    )


def _unsteady(history: Run) -> tuple[str, ...]:
    """Doubt about a loop that does not close."""
    with np.errstate(invalid="ignore"):  # a loop without width
        open_by = abs(history.closure)
    if not open_by > CLOSES:
        return ()
    return (
        f"the last loop does not close (by {open_by:.2g} of its width): take more load.cycles "
        "until it is steady, or compare with other model.nodes",
    )


def _resolution(history: Run) -> tuple[str, ...]:
    """Doubts about the slip zone's resolution by the grid."""
    grid, corner, slider, steps = map(float, history.errors)
    finer = finer_grid(history.scene)
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
        fix = "compare with more model.nodes"
        if not history.scene.plan.lifts:
            fix = "let it lift off (contact.normal = rigid), and " + fix
        found.append(f"{_off(corner)}: the reaction gathers in the corner at the loaded end; {fix}")
    if slider > allowed:
        found.append(
            f"{_off(slider)}: the strip rests on single nodes, whose elastic sliders are the "
            "softer, the shorter the elements; take no contact.stick_stiffness, or model.section = "
            "plane"
        )
    if steps > allowed:
        found.append(
            f"{_off(steps)}: the reaction changes much within a load step; take more "
            "load.steps_per_half_cycle"
        )
    return tuple(found)


def finer_grid(scene: Scene) -> str:
    """Fix that makes a scene's grid finer."""
    return "take a smaller model.tolerance" if scene.model.nodes == AUTO else FINER


def _section(history: Run) -> tuple[str, ...]:
    """Doubt about a section that the user names."""
    model = history.scene.model
    if (model.section == AUTO and model.by == AUTO) or not history.cycles:
        return ()
    allowed = doubted_from(model.tolerance)
    doubt = doubt_of_section(history.scene, float(history.slip_length), allowed)
    return (doubt,) if doubt else ()


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
    if scene.plan.lifts or least >= -NEGLIGIBLE * np.max(np.abs(history.reaction)):
        return ()
    return (
        f"tension at the contact (reaction_min = {least:.4g}): the strip may not lift; take "
        "contact.normal = rigid for unilateral contact, or fewer model.nodes",
    )

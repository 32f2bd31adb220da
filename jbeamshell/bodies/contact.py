"""Contact of substructures: a body on a rigid base, or two bodies, pressed and loaded to and fro.

The bodies come from any elastic model (see `jbeamshell.StiffnessModel`).  Those that touch on a
line are walked event by event, those on a face in load steps; Coulomb friction and unilateral
contact act between nodes that match.
"""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.bodies import on_face, on_line
from jbeamshell.bodies.contact_input import (
    Problem,
    all_loads,
    as_number,
    check_bodies,
    check_smooth,
    checked_bolts,
    checked_friction,
    checked_gap,
    checked_roughness,
    checked_softness,
    unit_cycles,
)
from jbeamshell.bodies.contact_points import contact_points
from jbeamshell.bodies.levels import Levels
from jbeamshell.bodies.substructure import Substructure
from jbeamshell.common.checks import is_traced, require, require_choice, require_number
from jbeamshell.common.errors import Status, UnconvergedError, warn_of_doubts
from jbeamshell.common.failed import nan_unless
from jbeamshell.common.numbers_of import numbers_of, plain
from jbeamshell.common.progress import patience
from jbeamshell.history.contact_history import ContactHistory
from jbeamshell.numerics.cycles import closed_cycles
from jbeamshell.scene.keys import ASSEMBLIES, CONTROLS
from jbeamshell.scene.parts import unit_path


@patience("solving the contact")
def solve_contact(
    upper: Substructure,
    lower: Substructure | None = None,
    *,
    friction: ArrayLike = 0.1,
    amplitude: ArrayLike = 1.0,
    cycles: int | None = None,
    steps_per_half_cycle: int | None = None,
    control: str = "force",
    path: ArrayLike | None = None,
    bolts: ArrayLike = 1.0,
    gap: ArrayLike = 0.0,
    softness: ArrayLike = 0.0,
    roughness: ArrayLike = 0.0,
    assembly: str | None = None,
    points: bool = False,
    throw: bool = True,
) -> ContactHistory:
    """Press bodies together, load them to and fro, and return the history of their contact.

    All numbers may be traced: those of the bodies, friction, amplitude, bolts, gap, softness and
    roughness.

    Parameters
    ----------
    upper : body that is pulled
    lower : body below, on matching nodes, its displacements in the same frames; None is a rigid
        base
    friction : Coulomb's coefficient mu; on a face a number or (n,)
    amplitude, steps_per_half_cycle : load path, 0 to A, then cycles A, -A, A.  Steps are 16 if left
        out, and only say where the path is looked at; on a face they are 32, and their error is
        estimated
    cycles : number of cycles; None goes on until the loop is steady, 32 at most, 16 on a face.  A
        traced history always has so many, those after the first steady one copied at no cost
    control : "force" or "displacement", what the amplitude is of
    path : (levels,) loads instead of the cycles; on a face also (levels, m) of all loads
    bolts : size of each pressing load of the bodies, a number or one for each
    gap : distance of the nodes before anything presses, a number or (n,); in a frictional assembly
        it grows together with the pressures
    softness : of the surfaces of a face themselves, displacement per pressure, tangential and
        normal, a number or (2,), length per stress; 0 is rigid contact
    roughness : (2,) h and p_0 of rough surfaces of a face, which approach each other by
        h log(1 + p / p_0) under a pressure p (exponential heights, Greenwood and Williamson 1966);
        0 is smooth
    assembly : "frictionless", which locks no shear in, as in a scene, or "frictional", as bolts are
        tightened one with the other.  If left out, the first on a line, and on a face the second,
        without which a body that friction alone holds has no equilibrium
    points : True if the nodes are contacts of their own, such as pins, each of which slips as a
        whole; False if they are a mesh, along which slip spreads evenly
    throw : True raises for a load without equilibrium and warns of doubts; False returns NaN, and
        leaves both to ``history.status`` and ``history.doubts``

    Returns
    -------
    ContactHistory

    Raises
    ------
    InputError
        for numbers that make no sense; if the contacts do not match; if nothing holds the bodies,
        pulls them or presses them together; or if a pressing without friction would push a body
        away along X
    UnconvergedError
        if a load has no equilibrium, such as beyond gross slip

    Warns
    -----
    DoubtfulWarning
        if the result may still be wrong, see `jbeamshell.ContactHistory.doubts`

    Examples
    --------
    ::

        history = jb.solve_contact(upper, lower, friction=0.1, amplitude=0.5, bolts=[8e3, 8e3])
        history.dissipation, history.loop
    """
    upper, lower = plain((upper, lower))
    check_bodies(upper, lower)
    face = upper.on_face
    solver = on_face if face else on_line
    assembly = ("frictional" if face else "frictionless") if assembly is None else assembly
    require_choice("assembly", assembly, ASSEMBLIES)
    require_choice("control", control, CONTROLS)
    if not face:
        check_smooth(softness, roughness)
    steps = solver.STEPS if steps_per_half_cycle is None else steps_per_half_cycle
    unit = None
    if path is None:
        require_number("amplitude", amplitude)
        unit = unit_cycles(solver.MOST_CYCLES if cycles is None else cycles, steps, face)
        path = as_number(amplitude, "amplitude") * unit
    else:
        fix = "is given beside path: leave one of them out"
        require("cycles", cycles, cycles is None, fix)
    made = contact_points(upper, lower, points) if face else None
    sizes = checked_bolts(upper, lower, bolts)
    smooth: Any = np.zeros(())
    problem = Problem(
        upper=upper,
        lower=lower,
        face=made,
        friction=checked_friction(upper, made, friction),
        gap=checked_gap(upper, made, gap),
        softness=smooth if made is None else checked_softness(made, softness),
        roughness=smooth if made is None else checked_roughness(made, roughness),
        loads=all_loads(path, sizes, face),
        unit=unit,
        control=control,
        assembly=assembly,
        points=points,
        half=steps if unit is not None and cycles is None else None,
    )
    found = solver.solved(problem)
    if not is_traced(found):
        found = jax.device_get(found)
    levels, count, coarse, coarser = found
    if problem.half is not None and not is_traced(levels):
        unit = unit_path(int(count), steps)
        levels = _taken(levels, unit.size, steps, face)
    history = _history(problem, levels, _cycles(problem, unit))
    if coarse is not None and unit is not None:
        halves = tuple((a // 2, b // 2, c // 2) for a, b, c in history.cycles)

        def of_levels(levels: Levels) -> ContactHistory:
            return _history(problem, _taken(levels, unit.size // 2, steps // 2, face), halves)

        mesh = None if coarser is None else of_levels(coarser)
        history = history.compared_with(of_levels(coarse), mesh, _kind(problem))
    if throw and not is_traced(history):
        _demand(problem, levels)
        warn_of_doubts(history.doubts)
    return history


def _kind(problem: Problem) -> str:
    """Kind of a face's mesh, see `jbeamshell.history.contact_history.MeshChange`."""
    bodies = [body for body in (problem.upper, problem.lower) if body is not None]
    if any(len(row) > 4 for body in bodies for row in body.elements):
        return "quadratic"
    return "linear" if problem.face is None or problem.face.pairs else "cut"


def _taken(levels: Levels, size: int, steps: int, face: bool) -> Levels:
    """Levels of the pressing, the first loading and the cycles that were taken, 1 + size of them.

    Those of a line come first, those of a face last.
    """
    rise = 1 + steps // 2 if face else 1 + size
    return jax.tree.map(
        lambda a: np.concatenate([a[:rise], a[len(a) - (1 + size - rise) :]]), levels
    )


def _cycles(problem: Problem, unit: np.ndarray | None) -> tuple[tuple[int, int, int], ...]:
    """Closed cycles of the load to and fro, none where other loads change or all are traced."""
    if unit is not None:
        return closed_cycles(np.append(0.0, unit))
    if is_traced(problem.loads):
        return ()
    loads = np.asarray(problem.loads)
    return closed_cycles(loads[:, 0]) if np.all(loads[:, 1:] == loads[0, 1:]) else ()


def _history(
    problem: Problem, levels: Levels, cycles: tuple[tuple[int, int, int], ...]
) -> ContactHistory:
    """History of levels, which holds NaN where they are not sound."""
    upper, face, sound = problem.upper, problem.face, levels.sound
    known = face is None or face.elements is None
    areas = upper.tributary if known else face.areas  # type: ignore[union-attr]
    elements: Any = None if face is None else face.elements
    names = "loads", "displacements", "slip", "gap", "friction_force", "normal_force", "slip_work"
    values: dict[str, Array] = nan_unless(sound, {name: getattr(levels, name) for name in names})
    history = ContactHistory(
        places=upper.places if face is None else face.places,
        normals=upper.normals if face is None else face.normals,
        tributary=areas,
        elements=elements,
        **values,
        slipping=levels.slipping,
        status=numbers_of(sound).where(sound, int(Status.CONVERGED), int(Status.MAX_ITERATIONS)),
        error=levels.error,
        iterations=levels.iterations,
        friction=problem.friction,
        change=None,
        mesh=None,
        cycles=cycles,
        control=problem.control,
        assembly=problem.assembly,
        points=problem.points,
    )
    # Figures of NumPy compile nothing.
    return history if is_traced(history) else jax.device_get(history)


def _demand(problem: Problem, levels: Levels) -> None:
    """Refuse a path without equilibrium."""
    sound = np.asarray(levels.sound)
    first = int(np.argmin(sound))
    if sound.all():
        return
    if first == 0:
        raise UnconvergedError(
            "bolts: no equilibrium while they are tightened; most likely nothing holds a body "
            "along the contact: hold it, or give more friction"
        )
    load = float(problem.loads[first, 0])
    steps = " or more steps" if problem.upper.on_face else ""
    raise UnconvergedError(
        f"load {load:.6g} (step {first}): no equilibrium, most likely all of the contact slides: "
        f"take a smaller amplitude{steps}, or control='displacement'"
    )

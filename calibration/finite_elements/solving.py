"""From a scene to a history: mesh, deck, CalculiX, results."""

from __future__ import annotations

import os
import warnings

import jax
import numpy as np
from jax.typing import ArrayLike

from calibration.finite_elements.deck import steps_before, write_deck
from calibration.finite_elements.histories import make_history
from calibration.finite_elements.mesh import make_mesh
from calibration.finite_elements.program import find_program, run
from calibration.finite_elements.results import read
from jbeamshell.common.checks import require
from jbeamshell.common.errors import Status, UnconvergedError
from jbeamshell.history.history import History
from jbeamshell.scene import load_path
from jbeamshell.scene.scene import Scene


def solve(
    scene: Scene,
    path: ArrayLike | None = None,
    *,
    elements: str = "quadratic",
    refinement: float = 1.0,
    folder: str | os.PathLike[str] | None = None,
    program: str | os.PathLike[str] | None = None,
    throw: bool = True,
) -> History:
    """Press the strip down, walk a load path, and report what finite elements say.

    Parameters
    ----------
    scene : a homogeneous straight strip on a rigid foundation or on none
    path : loads after the pressing, as for `jbeamshell.solve`; None is the scene's own cycles
    elements : "quadratic" (CPE8R or CPS8R) or "linear" (CPE4 or CPS4)
    refinement : divides all element sizes
    folder : where CalculiX works and its files stay; None is a temporary folder that stays only
        if CalculiX stops early
    program : CalculiX; None is the environment's CCX, else ccx
    throw : whether a level without equilibrium raises; if not, it warns: read ``history.status``

    Returns
    -------
    History
        of the same steps as `jbeamshell.solve`; levels not reached hold NaN.

    Raises
    ------
    InputError
        if the scene is out of reach, or CalculiX is not there
    UnconvergedError
        if CalculiX stops early; the message holds its own and names its files
    """
    check_reach(scene)
    whole, cycles = load_path.check(scene, path)
    command = find_program(program)
    mesh = make_mesh(scene, elements, refinement)
    levels = whole.target.size
    before = steps_before(scene)
    outcome = run(write_deck(scene, whole, mesh), levels + before, command, folder)
    printed = read(outcome.data, before)
    history = make_history(scene, whole, cycles, mesh, printed, outcome.increments)
    if outcome.finished and history.converged:
        return history
    reached = int(np.sum(np.asarray(history.status) == Status.CONVERGED))
    reason = "CalculiX's contact pulls" if outcome.finished else outcome.message
    files = (
        f"its files are in {outcome.folder}"
        if outcome.folder.exists()
        else "folder= keeps its files"
    )
    message = (
        f"finite elements stopped after level {reached} of {levels}: {reason} ({files}); "
        "take more load.steps_per_half_cycle or another refinement"
    )
    if throw:
        raise UnconvergedError(message)
    warnings.warn(message, RuntimeWarning, stacklevel=2)
    return history


def check_reach(scene: Scene) -> None:
    """Raise `InputError` for a scene that these finite elements cannot have."""
    strip, contact, load = scene.strip, scene.contact, scene.load
    traced = any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(scene))
    require("scene", "traced", not traced, "finite elements here have no derivatives: no jax.grad")
    plain = "finite elements here are of a straight homogeneous strip; "
    require("strip.layers", strip.layers, strip.layers is None, plain + "leave the layers out")
    require("strip.curvature", strip.curvature, strip.curvature is None, plain + "take 0")
    require("energy", scene.energy, scene.energy is None, plain + "take the scene's own section")
    support = scene.member.support
    require("member.support", support, support == "none", plain + "joints are in lap.py")
    overhang = strip.overhang
    fix = "finite elements here end at X = L or go on far beyond: leave it out"
    require("strip.overhang", overhang, overhang is None, fix)
    rigid = contact.normal != "compliant"
    fix = "finite elements here stand on a rigid base; take 'rigid' or 'none'"
    require("contact.normal", contact.normal, rigid, fix)
    given = load.control != "arc-length"
    fix = "finite elements here take forces or displacements"
    require("load.control", load.control, given, fix)
    on_face = load.control == "force" or load.entry != "member"
    fix = "finite elements here drive the displacement of a face: take face, guided or traction"
    require("load.entry", load.entry, on_face, fix)

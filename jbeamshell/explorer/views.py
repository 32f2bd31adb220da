"""Views of a scene: what a page draws of it, as plain arrays."""

from __future__ import annotations

import time
import warnings
from typing import NamedTuple

import jax
import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.errors import DoubtfulWarning
from jbeamshell.explorer.controls import largest_force
from jbeamshell.history.history import History
from jbeamshell.scene.rows import AUTO
from jbeamshell.scene.scene import Scene
from jbeamshell.solving.solve import run

Numbers = NDArray[np.float64]

PLANE_NODES = 65  # of plane elasticity, for which a joint of 129 takes thrice as long
CURVE = np.geomspace(0.05, 0.95, 9)  # amplitudes of the dissipation, in parts of the largest
CURVE_STEPS = 20  # per half cycle of the curve, of a strip that is solved in load steps
LARGEST = 2.0  # of the scene's amplitude, where gross slip does not limit it
FIGURES = {
    "dissipation": "Dissipation D",
    "loss_factor": "Loss factor",
    "secant_stiffness": "Secant stiffness",
    "peak_displacement": "Largest u(L)",
    "slip_length": "Slip length",
}


class View(NamedTuple):
    """Steps of a scene that are drawn: its last cycle, or the pressing if it has no cycle.

    Attributes
    ----------
    history : history, in NumPy arrays
    steps : (k,) steps that are drawn
    force, displacement : (k,) loop
    states : (k, n) 0 where the contact sticks, 1 where it slips, 2 where it is lifted
    figures : numbers of the last cycle by name
    doubts : sentences
    seconds : time that it took to compute
    """

    history: History
    steps: NDArray[np.int64]
    force: Numbers
    displacement: Numbers
    states: NDArray[np.uint8]
    figures: dict[str, float]
    doubts: tuple[str, ...]
    seconds: float


class Curve(NamedTuple):
    """Work of a cycle over its amplitude, (k,) each."""

    amplitude: Numbers
    dissipation: Numbers


def drawable(scene: Scene) -> Scene:
    """Scene whose settings stay as they are chosen now, so that nothing is compiled again.

    Plane elasticity gets as many nodes as can be drawn while a slider moves, unless the scene says
    how many.
    """
    found = scene.pinned()
    if found.plan.elastic and scene.model.nodes == AUTO:
        return found.replace({"model.nodes": min(found.plan.nodes, PLANE_NODES)})
    return found


def view_of(scene: Scene) -> View:
    """View of a scene, whose settings are those of `drawable`.

    Raises
    ------
    InputError
        if the load exceeds gross slip
    UnconvergedError
        if a step has no equilibrium
    """
    begin = time.perf_counter()
    with warnings.catch_warnings(record=True) as met:
        warnings.simplefilter("ignore")
        warnings.simplefilter("always", DoubtfulWarning)
        history: History = jax.tree.map(np.asarray, run(scene))
    start, _, stop = history.cycles[-1] if history.cycles else (0, 0, history.force.size - 1)
    steps = np.arange(start, stop + 1)
    touching, slipping = (np.asarray(a)[steps] for a in (history.touching, history.slipping))
    figures = {name: float(getattr(history, name)) for name in FIGURES if history.cycles}
    return View(
        history=history,
        steps=steps,
        force=np.asarray(history.force)[steps],
        displacement=np.asarray(history.displacement)[steps],
        states=np.where(touching, np.where(slipping, 1, 0), 2).astype(np.uint8),
        figures=figures,
        doubts=tuple(dict.fromkeys(str(each.message) for each in met)),
        seconds=time.perf_counter() - begin,
    )


def curve_of(scene: Scene) -> Curve:
    """Dissipation over amplitude: of the first cycle at each, along one path that grows.

    Amplitudes go up to gross slip where a force is controlled.  A step without equilibrium ends the
    curve.
    """
    limit = largest_force(scene) if scene.load.control == "force" else np.inf
    own = LARGEST * float(scene.get("load.amplitude"))
    amplitudes = CURVE * (limit if np.isfinite(limit) else own)
    half = 1 if scene.plan.on_contact_line else CURVE_STEPS
    history = run(scene, _growing(amplitudes, half), throw=False)
    work = np.asarray(history.slip_work)[scene.load.pressure_steps :]
    return Curve(amplitudes, np.sum(work.reshape(amplitudes.size, 3, half)[:, 1:], axis=(1, 2)))


def _growing(amplitudes: Numbers, half: int) -> Numbers:
    """Path that goes to each amplitude and once around its cycle, in steps of half a cycle."""
    before, loads = 0.0, []
    for amplitude in amplitudes.tolist():
        for target in (amplitude, -amplitude, amplitude):
            loads.append(np.linspace(before, target, half + 1)[1:])
            before = target
    return np.concatenate(loads)

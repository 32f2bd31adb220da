"""Load control by force, by displacement, or by arc length along their path."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jbeamshell as jb
from calibration.methods.strips import number, scene_of
from jbeamshell.load_steps.path_state import initial_state
from jbeamshell.load_steps.stepping import march
from jbeamshell.scene.load_path import LoadPath

LARGE = 1.0  # an amplitude for paths of their own, for which it means nothing


def scene_under(control: str, far_end: str = "guided", **options: Any) -> jb.Scene:
    """The standard strip under a control."""
    values = {"load.control": control, "load.amplitude": LARGE, "strip.far_end": far_end}
    return scene_of("standard", **options).replace(values)


def same_loop(steps: int = 20, nodes: int = 81) -> dict[str, float | None]:
    """Difference between the loops of displacement and force control at equal displacements."""
    by_force = jb.solve(scene_of("standard", nodes, steps_per_half_cycle=steps))
    scene = scene_under("displacement", nodes=nodes, steps_per_half_cycle=steps)
    by_displacement = jb.solve(scene, by_force.displacement[1:])
    amplitude = float(by_force.scene.load.amplitude)
    off = np.max(np.abs(np.asarray(by_displacement.force - by_force.force))) / amplitude
    ratio = by_displacement.dissipation / by_force.dissipation - 1.0
    return {
        "force_off": number(off),
        "dissipation_off": number(ratio),
        "iterations_force": number(np.mean(by_force.iterations)),
        "iterations_displacement": number(np.mean(by_displacement.iterations)),
    }


def to_gross_slip(
    control: str, parts: Sequence[float], far_end: str, steps: int = 20, nodes: int = 81
) -> list[dict[str, float | None]]:
    """Pull in equal steps to parts of gross slip, or of the bar's displacement or way to there.

    Returns
    -------
    for each part the force reached over gross slip, Newton iterations per step, the largest
    residual over mu F_N L, and the steps without equilibrium
    """
    scene = scene_under(control, far_end, nodes=nodes)
    gross = float(scene.contact.friction) * 20.0
    slid = gross * float(scene.strip.length) / (2.0 * float(scene.strip.stretching_stiffness))
    whole = {"force": gross, "displacement": slid, "arc-length": np.hypot(slid, 2.0 * slid)}
    pull = jnp.arange(1, steps + 1) / steps

    @jax.jit
    def run(part: jax.Array) -> tuple[jax.Array, ...]:
        target = part * pull * whole[control]
        one = jnp.ones_like(pull)
        zero = jnp.zeros(1)
        path = LoadPath(jnp.append(zero, target), jnp.append(1.0, one), jnp.append(zero, one))
        found = march(scene, initial_state(scene), path, jb.Newton())  # `solve` refuses gross slip
        sound = found.state.converged
        return found.state.level.force, found.iterations, found.error, sound

    rows = []
    for part in parts:
        force, iterations, error, sound = map(np.asarray, run(jnp.asarray(part)))
        rows.append(
            {
                "part": part,
                "force": number(force[-1] / gross),
                "iterations": number(np.mean(iterations[sound])),
                "residual": number(np.max(error)),
                "unfound": int(np.sum(~sound)),
            }
        )
    return rows


def refusal(part: float) -> str | None:
    """Error message of the library for a force beyond gross slip."""
    try:
        jb.solve(scene_of("standard").replace({"load.amplitude": 2.0 * part}))
    except jb.InputError as error:
        return str(error)
    return None

"""Outcome of a load path: its history, or the error that says which step failed."""

from __future__ import annotations

import equinox as eqx
import jax
import numpy as np
from jax import Array

from jbeamshell.common.checks import require
from jbeamshell.common.errors import Status, UnconvergedError
from jbeamshell.common.failed import nan_unless
from jbeamshell.history.history import History
from jbeamshell.history.record import Above
from jbeamshell.load_steps.path_state import StepResults
from jbeamshell.load_steps.system import System
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.buckling import NEAR_BUCKLING, weakest_column
from jbeamshell.scene.load_path import LoadPath
from jbeamshell.scene.scene import Scene

ADVICE = (
    "take more load.steps_per_half_cycle, softer sliders (contact.stick_stiffness = 100 or less), "
    "or fewer model.nodes"
)


def check_solver(solver: Newton | None) -> None:
    """Raise `InputError` unless the solver is None or a `Newton`."""
    fix = "give a jbeamshell.Newton"
    require("solver", solver, solver is None or isinstance(solver, Newton), fix)


def raise_if_failed(scene: Scene, steps: StepResults, path: LoadPath) -> None:
    """Raise `UnconvergedError` with the first failed step of a load path."""
    converged = np.asarray(steps.state.converged)
    if converged.all():
        return
    first = int(np.argmin(converged))
    wide = float(scene.wide)
    load = float(path.target[first]) * (wide if scene.load.control == "force" else 1.0)
    where = f"load step {first} of {converged.size - 1} (load {load:.6g})"
    if not path.rough[first]:
        where = f"pressing down (to {100.0 * float(path.pressure[first]):.3g} % of the pressure)"
    reason = Status(int(steps.status[first])).name.lower().replace("_", " ")
    error = float(steps.error[first])
    advice, column = ADVICE, weakest_column(scene)
    if column.force >= NEAR_BUCKLING * column.limit:
        advice = (
            f"the part without pressure from X = {column.begin:.4g} to {column.end:.4g} buckles "
            f"at {wide * column.limit:.3g}: take a smaller load.amplitude, or press more of the "
            "strip"
        )
    raise UnconvergedError(
        f"{where} found no equilibrium ({reason}, out of balance {error:.2g} of mu F_N L): {advice}"
    )


@eqx.filter_jit
def history_of(scene: Scene, steps: StepResults, pressure: Array) -> History:
    """History of the steps without its cycles, so that paths share compilations."""
    system = System(scene)
    converged, level = steps.state.converged, steps.state.level

    def masked(values: Array) -> Array:
        return nan_unless(converged, values)

    forces = jax.vmap(system.section_forces)(level.q)
    return History(
        scene=scene,
        x=system.x,
        middles=system.middles,
        tributary=system.tributary,
        load=system.load,
        force=masked(level.force),
        displacement=masked(steps.displacement),
        contact_v=masked(level.q[..., 0]),
        above=Above(masked(level.q), jax.tree.map(masked, forces)),
        gap=masked(jax.vmap(system.gap)(level.q)),
        traction=masked(level.traction),
        reaction=masked(level.reaction),
        slipping=steps.slipping,
        slip_work=masked(steps.slip_work),
        stored_energy=masked(steps.stored_energy),
        pressure=pressure,
        sinking=masked(steps.sinking),
        iterations=steps.iterations,
        error=steps.error,
        status=steps.status,
        cycles=(),
        target=steps.state.target,
    )

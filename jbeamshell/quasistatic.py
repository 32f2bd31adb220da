"""Load paths: press a strip down, load it to and fro, a History out."""

from __future__ import annotations

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.closed_form import bar_backbone, gross_slip_force
from jbeamshell.cycles import closed_cycles
from jbeamshell.equilibrium import System
from jbeamshell.errors import UnconvergedError
from jbeamshell.history import History, Status
from jbeamshell.masing import bar, masing
from jbeamshell.newton import Newton
from jbeamshell.parts import require
from jbeamshell.scene import Scene
from jbeamshell.stepping import ROUNDING, Path, State, Steps, at_rest, is_traced, walk


def solve(
    scene: Scene,
    path: ArrayLike | None = None,
    *,
    contact: ArrayLike | None = None,
    solver: Newton | None = None,
    throw: bool = True,
) -> History:
    """Press the strip down, walk a load path, and report what happened.

    Parameters
    ----------
    scene : what is loaded; may hold traced leaves, so `jax.grad` and `jax.vmap` go through
    path : loads after the pressing, (steps,): F or u(L) by ``scene.load.control``; or (steps, 2)
        with the part of the pressures that acts in the second column; None is the scene's own
        cycles
    contact : (n,) nodes from which the search for the contact starts; None is all of them
    solver : settings of Newton's method
    throw : whether a step without equilibrium raises; if not, read ``history.status``

    Returns
    -------
    History
        steps without equilibrium hold NaN.

    Raises
    ------
    InputError
        if the path makes no sense or exceeds gross slip under force control
    UnconvergedError
        if a step has no equilibrium, even when it is walked in smaller steps
    """
    solver = solver or Newton()
    whole, cycles = check(scene, path)
    steps = _walked(scene, at_rest(scene, contact), whole, solver)
    if throw:
        steps = _raise_if_failed(steps, whole, is_traced(scene, whole))
    return _history(scene, steps, whole.pressure, cycles)


def check(
    scene: Scene, path: ArrayLike | None = None
) -> tuple[Path, tuple[tuple[int, int, int], ...]]:
    """The whole path and its closed cycles; raises `InputError` where `solve` would."""
    whole, cycles = _whole_path(scene, path)
    if not is_traced(scene, whole):
        _check_gross_slip(scene, whole)
        _check_bar(scene)
    return whole, cycles


def compile_for(
    scene: Scene, path: ArrayLike | None = None, *, solver: Newton | None = None
) -> None:
    """Compile what `solve` needs, without solving anything."""
    whole, cycles = _whole_path(scene, path)
    start = at_rest(scene)._replace(sound=jnp.asarray(False))
    steps = _walked(scene, start, whole, solver or Newton())
    jax.block_until_ready(_history(scene, steps, whole.pressure, cycles))


def _walked(scene: Scene, start: State, path: Path, solver: Newton) -> Steps:
    if scene.model.solution == "closed-form":
        return bar(scene, path)
    if scene.model.solution == "stepwise":
        return walk(scene, start, path, solver)
    return masing(scene, start, path, solver)


def _whole_path(
    scene: Scene, path: ArrayLike | None
) -> tuple[Path, tuple[tuple[int, int, int], ...]]:
    """The pressing, then the given loads or the scene's own; and the closed cycles among them."""
    dtype, pressing = scene.load.amplitude.dtype, scene.load.pressure_steps
    known: np.ndarray | None = scene.load.unit_path()
    own = path is None or scene.model.solution == "stepwise"
    fix = (
        "has Masing's rule for the scene's own cycles only: leave the path out, or take 'stepwise'"
    )
    require("model.solution", scene.model.solution, own, fix)
    if path is None:
        targets = scene.load.amplitude * jnp.asarray(known, dtype)
        pressures = jnp.ones_like(targets)
    else:
        loads = jnp.asarray(path, dtype)
        shaped = loads.size > 0 and (loads.ndim == 1 or (loads.ndim == 2 and loads.shape[1] == 2))
        require("path", np.shape(path), shaped, "give (steps,) loads, or (steps, 2) with pressures")
        targets, pressures = (loads, jnp.ones_like(loads)) if loads.ndim == 1 else loads.T
        known = None if isinstance(loads, jax.core.Tracer) else np.asarray(targets)
        if known is not None:
            values = np.asarray(loads)
            finite = np.isfinite(values)
            require("path", values[~finite], bool(np.all(finite)), "must hold finite loads only")
            pulling = np.asarray(pressures) < 0.0
            fix = "the part of the pressures that acts must not be negative"
            require("path", np.asarray(pressures)[pulling], not np.any(pulling), fix)
    before = jnp.arange(1, pressing + 1, dtype=dtype) / pressing
    whole = Path(
        jnp.append(jnp.zeros_like(before), targets),
        jnp.append(before, pressures),
        jnp.append(jnp.zeros_like(before), jnp.ones_like(targets)),
    )
    if known is None or known.size == 0:
        return whole, ()
    last = pressing - 1
    cycles = closed_cycles(np.append(0.0, known))
    return whole, tuple((a + last, b + last, c + last) for a, b, c in cycles)


def _check_gross_slip(scene: Scene, path: Path) -> None:
    if scene.load.control != "force" or float(scene.contact.friction) == 0.0:
        return
    limit = float(_gross_slip(scene))
    targets, limits = np.abs(path.target), limit * np.asarray(path.pressure)
    beyond = (targets > 0.0) & (targets >= (1.0 - ROUNDING) * limits)
    require(
        "load.amplitude",
        float(targets[beyond].max(initial=0.0)),
        not np.any(beyond),
        f"must stay below gross slip, mu F_N L = {limit:.6g}; "
        "set load.control to 'displacement' to go beyond",
    )


def _check_bar(scene: Scene) -> None:
    if scene.model.solution != "closed-form" or scene.load.control == "force":
        return
    strip, rubs = scene.strip, scene.contact.friction * scene.contact.pressure
    limit = float(bar_backbone(rubs * strip.length, strip.stretching_stiffness, rubs))
    amplitude = float(scene.load.amplitude)
    fix = f"must stay below the bar's gross slip, {limit:.6g}; take model.fields = ['v'] beyond"
    require("load.amplitude", amplitude, amplitude < limit, fix)


@eqx.filter_jit
def _gross_slip(scene: Scene) -> Array:
    system, length = System(scene), scene.strip.length
    mean = jnp.sum(system.load - system.bottom_load) / length
    return gross_slip_force(scene.contact.friction, mean, length)


def _raise_if_failed(steps: Steps, path: Path, traced: bool) -> Steps:
    advice = (
        "take more load.steps_per_half_cycle, a lower contact.stick_stiffness, or fewer model.nodes"
    )
    if traced:
        message = f"a load step found no equilibrium: {advice}"
        return eqx.error_if(steps, ~steps.state.sound[-1], message)
    sound = np.asarray(steps.state.sound)
    if sound.all():
        return steps
    first = int(np.argmin(sound))
    where = f"load step {first} of {sound.size - 1} (load {float(path.target[first]):.6g})"
    if not path.rough[first]:
        where = f"pressing down (to {100.0 * float(path.pressure[first]):.3g} % of the pressure)"
    reason = Status(int(steps.status[first])).name.lower().replace("_", " ")
    error = float(steps.error[first])
    raise UnconvergedError(
        f"{where} found no equilibrium ({reason}, out of balance {error:.2g} of mu F_N L): {advice}"
    )


@eqx.filter_jit
def _history(
    scene: Scene, steps: Steps, pressure: Array, cycles: Sequence[tuple[int, int, int]]
) -> History:
    system = System(scene)
    sound, level = steps.state.sound, steps.state.level

    def masked(values: Array) -> Array:
        return jnp.where(sound.reshape(-1, *[1] * (values.ndim - 1)), values, jnp.nan)

    return History(
        scene=scene,
        x=system.x,
        middles=system.middles,
        tributary=system.tributary,
        load=system.load,
        force=masked(level.force),
        displacement=masked(steps.displacement),
        fields=masked(level.q),
        gap=masked(jax.vmap(system.gap)(level.q)),
        sections=jax.tree.map(masked, jax.vmap(system.section_forces)(level.q)),
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
        cycles=tuple(cycles),
    )

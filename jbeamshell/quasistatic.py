"""Load paths: press a strip down, load it to and fro, a History out."""

from __future__ import annotations

import dataclasses
import warnings
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.closed_form import bar_backbone
from jbeamshell.cycles import closed_cycles
from jbeamshell.equilibrium import System
from jbeamshell.errors import DoubtfulWarning, UnconvergedError
from jbeamshell.history import History, Status
from jbeamshell.masing import bar, masing
from jbeamshell.newton import Newton
from jbeamshell.parts import as_leaf, require
from jbeamshell.patterns import Foresight
from jbeamshell.runtime import memory
from jbeamshell.scene import Scene
from jbeamshell.stepping import ROUNDING, Path, Steps, at_rest, is_traced, march, recover

ADVICE = (
    "take more load.steps_per_half_cycle, a lower contact.stick_stiffness, or fewer model.nodes"
)

LEFT = 13  # numbers that a load step leaves at a node, besides twice its fields
LOADS = "give (steps,) loads, or (steps, 2) with pressures"


def solve(
    scene: Scene,
    path: ArrayLike | None = None,
    *,
    contact: ArrayLike | None = None,
    solver: Newton | None = None,
    throw: bool = True,
    tolerance: float | None = None,
) -> History:
    """Press the strip down, walk a load path, and report what happened.

    Parameters
    ----------
    scene : what is loaded; may hold traced leaves, so `jax.grad` and `jax.vmap` go through
    path : loads after the pressing, (steps,): F, u(L) or the way gone, by ``scene.load.control``;
        or (steps, 2) with the part of the pressures that acts in the second column; None is the
        scene's own cycles
    contact : (n,) nodes from which the search for the contact starts; None is all of them
    solver : settings of Newton's method
    throw : whether a step without equilibrium raises, and what is doubtful warns; if not, read
        ``history.status`` and ``history.doubts``
    tolerance : relative error of the dissipation that will do; the scene's model gives way to the
        cheapest that is estimated to keep it, see `jbeamshell.advise`

    Returns
    -------
    History
        steps without equilibrium hold NaN.

    Raises
    ------
    InputError
        if the path makes no sense or exceeds gross slip under force control, or if no model keeps
        the tolerance
    UnconvergedError
        if a step has no equilibrium, even when it is walked in smaller steps

    Warns
    -----
    DoubtfulWarning
        if what converged may be wrong all the same, see `jbeamshell.History.doubts`; never in a
        traced run, whose estimate is `jbeamshell.History.dissipation_error`
    """
    check_solver(solver)
    solver = solver or Newton()
    if tolerance is not None:
        from jbeamshell.advice import advise

        require("path", "given", path is None, "a tolerance is for the scene's own cycles")
        scene = advise(scene, tolerance).applied(scene)
    whole, cycles = check(scene, path)
    touching = None if contact is None else _check_contact(scene, contact)
    steps, history = _solve(scene, touching, whole, _first(scene, whole, solver), np.asarray(True))
    if is_traced(steps):  # by its scene, or by a caller's jit around a scene of plain numbers
        sound = steps.state.sound[-1]
        message = f"a load step found no equilibrium: {ADVICE}"
        history = eqx.error_if(history, ~sound, message) if throw else history
        return dataclasses.replace(history, cycles=cycles)
    if not np.asarray(steps.state.sound)[-1]:  # an index of JAX's would compile
        start = at_rest(scene, touching)
        if scene.model.solution == "stepwise":
            steps = recover(scene, steps, whole, solver, start)
        else:
            steps = masing(scene, start, whole, solver, recovering=True)
        if throw:
            raise_if_failed(steps, whole)
        history = history_of(scene, steps, whole.pressure)
    history = dataclasses.replace(history, cycles=cycles)
    if throw:
        for doubt in history.doubts:
            warnings.warn(f"doubtful: {doubt}", DoubtfulWarning, stacklevel=2)
    return history


def check(
    scene: Scene, path: ArrayLike | None = None
) -> tuple[Path, tuple[tuple[int, int, int], ...]]:
    """The whole path and its closed cycles; raises `InputError` where `solve` would."""
    whole, cycles = _whole_path(scene, path)
    if not is_traced(scene, whole):
        _check_size(scene, whole)
        _check_gross_slip(scene, whole)
        _check_bar(scene)
    return whole, cycles


def check_solver(solver: Newton | None) -> None:
    """Raise `InputError` for settings that are none."""
    fix = "give a jbeamshell.Newton"
    require("solver", solver, solver is None or isinstance(solver, Newton), fix)


def compile_for(
    scene: Scene, path: ArrayLike | None = None, *, solver: Newton | None = None
) -> None:
    """Compile what `solve` needs, without solving anything."""
    whole, _ = _whole_path(scene, path)
    first = _first(scene, whole, solver or Newton())
    jax.block_until_ready(_solve(scene, None, whole, first, np.asarray(False)))


def _first(scene: Scene, path: Path, solver: Newton) -> Newton:
    """The solver of a first attempt: foresight, unless derivatives may be taken of it."""
    staged = is_traced(scene, path, jnp.zeros(()))  # the last by a caller's jit
    return solver if staged else Foresight.of(solver, checked=True)


@eqx.filter_jit
def _solve(
    scene: Scene,
    touching: np.ndarray | None,
    path: Path,
    solver: Newton,
    enabled: ArrayLike,
) -> tuple[Steps, History]:
    start = at_rest(scene, touching)._replace(sound=jnp.asarray(enabled))
    if scene.model.solution == "closed-form":
        steps = bar(scene, path)
    elif scene.model.solution == "stepwise":
        steps = march(scene, start, path, solver)
    else:
        steps = masing(scene, start, path, solver)
    return steps, history_of(scene, steps, path.pressure)


def _whole_path(
    scene: Scene, path: ArrayLike | None
) -> tuple[Path, tuple[tuple[int, int, int], ...]]:
    """The pressing, then the given loads or the scene's own; and the closed cycles among them."""
    require("scene", scene, isinstance(scene, Scene), "give a jbeamshell.Scene")
    pressing, known = scene.load.pressure_steps, scene.load.unit_path()
    solution = scene.model.solution
    fix = "knows the scene's own cycles only: leave the path out, or take 'stepwise'"
    require("model.solution", solution, path is None or solution == "stepwise", fix)
    numbers: Any = jnp if is_traced(scene.load.amplitude, path) else np  # the faster, where it can
    amplitude = numbers.asarray(scene.load.amplitude)
    if path is None:
        targets = amplitude * known.astype(amplitude.dtype)
        pressures = numbers.ones_like(targets)
    else:
        loads = numbers.asarray(as_leaf(path, "path", LOADS), amplitude.dtype)
        shaped = loads.size > 0 and (loads.ndim == 1 or (loads.ndim == 2 and loads.shape[1] == 2))
        require("path", np.shape(path), shaped, LOADS)
        targets, pressures = (loads, numbers.ones_like(loads)) if loads.ndim == 1 else loads.T
        if not is_traced(loads):
            known, finite = np.asarray(targets), np.isfinite(loads)
            require("path", loads[~finite], bool(np.all(finite)), "must hold finite loads only")
            pulling = pressures < 0.0
            fix = "the part of the pressures that acts must not be negative"
            require("path", np.asarray(pressures)[pulling], not np.any(pulling), fix)
        else:
            known = np.zeros(0)
    before = (np.arange(1, pressing + 1) / pressing).astype(amplitude.dtype)
    whole = Path(
        numbers.append(np.zeros_like(before), targets),
        numbers.append(before, pressures),
        numbers.append(np.zeros_like(before), numbers.ones_like(targets)),
    )
    last = pressing - 1
    cycles = closed_cycles(np.append(0.0, known)) if known.size else ()
    return whole, tuple((a + last, b + last, c + last) for a, b, c in cycles)


def _check_contact(scene: Scene, contact: ArrayLike) -> np.ndarray:
    try:
        touching, nodes = np.asarray(contact, dtype=bool), scene.model.nodes
    except (TypeError, ValueError):
        require("contact", contact, False, "give one truth for each of the nodes")
    fits = touching.shape == (nodes,) and "w" in scene.model.fields
    fix = f"give one truth for each of the {nodes} nodes, and w in model.fields"
    require("contact", touching.shape, fits, fix)
    return touching


def _check_size(scene: Scene, path: Path) -> None:
    """Refuse what would fill this machine's memory."""
    levels, nodes = path.target.size, scene.model.nodes
    need, most = 8.0 * levels * nodes * (2 * scene.model.width + LEFT), memory()
    fix = f"and {levels} load steps take {need:.2g} bytes of memory, this machine has {most:.2g}"
    require("model.nodes", nodes, need < most, f"{fix}: take fewer")


def _check_gross_slip(scene: Scene, path: Path) -> None:
    if scene.load.control != "force" or float(scene.contact.friction) == 0.0:
        return
    pressing, _ = scene.contact.resultant(scene.strip.length)
    limit = float(scene.contact.friction) * pressing
    targets, limits = np.abs(path.target), limit * np.asarray(path.pressure)
    beyond = (targets > 0.0) & (targets >= (1.0 - ROUNDING) * limits)
    require(
        "load.amplitude",
        float(targets[beyond].max(initial=0.0)),
        not np.any(beyond),
        f"must stay below gross slip, mu F_N L = {limit:.6g}; "
        "set load.control to 'displacement' or 'arc-length' to go beyond",
    )


def _check_bar(scene: Scene) -> None:
    if scene.model.solution != "closed-form" or scene.load.control == "force":
        return
    strip = scene.strip
    with jax.ensure_compile_time_eval():
        rubs = scene.contact.friction * scene.contact.pressure
        limit = float(bar_backbone(rubs * strip.length, strip.stretching_stiffness, rubs))
    amplitude = float(scene.load.amplitude)
    fix = f"must stay below the bar's gross slip, {limit:.6g}; take model.fields = ['v'] beyond"
    require("load.amplitude", amplitude, amplitude < limit, fix)


def raise_if_failed(steps: Steps, path: Path, before: int = 0) -> None:
    """Raise `UnconvergedError` with the first step that failed, after so many of another path."""
    sound = np.asarray(steps.state.sound)
    if sound.all():
        return
    first = int(np.argmin(sound))
    number, last = before + first, before + sound.size - 1
    where = f"load step {number} of {last} (load {float(path.target[first]):.6g})"
    if not path.rough[first]:
        where = f"pressing down (to {100.0 * float(path.pressure[first]):.3g} % of the pressure)"
    reason = Status(int(steps.status[first])).name.lower().replace("_", " ")
    error = float(steps.error[first])
    raise UnconvergedError(
        f"{where} found no equilibrium ({reason}, out of balance {error:.2g} of mu F_N L): {ADVICE}"
    )


@eqx.filter_jit
def history_of(scene: Scene, steps: Steps, pressure: Array) -> History:
    """What happened, but for the cycles in it: with them every path would compile anew."""
    system, stepwise = System(scene), scene.model.solution == "stepwise"
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
        cycles=(),
        target=steps.state.target,
        end=jax.tree.map(lambda a: a[-1], steps.state) if stepwise else None,
    )

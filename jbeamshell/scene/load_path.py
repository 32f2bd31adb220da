"""Load paths: the pressing and the loads after it, checked against the scene."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import as_leaf, is_traced, require
from jbeamshell.common.failed import nan_unless
from jbeamshell.common.jax_options import memory
from jbeamshell.mechanics.kinematics import FIELDS
from jbeamshell.numerics.cycles import closed_cycles
from jbeamshell.scene.domain import gross_slip_rule, stays_below
from jbeamshell.scene.parts import unit_path
from jbeamshell.scene.pressure import resultant
from jbeamshell.scene.scene import Scene

NUMBERS_PER_NODE = 13  # numbers that a load step stores at a node, and twice its fields more
LOADS = "give (steps,) loads, or (steps, 2) with pressures"


def check(
    scene: Scene, path: ArrayLike | None = None
) -> tuple[LoadPath, tuple[tuple[int, int, int], ...]]:
    """Whole path and its closed cycles (start, turn, end); see `solve` for its `InputError`.

    Forces that are given are those of the scene's width, and those of the path of one unit of it.
    """
    loads, cycles = whole_path(scene, path)
    if not is_traced(scene, loads):
        _check_size(scene, loads)
        parts = scene.load, scene.member, scene.number
        gross_slip_rule(*parts, loads.target, loads.pressure).demand()
    return loads, cycles


def whole_path(
    scene: Scene, path: ArrayLike | None
) -> tuple[LoadPath, tuple[tuple[int, int, int], ...]]:
    """Path of the pressing and of some loads, None for the scene's, and its closed cycles."""
    require("scene", scene, isinstance(scene, Scene), "give a jbeamshell.Scene")
    numbers: Any = jnp if is_traced(scene.load.amplitude, path) else np  # NumPy is faster
    amplitude = numbers.asarray(scene.load.amplitude)
    if path is None:
        counts = scene.load.cycles, scene.plan.steps
        targets = amplitude * unit_path(*counts).astype(amplitude.dtype)
        pressures = np.ones(targets.shape, targets.dtype)
        cycles = _unit_cycles(*counts)
    else:
        loads = numbers.asarray(as_leaf(path, "path", LOADS), amplitude.dtype)
        shaped = loads.size > 0 and (loads.ndim == 1 or (loads.ndim == 2 and loads.shape[1] == 2))
        require("path", np.shape(path), shaped, LOADS)
        constant = np.ones(loads.shape, loads.dtype)
        targets, pressures = (loads, constant) if loads.ndim == 1 else loads.T
        if scene.load.control == "force" and scene.strip.width is not None:
            targets = targets / scene.wide
        cycles = ()
        if not is_traced(loads):
            finite = np.isfinite(loads)
            require("path", loads[~finite], bool(np.all(finite)), "must hold finite loads only")
            pulling = pressures < 0.0
            fix = "the part of the pressures that acts must not be negative"
            require("path", np.asarray(pressures)[pulling], not np.any(pulling), fix)
            cycles = _closed_cycles_of(np.asarray(targets), np.asarray(pressures))
    if is_traced(scene, targets) and scene.load.control == "force":
        targets, numbers = _below_gross_slip(scene, targets, pressures), jnp
    steps = scene.load.pressure_steps
    pressing = (np.arange(1, steps + 1) / steps).astype(amplitude.dtype)
    loads = LoadPath(
        numbers.append(np.zeros_like(pressing), targets),
        (jnp if is_traced(pressures) else np).append(pressing, pressures),
        numbers.append(np.zeros_like(pressing), numbers.ones_like(targets)),
    )
    last = steps - 1
    return loads, tuple((a + last, b + last, c + last) for a, b, c in cycles)


def _closed_cycles_of(loads: np.ndarray, parts: np.ndarray) -> tuple[tuple[int, int, int], ...]:
    """Closed cycles of loads that start from zero, whose pressures close too; none of none."""
    cycles = closed_cycles(np.append(0.0, loads)) if loads.size else ()
    parts = np.append(1.0, parts)
    return tuple(cycle for cycle in cycles if parts[cycle[0]] == parts[cycle[2]])


@functools.cache
def _unit_cycles(cycles: int, steps: int) -> tuple[tuple[int, int, int], ...]:
    """Closed cycles of a scene's own path."""
    loads = unit_path(cycles, steps)
    return _closed_cycles_of(loads, np.ones_like(loads))


def _below_gross_slip(scene: Scene, targets: Array, pressures: Array | np.ndarray) -> Array:
    """Forces of a traced path, NaN from gross slip on, where no step finds an equilibrium."""
    contact, member = scene.contact, scene.member
    faces = contact.pressure, contact.bottom_pressure
    force, _ = resultant(*faces, scene.strip.length, member.support)
    if member.bolt_stiffness is not None or scene.load.kind == "moment":  # nothing slides off
        return targets
    below = stays_below(jnp.abs(targets), contact.friction * force, pressures)
    return nan_unless(below, targets)


def check_contact(scene: Scene, contact: ArrayLike) -> np.ndarray:
    """Nodes in contact (n,) where a search starts; `InputError` if they do not fit the scene."""
    try:
        touching, nodes = np.asarray(contact, dtype=bool), scene.plan.nodes
    except (TypeError, ValueError):
        require("contact", contact, False, "give True or False for each of the nodes")
    fits = touching.shape == (nodes,) and scene.plan.lifts
    fix = f"give True or False for each of the {nodes} nodes of a strip that may lift off"
    require("contact", touching.shape, fits, fix)
    return touching


def _check_size(scene: Scene, path: LoadPath) -> None:
    """Raise `InputError` for a path whose results would fill this machine's memory."""
    levels, nodes = path.target.size, scene.plan.nodes
    need, most = 8.0 * levels * nodes * (2 * len(FIELDS) + NUMBERS_PER_NODE), memory()
    fix = f"and {levels} load steps take {need:.2g} bytes of memory, this machine has {most:.2g}"
    require("model.nodes", nodes, need < most, f"{fix}: take fewer")


class LoadPath(NamedTuple):
    """Quantities that a load path prescribes, (steps,) each.

    Attributes
    ----------
    target : controlled load: F of one unit of width, u(L) or, for the arc length, the way along
        the path, signed
    pressure : part of the pressures that acts; traced only if the path changes it
    rough : 1 with friction, 0 while the strip is pressed down before it
    """

    target: Array
    pressure: Array
    rough: Array

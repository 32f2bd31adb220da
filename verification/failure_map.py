"""Map of the domain in which load steps work, are slow, are wrong or fail, and say so or not.

Runs the standard strip with two of its numbers over their whole range, and 2,000 strips drawn at
random from the stated domain with the defaults; compares each dissipation with that of the same
model on a fine grid whose end may lift.  Takes an hour on one core; --missing goes on where a run
was cut.
"""

import functools
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from tqdm import tqdm

import jbeamshell as jb
from calibration.strip import changed, in_load_steps
from jbeamshell.history import error_estimates, reliability
from verification import outcomes

FIGURES = ("ratio", "grid", "corner", "closure", "iterations", "status")

# The standard strip; load is the amplitude over gross slip.
STANDARD = {
    "eta": 0.1126,
    "mu": 0.1,
    "load": 0.39,
    "nu": 0.3,
    "kappa_s": 0.44,
    "alpha": 1e3,
}
PRESSURE, LENGTH = 10.0, 2.0
EXACT = {"contact.normal": "rigid", "model.nodes": 321, "end_size": 1.0 / 200.0}
COARSER = {"model.nodes": 161, "end_size": 1.0 / 48.0}  # where that finds no equilibrium
LINEAR = {"model.kinematics": "linear"}


def spread(low: float, high: float, count: int) -> list[float]:
    """Values from low to high, evenly on a logarithmic scale."""
    return [float(f"{value:.4g}") for value in np.geomspace(low, high, count)]


LOADS = [0.005, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 0.97, 0.99, 0.999]
NODES = [5, 9, 17, 33, 65, 161, 513, 1025]
# Random scenes, by seed and count: the first made the estimate of the error, the others test it.
SCENES = {"scenes": (7, 2000), "fresh scenes": (8, 300)}
DOMAIN = ("eta", "mu", "load", "nu", "kappa_s", "alpha")  # of the random scenes

# Row of a map: label, settings, numbers that it sets.
Row = tuple[Any, dict[str, Any], dict[str, float]]


@functools.cache
def runner(settings: tuple[tuple[str, Any], ...]) -> Callable[[jax.Array], jax.Array]:
    """Compiled function from the numbers of `STANDARD` to the figures, for some settings."""
    given = {key: list(v) if isinstance(v, tuple) else v for key, v in settings}
    base = changed(in_load_steps(), given)

    @jax.jit
    def run(numbers: jax.Array) -> jax.Array:
        history = jb.solve(scene_of(base, numbers), throw=False)
        grid, corner = error_estimates.dissipation_errors(history.slip_cycle)
        effort = jnp.sum(history.iterations) / history.force.size
        found = (history.dissipation_ratio, grid, corner, history.closure, effort)
        return jnp.stack([*found, jnp.max(history.status)]).astype(float)

    return run


def scene_of(base: jb.Scene, numbers: jax.Array) -> jb.Scene:
    """Scene with the numbers of `STANDARD`."""
    n = dict(zip(STANDARD, numbers, strict=True))
    values = {
        "strip.height_ratio": n["eta"],
        "contact.friction": n["mu"],
        "load.amplitude": n["load"] * n["mu"] * PRESSURE * LENGTH,
        "strip.poisson_ratio": n["nu"],
        "strip.kappa_s": n["kappa_s"],
        "contact.stick_stiffness": n["alpha"],
    }
    return base.replace(values)


@functools.cache
def figures(settings: tuple[tuple[str, Any], ...], numbers: tuple[float, ...]) -> list[Any]:
    """`FIGURES` of a run; None for those that are not finite."""
    found = np.asarray(runner(settings)(np.asarray(numbers)))
    return [float(f"{value:.6g}") if np.isfinite(value) else None for value in found]


def cell(
    settings: Mapping[str, Any], reference: Mapping[str, Any], point: Mapping[str, float]
) -> list[Any]:
    """Figures of a run, dissipation ratio of its reference, number of doubts of the scene."""
    if point.get("load", 0.0) >= 1.0:  # refused by `solve`, where nothing is traced
        return [None] * (len(FIGURES) - 1) + [-1, None, 0]
    own, against = (_figures(s, point) for s in (settings, reference))
    if against[-1] != 0:
        against = _figures(reference | COARSER, point)
    reached = against[0] if against[-1] == 0 else None
    return [*own, reached, doubts_beforehand(settings, point)]


def doubts_beforehand(settings: Mapping[str, Any], point: Mapping[str, float]) -> int:
    """Number of doubts that the scene alone raises."""
    base = changed(in_load_steps(), settings)
    return len(reliability.doubts_of_scene(scene_of(base, list((STANDARD | point).values()))))


def _figures(settings: Mapping[str, Any], point: Mapping[str, float]) -> list[Any]:
    """Figures of a run with some of the numbers of `STANDARD` replaced."""
    fixed = tuple((k, tuple(v) if isinstance(v, list) else v) for k, v in settings.items())
    return figures(fixed, tuple((STANDARD | point).values()))


# --- maps -----------------------------------------------------------------------------------------


def settings(key: str, values: list[Any]) -> list[Row]:
    """Rows of a map, one for every value of a setting."""
    return [(value, LINEAR | {key: value}, {}) for value in values]


def numbers(key: str, values: list[float]) -> list[Row]:
    """Rows of a map, one for every value of a number."""
    return [(value, {}, {key: value}) for value in values]


SLIDERS = spread(1.0, 1e8, 9)
# Number along the columns with its values, name of the rows, and the rows.
MAPS: dict[str, tuple[str, list[float], str, list[Row]]] = {
    "height and load": ("load", LOADS, "eta", numbers("eta", spread(1e-3, 1.0, 10))),
    "friction and load": ("load", LOADS, "mu", numbers("mu", spread(0.01, 2.0, 8))),
    "alpha and height": ("alpha", SLIDERS, "eta", numbers("eta", spread(1e-3, 1.0, 7))),
    "nodes and load": ("load", LOADS, "nodes", settings("model.nodes", NODES)),
    "nodes and alpha": ("alpha", SLIDERS, "nodes", settings("model.nodes", NODES)),
}


def chart(name: str) -> dict[str, Any]:
    """Map of a name."""
    x, values, y, rows = MAPS[name]
    cells = []
    with tqdm(total=len(rows) * len(values), desc=name, disable=None) as bar:
        for _, own, point in rows:
            cells.append([])
            for value in values:
                cells[-1].append(cell(own, EXACT, point | {x: value}))
                bar.update()
    return {"x": x, "y": y, "columns": values, "rows": [row[0] for row in rows], "cells": cells}


# --- random scenes --------------------------------------------------------------------------------


def random_points(seed: int, count: int) -> np.ndarray:
    """Random strips in the stated domain, (count, 6) in the order of `DOMAIN`."""
    part = np.random.default_rng(seed).uniform(size=(count, len(DOMAIN)))
    low = np.array([0.005, 0.02, 0.02, 0.0, 0.05, 2.0])
    high = np.array([0.5, 1.0, 0.98, 0.49, 3.0, 1e4])
    even = np.array([False, False, True, True, False, False])
    ratio = np.where(even, 1.0, high / np.where(even, 1.0, low))
    return np.where(even, low + part * (high - low), low * ratio**part)


def walked_in_pieces(point: Mapping[str, float]) -> bool:
    """True if a run that failed converges in smaller load steps."""
    history = jb.solve(scene_of(in_load_steps(), list((STANDARD | point).values())), throw=False)
    return history.converged


def strip(values: np.ndarray) -> list[Any]:
    """Cell of a random strip; it tells if a failed run converges in smaller load steps."""
    point = dict(zip(DOMAIN, map(float, values), strict=True))
    one = cell({}, EXACT, point)
    return [*one, walked_in_pieces(point) if one[5] > 0 else None]


def scattered(name: str) -> list[list[Any]]:
    """Cells of random strips."""
    return [strip(values) for values in tqdm(random_points(*SCENES[name]), name, disable=None)]


PARTS = {name: functools.partial(chart, name) for name in MAPS}
PARTS |= {name: functools.partial(scattered, name) for name in SCENES}
draw = outcomes.draw

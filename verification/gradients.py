"""Gradients of every number of a scene, by every figure, against differences.

Solves scenes of all kinds of models, laws, kinematics, supports and loads at random points.  Each
number that a scene holds, each entry of its tables included, is changed alone; rows of a table that
make a step are moved together.  The derivative of each figure by JAX, in reverse, stands
beside central differences at two distances, extrapolated (Richardson).  Where they differ, the
distances are made smaller, and the slopes from both sides are compared: a figure with a kink there
has no derivative, and JAX must give one that lies between the two.

The record has counts of right and wrong ones by setting, and each kink by its name.
"""

from __future__ import annotations

import functools
import time
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import jbeamshell as jb
from calibration.strip import changed
from jbeamshell.scene.keys import NUMBERS
from jbeamshell.solving.response import RESPONSES
from verification.gradient_scenes import SETTINGS, SIZES, Values

SEED = 22
STEP = 1e-4  # relative distance of the differences
DISTANCES = (10.0, 1.0, 0.1, 0.01)  # times that, until they agree; round-off asks for the largest
CLOSE = 1e-4  # relative difference that still agrees
LITTLE = 1e-3  # of a figure per relative change of a number, below which slopes count as this
NOISE = 1e-10  # of a figure, by round-off, if no more was measured
TINY, TRIES = 1e-11, 20  # relative changes of all numbers by which round-off is measured
# Sizes of figures that are zero but for round-off, or small differences of larger numbers; that of
# the closure is the width of the loop, that of the energy's imbalance the work of the load.
LEAST = {"closure": 1.0, "error": 1.0, "curvature": 0.05, "tip_deflection": 1e-7}
STEPPED = ("reaction_max_at",)  # places of nodes, which jump from one node to another


class Walk(NamedTuple):
    """Numbers of a scene in one vector, and the directions in which they are changed.

    Attributes
    ----------
    keys : those in the vector
    shapes : of their values
    start : (m,) values
    names : of the directions
    ways : (directions, m) changes of size one
    sizes : (directions,) size of each number
    """

    keys: tuple[str, ...]
    shapes: tuple[tuple[int, ...], ...]
    start: np.ndarray
    names: tuple[str, ...]
    ways: np.ndarray
    sizes: np.ndarray

    def values(self, vector: jax.Array) -> dict[str, jax.Array]:
        """Values by key of a vector."""
        sizes = [int(np.prod(shape)) for shape in self.shapes]
        parts = jnp.split(vector, np.cumsum(sizes)[:-1])
        shaped = (part.reshape(shape) for part, shape in zip(parts, self.shapes, strict=True))
        return dict(zip(self.keys, shaped, strict=True))


def numbers_of(scene: jb.Scene, given: Values) -> Walk:
    """Every number that a scene holds, each entry of its tables a direction of its own."""
    keys, values, directions = [], [], []
    for key in NUMBERS:
        if scene.strip.derives(key):
            continue
        if key == "contact.bolts" and key not in given:
            continue
        if key == "contact.pressure" and "contact.bolts" in given:
            continue
        if key == "contact.bottom_pressure" and "contact.bolts" in given:
            continue
        value = scene.get(key)
        if value is None or not np.all(np.isfinite(np.asarray(value))):
            continue
        value = np.asarray(value, float)
        begin = sum(v.size for v in values)
        keys.append(key)
        values.append(value)
        directions += [(*entry, begin) for entry in _entries(key, value)]
    m = sum(v.size for v in values)
    ways = np.zeros((len(directions), m))
    for row, (_, places, _, begin) in zip(ways, directions, strict=True):
        row[begin + np.array(places)] = 1.0
    shapes = tuple(v.shape for v in values)
    start = np.concatenate([v.ravel() for v in values])
    names = tuple(d[0] for d in directions)
    return Walk(tuple(keys), shapes, start, names, ways, np.array([d[2] for d in directions]))


def _entries(key: str, value: np.ndarray) -> list[tuple[str, list[int], float]]:
    """Name, places in the flat value, and size of each direction of a number or a table."""
    usual = SIZES.get(key, 0.0)
    if value.ndim == 0:
        return [(key, [0], max(abs(float(value)), usual))]
    found, (rows, columns) = [], value.shape
    stepped = key in ("contact.pressure", "contact.bottom_pressure")
    for i in range(rows):
        for j in range(columns):
            size = max(abs(value[i, j]), usual, 1e-3 * np.abs(value[:, j]).max())
            places, name = [i * columns + j], f"{key}[{i},{j}]"
            if stepped and j == 0:
                if i and value[i, 0] == value[i - 1, 0]:
                    continue  # moved with the row before
                if i + 1 < rows and value[i, 0] == value[i + 1, 0]:
                    places, name = [*places, places[0] + columns], f"{key}[{i}:{i + 2},{j}]"
            found.append((name, places, size))
    return found


def figures_of(history: jb.History) -> dict[str, jax.Array]:
    """Every figure that is a number; of arrays, their sum with fixed random weights."""
    found = {}
    for name in RESPONSES:
        try:
            value = getattr(history, name)
        except (jb.InputError, IndexError):  # of other fields
            continue
        except jax.errors.JAXTypeError:  # words and truths are made of plain numbers
            continue
        if not isinstance(value, jax.Array) or not jnp.issubdtype(value.dtype, jnp.floating):
            continue
        if value.ndim:
            weights = np.random.default_rng(sum(name.encode())).normal(size=value.shape)
            value = jnp.sum(value * weights)
        found[name] = value
    return found


class Setting(NamedTuple):
    """Compiled functions of one setting: figures, and their derivatives along each way."""

    walk: Walk
    names: tuple[str, ...]
    figures: Callable[[np.ndarray], np.ndarray]
    slopes: Callable[[np.ndarray], np.ndarray]


def setting_of(given: Values) -> Setting:
    """Functions of the numbers of a scene."""
    scene = changed(jb.Scene(), given).pinned()
    walk = numbers_of(scene, given)
    names: list[str] = []

    def traced(vector: jax.Array) -> tuple[jax.Array, jax.Array]:
        history = jb.solve(scene.replace(walk.values(vector)), throw=False)
        found = figures_of(history)
        names[:] = found
        return jnp.stack(list(found.values())), jnp.max(history.status)

    @jax.jit
    def pulled(vector: jax.Array, weights: jax.Array) -> tuple[Any, jax.Array]:
        found, pull, status = jax.vjp(traced, vector, has_aux=True)
        return (found, status), pull(weights)[0]

    jax.eval_shape(traced, walk.start)
    none = np.zeros(len(names))  # the value comes with the slopes: one program for both

    def figures(vector: np.ndarray) -> np.ndarray:
        (found, status), _ = pulled(vector, none)
        if int(status) != 0:
            raise FloatingPointError(f"status {int(status)}")
        return np.asarray(found)

    def slopes(vector: np.ndarray) -> np.ndarray:
        return np.stack([pulled(vector, row)[1] for row in np.eye(len(names))]) @ walk.ways.T

    return Setting(walk, tuple(names), figures, slopes)


class Differences(NamedTuple):
    """Differences of all figures by one number at one distance h.

    Attributes
    ----------
    best : (figures,) extrapolated central differences
    up, down : (figures,) slopes towards both sides
    noise : (figures,) what round-off may make of them
    """

    best: np.ndarray
    up: np.ndarray
    down: np.ndarray
    noise: np.ndarray


def differences(
    setting: Setting, vector: np.ndarray, way: np.ndarray, h: float, noise: np.ndarray
) -> Differences:
    """Differences along a way; ``noise`` is the round-off of the figures."""
    at = setting.figures
    middle, half = at(vector), 0.5 * h
    far, near = ([at(vector + sign * d * way) for sign in (1, -1)] for d in (h, half))
    wide, close = (far[0] - far[1]) / (2.0 * h), (near[0] - near[1]) / h
    up, down = (near[0] - middle) / half, (middle - near[1]) / half
    # Of round-off, both differences leave up to 2 and 1 over h, of which 4/3 and 1/3 are taken.
    return Differences((4.0 * close - wide) / 3.0, up, down, 3.0 * noise / h)


def round_off(setting: Setting, vector: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Largest changes (figures,) by changes of all numbers in their last digits."""
    walk, middle = setting.walk, setting.figures(vector)
    found = []
    for _ in range(TRIES):
        changes = TINY * walk.sizes * random.uniform(-1.0, 1.0, walk.sizes.size)
        found.append(np.abs(setting.figures(vector + changes @ walk.ways) - middle))
    return np.max(found, axis=0)


def judged(
    setting: Setting, vector: np.ndarray, slopes: np.ndarray, way: int, noise: np.ndarray
) -> list[Values]:
    """Verdicts on the derivatives of all figures by one number, with what they rest on."""
    walk, size = setting.walk, setting.walk.sizes[way]
    values = np.abs(setting.figures(vector))
    found = dict(zip(setting.names, values, strict=True))
    work = found["secant_stiffness"] * found["peak_displacement"] ** 2
    floor = [(LEAST | {"energy_imbalance": work}).get(name, 0.0) for name in setting.names]
    scale = np.maximum(values, floor)
    least = np.maximum(LITTLE * scale / size, 1e-300)
    noise = np.maximum(NOISE * scale, 2.0 * noise)
    right, all_found = np.zeros(slopes.size, bool), []
    for distance in DISTANCES:
        at = differences(setting, vector, walk.ways[way], STEP * distance * size, noise)
        all_found.append(at)
        room = CLOSE * np.maximum(np.maximum(np.abs(at.best), np.abs(slopes)), least) + at.noise
        right |= np.abs(slopes - at.best) <= room
        if right.all():
            break
    first, last = all_found[0], all_found[-1]
    low, high = np.minimum(last.up, last.down), np.maximum(last.up, last.down)
    room = np.maximum(0.05 * (high - low), CLOSE * np.maximum(np.abs(low), np.abs(high)))
    between = (low - room <= slopes) & (slopes <= high + room)
    apart = min_over(all_found) > 0.3 * np.abs(first.up - first.down)
    grows = np.maximum(np.abs(low), np.abs(high)) > 30.0 * np.maximum(
        np.abs(first.up), np.abs(first.down)
    )
    jumps = grows | np.isin(setting.names, STEPPED)
    verdicts = np.where(
        right, "right", np.where(jumps, "jump", np.where(apart & between, "kink", "wrong"))
    )
    verdicts = np.where(np.isfinite(slopes), verdicts, "wrong")
    verdicts = np.where(np.isnan(setting.figures(vector)), "undefined", verdicts)
    return [
        {
            "number": walk.names[way],
            "figure": name,
            "verdict": str(verdicts[i]),
            "jax": float(slopes[i]),
            "differences": float(last.best[i]),
            "up": float(last.up[i]),
            "down": float(last.down[i]),
        }
        for i, name in enumerate(setting.names)
    ]


def min_over(found: list[Differences]) -> np.ndarray:
    """Smallest difference of the slopes towards both sides."""
    return np.min([np.abs(at.up - at.down) for at in found], axis=0)


def study(name: str, points: int = 1) -> Values:
    """Counts of verdicts of one setting at random points, and all that are not right."""
    jax.config.update("jax_disable_most_optimizations", True)  # few runs of many programs
    given, seed = SETTINGS[name], [SEED, list(SETTINGS).index(name)]
    random, begun = np.random.default_rng(seed), time.process_time()
    setting = setting_of(given)
    walk, rows = setting.walk, []
    for point in range(points):
        # The first point is the scene itself, where rows lie on nodes and ends.
        factors = random.uniform(-0.05, 0.05, len(walk.names)) * (point > 0)
        vector = walk.start + (factors * walk.sizes) @ walk.ways * (walk.start != 0.0)
        slopes, noise = setting.slopes(vector), round_off(setting, vector, random)
        for way in range(len(walk.names)):
            try:
                found = judged(setting, vector, slopes[:, way], way, noise)
            except FloatingPointError as error:
                found = [{"number": walk.names[way], "verdict": "no result", "why": str(error)}]
            rows += [row | {"point": point} for row in found]
    return {
        "counts": dict(Counter(row["verdict"] for row in rows)),
        "numbers": list(walk.names),
        "figures": list(setting.names),
        "cpu_s": round(time.process_time() - begun, 1),
        "others": [row for row in rows if row["verdict"] != "right"],
    }


PARTS = {name: functools.partial(study, name) for name in SETTINGS}

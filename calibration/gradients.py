"""Gradients of every number of a scene, by every figure, against differences.

    python calibration/gradients.py [--points 2] [--only SETTING ...]

solves scenes of all kinds of models, laws, kinematics, supports and loads at random points.  Each
number that a scene holds, each entry of its tables included, is changed alone; rows of a table that
make a step are moved together.  The derivative of each figure by JAX, reverse and forward, stands
beside central differences at two distances, extrapolated (Richardson).  Where they differ, the
distance is made smaller, and the slopes from both sides are compared: a figure with a kink there
has no derivative, and JAX must give one that lies between the two.

It writes gradients.json beside this file after every setting: counts of right and wrong ones, and
each kink by its name.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jax

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_disable_most_optimizations", True)  # few runs of many programs

import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
from provenance import provenance  # noqa: E402

import jbeamshell as jb  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.quasistatic.response import RESPONSES  # noqa: E402
from jbeamshell.scene.keys import NUMBERS, TABLE  # noqa: E402
from jbeamshell.scene.rungs import IDEAL  # noqa: E402

RECORD = Path(__file__).parent / "gradients.json"
SEED = 22
STEP = 1e-4  # relative distance of the differences
SMALLER = (1.0, 0.1, 0.01)  # times the distance, until they agree
CLOSE = 1e-4  # relative difference that still agrees
LITTLE = 1e-3  # of a figure per relative change of a number, below which slopes count as this
NOISE = 1e-11  # of a figure, by round-off
LEAST = {"closure": 1e-3, "error": 1.0}  # sizes of figures that are zero but for round-off
Values = dict[str, Any]

FEW = {"model.nodes": 17, "load.steps_per_half_cycle": 4, "load.cycles": 1}
STEPWISE = FEW | {"model.solution": "stepwise", "model.kinematics": "linear"}
EXACT = STEPWISE | {"model.kinematics": "exact"}
LIFT = {"model.fields": ["v", "w", "beta", "psi"]}
SMOOTH = {"contact.smoothing": 8.0}
SOFT = {"contact.stick_stiffness": 100.0}
TABLE_OF_STEPS = {
    "contact.pressure": [[0.0, 0.0], [0.3, 0.0], [0.3, 12.0], [1.3, 8.0], [1.3, 0.0], [2.0, 0.0]],
    "load.amplitude": 0.3,
}
BOTH_FACES = {
    "contact.pressure": [[0.0, 8.0], [1.0, 12.0], [2.0, 9.0]],
    "contact.bottom_pressure": [[0.0, 1.0], [1.2, 3.0], [2.0, 1.5]],
}
LAYERS = {
    "strip.layers": [[0.05, 2e5, 0.2], [0.1, 1e5, 0.35], [0.0752, 3e5, 0.25]],
    "strip.deviation": 0.01,
}
DISPLACED = {"load.control": "displacement", "load.amplitude": 1.5e-5}
DOUBLE = {
    "member.support": "rolling",
    "strip.far_end": "free",
    "member.height_ratio": 0.09,
    "member.axial_stiffness": 3e4,
    "member.poisson_ratio": 0.25,
}
SINGLE = DOUBLE | {
    "member.support": "clamped",
    "strip.loaded_end": "guided",
    "strip.overhang": 0.5,
    "member.overhang": 0.4,
}
BOLTS = {"contact.bolts": [[0.5, 5.0, 0.4], [1.4, 6.0, 0.5]], "load.amplitude": 0.3}
SETTINGS: dict[str, Values] = {
    "condensed squeeze": FEW,
    "condensed shell": FEW | {"model.rung": "condensed-shell"},
    "condensed p2": FEW | {"model.rung": "condensed-p2"},
    "condensed, soft sliders": FEW | SOFT,
    "condensed, displacement": FEW | DISPLACED,
    "condensed, steps of pressure": FEW | TABLE_OF_STEPS,
    "condensed, both faces": FEW | BOTH_FACES | SOFT,
    "condensed, layers": FEW | LAYERS | SOFT,
    "plane": FEW | {"model.rung": "plane"},
    "bar": FEW | {"model.rung": "bar"},
    "masing": FEW | {"model.rung": "masing"},
    "masing of a pull": FEW | {"model.rung": "masing-pull"},
    "stepwise sharp": STEPWISE,
    "stepwise smooth": STEPWISE | SMOOTH,
    "stepwise shell": STEPWISE | {"model.rung": "shell"},
    "exact sharp": EXACT,
    "exact smooth that lifts": EXACT | SMOOTH | LIFT,
    "exact sharp that lifts": EXACT | LIFT,
    "lift, steps of pressure": STEPWISE | LIFT | TABLE_OF_STEPS,
    "lift, both faces, curved": EXACT | LIFT | BOTH_FACES | {"strip.curvature": 1e-4},
    "exact, layers": EXACT | LAYERS,
    "stepwise, displacement": STEPWISE | DISPLACED,
    "exact, arc length": EXACT | DISPLACED | {"load.control": "arc-length"},
    "stepwise p2": STEPWISE | {"model.rung": "p2"},
    "stepwise p3, exact": EXACT | {"model.rung": "p3"},
    "collocation": EXACT | {"model.grid": "collocation"},
    "assumed squeeze": EXACT | LIFT | {"model.squeeze": "assumed"},
    "printed constants": STEPWISE | {"model.constants": "printed"},
    "compliant base": EXACT | LIFT | {"contact.normal": "compliant"},
    "pinned": FEW | SOFT | {"strip.far_end": "pinned"},
    "plane stress, free": STEPWISE | {"strip.far_end": "free", "strip.plane": "stress"},
    "double shear": FEW | DOUBLE,
    "single lap with bolts": FEW
    | SINGLE
    | BOLTS
    | {
        "contact.bearing_stiffness": 2.0,
        "contact.clearance": 2e-6,
        "contact.bolt_stiffness": 1.0,
        "load.arm": 0.05,
    },
    "lap with a gap, moment": FEW
    | SINGLE
    | {
        "contact.gap": [[0.0, 0.0], [1.0, 2e-6], [2.0, 0.0]],
        "load.kind": "moment",
        "load.amplitude": 0.02,
    },
    "lap of layers, tightened": FEW
    | SINGLE
    | LAYERS
    | {
        "member.axial_stiffness": None,
        "member.poisson_ratio": None,
        "member.layers": [[0.08, 2e5, 0.2], [0.1, 1e5, 0.3]],
        "contact.assembly": "frictional",
    },
    "plane lap": FEW | DOUBLE | {"model.rung": "plane"},
}
# Distances for numbers that are zero, or small beside what they are added to.
SIZES = {
    "strip.deviation": 0.1,
    "strip.curvature": 1e-4,
    "contact.bottom_pressure": 1.0,
    "contact.gap": 1e-6,
}


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
    ideal = scene.model.condensed and float(scene.contact.stick_stiffness) >= IDEAL
    for key in NUMBERS:
        if key == "contact.holes" or (key == "contact.stick_stiffness" and ideal):
            continue
        if TABLE[key].through and key != "contact.bolts":
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
    """Compiled functions of one setting: figures, and their derivatives both ways."""

    walk: Walk
    names: tuple[str, ...]
    figures: Callable[[jax.Array], np.ndarray]
    reverse: Callable[[jax.Array], np.ndarray]
    forward: Callable[[jax.Array], np.ndarray] | None


def setting_of(given: Values, forward: bool) -> Setting:
    """Functions of the numbers of a scene."""
    scene = jb.Scene().replace(given).pinned()
    walk = numbers_of(scene, given)
    names: list[str] = []

    def figures(vector: jax.Array) -> tuple[jax.Array, jax.Array]:
        history = jb.solve(scene.replace(walk.values(vector)), throw=False)
        found = figures_of(history)
        names[:] = found
        return jnp.stack(list(found.values())), jnp.max(history.status)

    value = jax.jit(figures)

    @jax.jit
    def pulled(vector: jax.Array, weights: jax.Array) -> jax.Array:
        return jax.vjp(lambda at: figures(at)[0], vector)[1](weights)[0]

    @jax.jit
    def pushed(vector: jax.Array, way: jax.Array) -> jax.Array:
        return jax.jvp(lambda at: figures(at)[0], (vector,), (way,))[1]

    def plain(vector: jax.Array) -> np.ndarray:
        found, status = value(vector)
        if int(status) != 0:
            raise FloatingPointError(f"status {int(status)}")
        return np.asarray(found)

    def reverse(vector: jax.Array) -> np.ndarray:
        rows = [pulled(vector, row) for row in np.eye(len(names))]
        return np.stack(rows) @ walk.ways.T

    def onwards(vector: jax.Array) -> np.ndarray:
        return np.stack([pushed(vector, way) for way in walk.ways], axis=1)

    plain(jnp.asarray(walk.start))
    return Setting(walk, tuple(names), plain, reverse, onwards if forward else None)


def judged(
    setting: Setting, vector: np.ndarray, slopes: np.ndarray, way: int
) -> list[tuple[str, dict[str, float]]]:
    """Verdict on the derivative of each figure by one number: right, a kink, or wrong."""
    walk, count = setting.walk, len(setting.names)
    direction, size = walk.ways[way], walk.sizes[way]
    middle = setting.figures(vector)
    verdicts: list[tuple[str, dict[str, float]]] = [("", {})] * count
    left, found = [], []
    for smaller in SMALLER:
        h = STEP * smaller * size
        try:
            far, near = (
                [setting.figures(vector + sign * d * direction) for sign in (1, -1)]
                for d in (h, 0.5 * h)
            )
        except FloatingPointError as error:
            return [("no result", {"reason": str(error)})] * count  # type: ignore[dict-item]
        wide, close = ((up - down) / (2 * d) for (up, down), d in ((far, h), (near, 0.5 * h)))
        best = (4.0 * close - wide) / 3.0
        scale = np.maximum(np.abs(middle), [LEAST.get(name, 0.0) for name in setting.names])
        noise = NOISE * scale / h
        least = np.maximum(LITTLE * scale / size, 1e-300)
        off = np.abs(slopes - best) / np.maximum(np.maximum(np.abs(best), np.abs(slopes)), least)
        allowed = CLOSE + noise / np.maximum(np.abs(best), least)
        up, down = (near[0] - middle) / (0.5 * h), (middle - near[1]) / (0.5 * h)
        left.append(np.abs(up - down))
        found.append(np.maximum(np.abs(up), np.abs(down)))
        for i in range(count):
            if verdicts[i][0] == "right":
                continue
            given = {
                "jax": float(slopes[i]),
                "differences": float(best[i]),
                "off": float(off[i]),
                "up": float(up[i]),
                "down": float(down[i]),
            }
            right = np.isfinite(slopes[i]) and off[i] <= allowed[i]
            verdicts[i] = ("right" if right else "wrong", given)
        if all(verdict == "right" for verdict, _ in verdicts):
            break
    for i, (verdict, given) in enumerate(verdicts):
        if verdict != "wrong" or not np.isfinite(given["jax"]):
            continue
        if len(found) == len(SMALLER) and found[-1][i] > 30.0 * found[0][i]:
            verdicts[i] = ("jump", given)
            continue
        # The slopes from both sides do not come together: a kink.
        jump = min(each[i] for each in left)
        low, high = sorted((given["up"], given["down"]))
        room = 0.05 * (high - low)
        if jump > 0.3 * left[0][i] and low - room <= given["jax"] <= high + room:
            verdicts[i] = ("kink", given)
    return verdicts


def study(name: str, given: Values, points: int, forward: bool) -> Values:
    """Counts of verdicts of one setting at random points, and all that are not right."""
    random = np.random.default_rng([SEED, sum(name.encode())])
    begun = time.process_time()
    setting = setting_of(given, forward)
    walk, counts, others = setting.walk, Counter[str](), []
    both = 0.0
    for point in range(points):
        free = random.uniform(-0.05, 0.05, walk.start.size) * (point > 0)
        free[[not way.any() for way in walk.ways.T]] = 0.0
        vector = walk.start.copy()
        for way, size in zip(walk.ways, walk.sizes, strict=True):
            vector += way * size * free[np.argmax(way)] * (vector[np.argmax(way)] != 0.0)
        slopes = setting.reverse(vector)
        if setting.forward is not None:
            other = setting.forward(vector)
            size = np.abs(setting.figures(vector))[:, None] / walk.sizes
            both = max(both, float(np.max(np.abs(other - slopes) / np.maximum(abs(slopes), size))))
        for i, number in enumerate(walk.names):
            for figure, (verdict, row) in zip(
                setting.names, judged(setting, vector, slopes[:, i], i), strict=True
            ):
                counts[verdict] += 1
                if verdict != "right":
                    others.append(
                        {"point": point, "number": number, "figure": figure, "verdict": verdict}
                        | row
                    )
    found: Values = {"counts": dict(counts), "numbers": list(walk.names)}
    found |= {"figures": list(setting.names), "cpu_s": round(time.process_time() - begun, 1)}
    if forward:
        found["forward_to_reverse"] = both
    return found | {"others": others}


def main() -> None:
    """Go over the settings asked for, and write the record after each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=2)
    parser.add_argument("--only", nargs="*", default=list(SETTINGS), choices=list(SETTINGS))
    parser.add_argument("--forward", action="store_true", help="also derivatives forward")
    parser.add_argument("--record", type=Path, default=RECORD)
    given = parser.parse_args()
    record: Values = {"about": provenance(), "settings": {}}
    if given.record.exists():
        record = json.loads(given.record.read_text(encoding="utf-8"))
    for name in given.only:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", jb.DoubtfulWarning)
            found = study(name, SETTINGS[name], given.points, given.forward)
        record["settings"][name] = found
        write_text(given.record, json.dumps(record, indent=1))
        print(name, found["counts"], found["cpu_s"], file=sys.stderr, flush=True)
        jax.clear_caches()


if __name__ == "__main__":
    main()

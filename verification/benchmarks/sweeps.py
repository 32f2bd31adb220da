"""Strips a second of plain sweeps and responses of plane elasticity, and their errors, on one core.

All in, with compiling, and once more when compiled; of some random lanes the error to plane
elasticity of twice the nodes:

- grid: heights x amplitudes of one strip;
- own: every lane has its own height, Poisson's ratio, friction and amplitude;
- response: one call, over the load alone and over height, friction and load.
"""

import time
from typing import Any

import jax
import numpy as np

import jbeamshell as jb

HEIGHT, POISSON = "strip.height_ratio", "strip.poisson_ratio"
FRICTION, LOAD = "contact.friction", "load.amplitude"
ENTRIES = ("member", "traction")
FINE = 129  # nodes of the strips that lanes are compared with
RATIOS = 0.03, 0.4  # least and most height ratio
SIDE, CHECKED, CALLS = 64, 100, 200  # heights and loads of a grid, lanes compared, calls


def swept(scene: jb.Scene, over: dict[str, np.ndarray], paired: bool) -> dict[str, Any]:
    """Times of a sweep at the defaults, and the errors of some of its lanes."""
    seconds = []
    for _ in range(2):
        begin = time.perf_counter()
        found = jb.sweep(scene, over, ["dissipation"], paired=paired)
        seconds.append(time.perf_counter() - begin)
    works = found["dissipation"].values
    lanes = np.random.default_rng(5).choice(works.size, CHECKED, replace=False)
    errors, ratios = [], []
    for lane in lanes:
        places = np.unravel_index(lane, works.shape) * (len(over) if paired else 1)
        own = {key: values[at] for (key, values), at in zip(over.items(), places, strict=True)}
        fine = scene.replace(own | {"model.section": "plane", "model.nodes": FINE})
        history = jb.solve(fine, throw=False)
        ratios.append(float(history.dissipation_ratio))
        errors.append(abs(works.ravel()[lane] / float(history.dissipation) - 1.0))
    seen = np.array(errors)[np.array(ratios) > 1e-3]
    return {
        "lanes": works.size,
        "plan": found.attrs["plan"],
        "nodes": int(found.attrs["plan"].split()[-2]),
        "failed": int(np.sum(found["status"] != 0)),
        "cold_s": seconds[0],
        "lanes_per_s": works.size / seconds[1],
        "checked": CHECKED,
        "worst_error": float(np.max(errors)),
        "worst_error_above_a_thousandth": float(np.max(seen)),
        "median_error": float(np.median(errors)),
    }


def asked(over: list[str]) -> dict[str, float]:
    """Times of the first call of a response, and of one when it is compiled."""
    scene = jb.Scene()
    values = np.array([float(scene.get(key)) for key in over])
    ask = jb.response(scene, over)
    begin = time.perf_counter()
    jax.block_until_ready(ask(*values))
    first = time.perf_counter() - begin
    seconds = []
    for call in range(CALLS):
        begin = time.perf_counter()
        jax.block_until_ready(ask(*(values * (1.0 + 1e-4 * call))))
        seconds.append(time.perf_counter() - begin)
    return {"first_s": first, "median_us": 1e6 * float(np.median(seconds))}


def measure() -> dict[str, Any]:
    """Sweeps under both entries of the force, and responses."""
    random, many = np.random.default_rng(1), SIDE**2
    grid = {HEIGHT: np.geomspace(*RATIOS, SIDE), LOAD: np.geomspace(0.1, 1.8, SIDE)}
    friction = random.uniform(0.05, 0.5, many)
    own = {
        HEIGHT: np.exp(random.uniform(*np.log(RATIOS), many)),
        POISSON: random.uniform(0.15, 0.45, many),
        FRICTION: friction,
        LOAD: 20.0 * friction * random.uniform(0.05, 0.95, many),
    }
    record: dict[str, Any] = {}
    for entry in ENTRIES:
        scene = jb.Scene().replace({"load.entry": entry})
        record[entry] = {"grid": swept(scene, grid, False), "own": swept(scene, own, True)}
    response = {"load": asked([LOAD]), "height, friction and load": asked([HEIGHT, FRICTION, LOAD])}
    return record | {"response": response}

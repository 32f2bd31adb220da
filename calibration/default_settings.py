"""Errors of the settings that a scene chooses for itself, over random scenes of all kinds.

    python calibration/default_settings.py [--scenes 1000]

solves every scene twice: as it is, and with the same model on a mesh two or three times as fine;
then plain scenes for several tolerances.  It writes default_settings.json beside this file.  The
errors are those of the dissipation, of the secant stiffness and of the loop (largest difference of
the response over its range).  Beside them stand the estimate and the doubts of the run, and its
time.  `jbeamshell.scene.choice` takes its
numbers from here; calibration/charts/settings.py draws the record.
"""

import argparse
import json
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from provenance import provenance  # noqa: E402
from tqdm import tqdm  # noqa: E402

import jbeamshell as jb  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.mechanics.bar import bar_backbone  # noqa: E402

HERE = Path(__file__).parent
SEED = 20
FINE_CONDENSED = 193  # nodes, or twice the scene's own
TOLERANCES = (0.02, 0.01, 0.005, 0.0025)
Values = dict[str, Any]
Random = np.random.Generator


def plain(random: Random) -> Values:
    """Homogeneous strip of any height, friction, load and Poisson's ratio."""
    mu = _log(random, 0.05, 0.5)
    return {
        "strip.height_ratio": _log(random, 0.01, 0.4),
        "strip.kappa_s": random.uniform(0.3, 1.5),
        "strip.poisson_ratio": random.uniform(0.0, 0.45),
        "contact.friction": mu,
        "load.amplitude": random.uniform(0.03, 0.97) * 20.0 * mu,
    }


def pressed_in_part(random: Random) -> Values:
    """Pressure on a part of the strip, even or falling, so that the rest lifts off."""
    begin, end = random.uniform(0.0, 0.8), random.uniform(1.0, 2.0)
    low, high = sorted(random.uniform(5.0, 20.0, 2))
    table = [[0.0, 0.0], [begin, 0.0], [begin, high], [end, low]]
    table += [[end, 0.0], [2.0, 0.0]] if end < 2.0 else []
    force = 0.5 * (low + high) * (end - begin)
    found = plain(random)
    part = random.uniform(0.05, 0.9) * found["contact.friction"] * force
    return found | {"contact.pressure": table, "load.amplitude": part}


def displaced(random: Random) -> Values:
    """Displacement control, up to two thirds of a bar's gross slip."""
    found = plain(random)
    force = found["load.amplitude"] * 0.66
    u = float(bar_backbone(force, 3.4e4, 10.0 * found["contact.friction"]))
    return found | {"load.control": "displacement", "load.amplitude": u}


def layered(random: Random) -> Values:
    """Two or three layers."""
    found = plain(random)
    share = (
        random.dirichlet(np.full(random.integers(2, 4), 4.0)) * 2.0 * found["strip.height_ratio"]
    )
    layers = [[h, _log(random, 1e4, 1e6), random.uniform(0.0, 0.45)] for h in share]
    layers[-1][0] += 2.0 * found["strip.height_ratio"] - sum(row[0] for row in layers)
    del found["strip.poisson_ratio"]
    return found | {"strip.layers": layers}


def soft(random: Random) -> Values:
    """Elastic slip before sliding, and other supports."""
    return plain(random) | {
        "contact.stick_stiffness": _log(random, 3.0, 1000.0),
        "strip.far_end": str(random.choice(["held", "pinned", "free"])),
        "strip.plane": str(random.choice(["strain", "stress"])),
    }


def other_rungs(random: Random) -> Values:
    """Shells, sections of order p and plane elasticity."""
    rung = str(random.choice(["shell", "p2", "p4", "plane"]))
    return plain(random) | {"model.rung": rung}


def rotating(random: Random) -> Values:
    """Pressure so large that rotations matter: load steps with exact kinematics."""
    found, stronger = plain(random), _log(random, 100.0, 1000.0)
    found["strip.height_ratio"] = _log(random, 0.03, 0.3)
    return found | {
        "contact.pressure": 10.0 * stronger,
        "load.amplitude": found["load.amplitude"] * stronger,
    }


def smooth(random: Random) -> Values:
    """Smooth law of friction: load steps."""
    return plain(random) | {"contact.smoothing": random.uniform(4.0, 16.0)}


KINDS: dict[str, tuple[Callable[[Random], Values], float]] = {  # with their shares of the scenes
    "plain": (plain, 0.3),
    "pressed in part": (pressed_in_part, 0.15),
    "displacement control": (displaced, 0.1),
    "layers": (layered, 0.1),
    "soft, pinned, free": (soft, 0.15),
    "other rungs": (other_rungs, 0.1),
    "large rotations": (rotating, 0.05),
    "smooth friction": (smooth, 0.05),
}


def _log(random: Random, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def finer(scene: jb.Scene) -> jb.Scene:
    """Scene with the same model on a fine mesh."""
    model, load, scene = scene.model, scene.load, scene.pinned()
    if model.condensed:
        nodes = max(FINE_CONDENSED, 2 * model.nodes - 1)
        return scene.replace({"model.nodes": nodes, "model.end_size": 0.5 * model.end_size})
    steps = {"load.steps_per_half_cycle": 2 * load.steps_per_half_cycle}
    return scene.replace(steps | {"model.nodes": 2 * model.nodes - 1})


def compared(values: Values) -> Values:
    """Errors, estimate, doubts and time of one scene; the reason if there is no result."""
    try:
        scene = jb.Scene().replace(values)
        jb.solve(scene, throw=False)
        begun = time.perf_counter()
        found = jax.block_until_ready(jb.solve(scene, throw=False))
        took = time.perf_counter() - begun
        fine = jb.solve(finer(scene), throw=False)
    except jb.InputError as error:
        return {"refused": str(error)}
    errors = {
        name: abs(float(getattr(found, name)) / float(getattr(fine, name)) - 1.0)
        for name in ("dissipation", "secant_stiffness")
    }
    driven = "displacement" if scene.load.control == "force" else "force"
    loop, best = (
        np.asarray(getattr(history, driven))[history.pressed + 1 :] for history in (found, fine)
    )
    stride = best.size // loop.size
    best = best[stride - 1 :: stride]
    return errors | {
        "loop": float(np.max(np.abs(loop - best)) / np.ptp(best)),
        "bar_ratio": float(found.dissipation_ratio),
        "estimate": float(found.dissipation_error),
        "doubts": list(found.doubts),
        "converged": found.converged and fine.converged,
        "rung": scene.model.rung,
        "nodes": scene.model.nodes,
        "ms": 1e3 * took,
    }


def of_all_kinds(scenes: int) -> list[Values]:
    """Rows of random scenes, a share of each kind."""
    rows = []
    for kind, (make, share) in KINDS.items():
        random = np.random.default_rng([SEED, list(KINDS).index(kind)])
        for _ in tqdm(range(round(share * scenes)), kind):
            values = make(random)
            rows.append({"kind": kind, "values": values} | compared(values))
    return rows


def of_all_tolerances(scenes: int) -> list[Values]:
    """Rows of plain scenes, the same for each tolerance."""
    rows = []
    for tolerance in TOLERANCES:
        random = np.random.default_rng(SEED)
        for _ in tqdm(range(scenes), f"tolerance {tolerance:g}"):
            values = plain(random) | {"model.tolerance": tolerance}
            rows.append({"tolerance": tolerance} | compared(values))
    return rows


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=1000)
    scenes = parser.parse_args().scenes
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", jb.DoubtfulWarning)
        record = {"about": provenance(), "seed": SEED}
        record |= {"kinds": of_all_kinds(scenes), "tolerances": of_all_tolerances(scenes // 10)}
    write_text(HERE / "default_settings.json", json.dumps(record, indent=1))

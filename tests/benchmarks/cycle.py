"""Cost of a run of the standard strip, and what the choices of friction law and grid change.

    python tests/benchmarks/cycle.py

writes cycle.json beside this file: medians of warm runs interleaved between the variants, compile
time apart, with the machine, the versions and the precision.
"""

import json
import os
import platform
import statistics
import subprocess
import time
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp  # noqa: E402
import jaxlib  # noqa: E402
import numpy as np  # noqa: E402

import jbeamshell as jb  # noqa: E402
from jbeamshell.solving.solve import compile_for  # noqa: E402

ROUNDS = 7
STANDARD = {"load.cycles": 1, "model.kinematics": "exact", "contact.normal": "held"}
VARIANTS = {
    "default": {},
    "linear kinematics": {"model.kinematics": "linear"},
    "linear, 41 nodes, 10 steps": {
        "model.kinematics": "linear",
        "model.nodes": 41,
        "load.steps_per_half_cycle": 10,
    },
    "shell": {"model.section": "shell"},
    "with lift": {"contact.normal": "rigid"},
    "collocation": {"model.grid": "collocation"},
    "collocation, 81 nodes": {"model.grid": "collocation", "model.nodes": 81},
    "m = 8": {"contact.smoothing": 8.0},
    "m = 16": {"contact.smoothing": 16.0},
    "m = 32": {"contact.smoothing": 32.0},
}


def drift(scene: jb.Scene) -> float:
    """Creep of u per cycle over u, for a load that swings between 0.3 A and A."""
    amplitude = float(scene.load.amplitude)
    first = np.linspace(0.0, amplitude, 21)[1:]
    back = np.linspace(amplitude, 0.3 * amplitude, 15)[1:]
    swing = np.concatenate([back, back[-2::-1], [amplitude]])
    history = jb.solve(scene, np.concatenate([first, *[swing] * 10]))
    tops = np.asarray(history.displacement)[20 :: swing.size]
    return float(abs(tops[-1] - tops[-2]) / tops[-1])


def main() -> None:
    """Measure all variants side by side and write the record."""
    scenes = {
        name: jb.library.standard().replace(STANDARD | keys).by_load_steps()
        for name, keys in VARIANTS.items()
    }
    record: dict[str, dict] = {name: {"keys": VARIANTS[name]} for name in scenes}
    for name, scene in scenes.items():
        begin = time.perf_counter()
        compile_for(scene)
        record[name]["compile_s"] = time.perf_counter() - begin
    times: dict[str, list[float]] = {name: [] for name in scenes}
    for _ in range(ROUNDS):
        for name, scene in scenes.items():
            begin = time.perf_counter()
            history = jax.block_until_ready(jb.solve(scene))
            times[name].append(time.perf_counter() - begin)
            record[name]["dissipation_ratio"] = float(history.dissipation_ratio)
            record[name]["newton_per_step"] = float(jnp.mean(history.iterations))
    for name, scene in scenes.items():
        record[name]["run_ms"] = 1e3 * statistics.median(times[name])
        record[name]["over_default"] = record[name]["run_ms"] / (
            1e3 * statistics.median(times["default"])
        )
        if not name.startswith(("shell", "with lift", "collocation")):
            record[name]["drift_per_cycle"] = drift(scene)
        print(name, {k: v for k, v in record[name].items() if k != "keys"})
    asked = ["git", "rev-parse", "--short", "HEAD"]
    commit = subprocess.run(asked, capture_output=True, text=True)
    about = {
        "what": "1.25 cycles of the standard strip by jbeamshell.solve, warm, History included",
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "python": platform.python_version(),
        "jax": jax.__version__,
        "jaxlib": jaxlib.__version__,
        "dtype": "float64",
        "flags": os.environ.get("XLA_FLAGS", ""),
        "commit": commit.stdout.strip(),
        "rounds": ROUNDS,
    }
    target = Path(__file__).with_suffix(".json")
    target.write_text(json.dumps({"about": about, "variants": record}, indent=1) + "\n")


if __name__ == "__main__":
    main()

"""Results of two checkouts over scenes of all kinds, compared number by number.

``python -m verification same_results before=PATH`` compares this checkout with the one at PATH, on
the scenes whose gradients are verified.  It prints the largest relative difference of every scene,
and exits with 1 if one exceeds 1e-12 of the largest number of its kind.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import jax
import numpy as np
from tqdm import tqdm

import jbeamshell as jb
from calibration.strip import changed

FIGURES = (
    "force",
    "displacement",
    "fields",
    "gap",
    "traction",
    "reaction",
    "slip_work",
    "stored_energy",
    "status",
    "dissipation",
    "dissipation_error",
)
OVER = {"strip.height_ratio": [0.05, 0.1, 0.2, 0.4], "load.amplitude": [0.3, 0.8, 1.6]}


def results(settings: dict[str, dict[str, Any]]) -> dict[str, np.ndarray]:
    """Arrays by name, of every scene, of a gradient and of a sweep."""
    found = {}
    for name, values in tqdm(settings.items(), disable=None):
        history = jb.solve(changed(jb.Scene(), values), throw=False)
        for figure in FIGURES:
            try:
                found[f"{name}/{figure}"] = np.asarray(getattr(history, figure))
            except jb.InputError:  # a run of this kind has none
                continue
    for name in ("contact line, squeeze", "load steps, smooth", "plane"):
        scene = changed(jb.Scene(), settings[name])
        ask = jb.response(scene, list(OVER), ["dissipation"])
        slopes = jax.jacrev(lambda x, ask=ask: ask(*x)["dissipation"])
        found[f"gradient, {name}/dissipation"] = np.asarray(slopes(np.array([0.15, 0.7])))
    swept = jb.sweep(jb.Scene(), OVER, ["dissipation"])
    return found | {"sweep/dissipation": np.asarray(swept["dissipation"])}


def measure(before: str) -> None:
    """Compare the results with those of another checkout."""
    from verification.gradient_scenes import SETTINGS

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "before.npz"
        subprocess.run(
            [sys.executable, __file__, str(path)],
            input=json.dumps(SETTINGS),
            text=True,
            check=True,
            cwd=before,
            env=os.environ | {"PYTHONPATH": before},
        )
        with np.load(path) as file:
            known = dict(file)
    found, worst = results(SETTINGS), {}
    for name in sorted(known.keys() | found.keys()):
        scene = name.partition("/")[0]
        off = _difference(known.get(name), found.get(name))
        worst[scene] = max(worst.get(scene, 0.0), off)
    for scene, difference in worst.items():
        print(f"{scene:36s} {difference:.2g}")
    same = sum(difference == 0.0 for difference in worst.values())
    print(f"{len(worst)} compared, {same} equal to the last bit, worst {max(worst.values()):.2g}")
    if max(worst.values()) > 1e-12:
        raise SystemExit(1)


def _difference(a: np.ndarray | None, b: np.ndarray | None) -> float:
    if a is None or b is None or a.shape != b.shape:
        return np.inf
    a, b = a.astype(float), b.astype(float)
    if not np.array_equal(np.isnan(a), np.isnan(b)):
        return np.inf
    scale = max(np.nanmax(np.abs(a), initial=0.0), 1e-300)
    return float(np.nanmax(np.abs(a - b), initial=0.0) / scale)


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    jb.configure()
    warnings.simplefilter("ignore", jb.DoubtfulWarning)
    np.savez(sys.argv[1], **results(json.load(sys.stdin)))

"""Results of two checkouts over 60 scenes of all kinds, compared number by number.

In the one checkout ``python tests/benchmarks/same_results.py --write FILE.npz``, in the other
``python tests/benchmarks/same_results.py --against FILE.npz``; both with PYTHONPATH at the root of
their checkout.  The second prints the largest relative difference of every scene and exits with 1
if one exceeds 1e-12 of the largest number of its kind.
"""

from __future__ import annotations

import argparse
import sys
import warnings

import jax
import numpy as np
from tqdm import tqdm

jax.config.update("jax_enable_x64", True)

import jbeamshell as jb  # noqa: E402

HELD = {"model.kinematics": "exact", "contact.normal": "held"}
CLOSED_FORM = ("bar", "bar, displaced")  # the other scenes are solved in load steps

SMALL = {"model.nodes": 21, "load.steps_per_half_cycle": 8, "load.cycles": 1}
LINEAR = SMALL | {"model.kinematics": "linear"}
LIFT = {"contact.normal": "rigid"}
LAYERS = {"strip.layers": [[0.1, 2e5, 0.3], [0.0752, 1e5, 0.2], [0.05, 4e5, 0.1]]}
TABLE = {"contact.pressure": [[0.0, 4.0], [0.9, 12.0], [0.9, 6.0], [2.0, 10.0]]}
DISPLACED = {"load.control": "displacement", "load.amplitude": 2e-5}
ARC = {"load.control": "arc-length", "load.amplitude": 6e-5}
MILD = {"strip.axial_stiffness": 3400.0}  # rotations that matter
FIGURES = [
    "force",
    "displacement",
    "fields",
    "gap",
    "traction",
    "reaction",
    "slip_work",
    "stored_energy",
    "sinking",
    "slipping",
    "status",
]

SCENES: dict[str, dict] = {
    "standard": {},
    "exact": SMALL,
    "linear": LINEAR,
    "one step": LINEAR | {"load.steps_per_half_cycle": 1},
    "two cycles": LINEAR | {"load.cycles": 2},
    "bar": LINEAR | {"model.section": "bar"},
    "stepwise bar": LINEAR | {"model.section": "bar"},
    "bar, displaced": LINEAR | {"model.section": "bar"} | DISPLACED,
    "shell": LINEAR | {"model.section": "shell"},
    "shell, exact": SMALL | {"model.section": "shell"} | MILD,
    "squeeze, soft": SMALL | MILD,
    "p1": LINEAR | {"model.section": "p1"},
    "p2": LINEAR | {"model.section": "p2"},
    "p2, exact": SMALL | {"model.section": "p2"} | MILD,
    "p3": LINEAR | {"model.section": "p3"},
    "p4": LINEAR | {"model.section": "p4"},
    "collocation": LINEAR | {"model.grid": "collocation"},
    "collocation, exact": SMALL | {"model.grid": "collocation"},
    "printed": LINEAR | {"model.constants": "printed"},
    "smooth": LINEAR | {"contact.smoothing": 16.0},
    "smooth, exact": SMALL | {"contact.smoothing": 8.0},
    "smooth cap": LINEAR | {"contact.law": "smooth-cap"},
    "tanh": LINEAR | {"contact.law": "tanh-increment"},
    "soft sliders": LINEAR | {"contact.stick_stiffness": 10.0},
    "much friction": LINEAR | {"contact.friction": 0.6, "load.amplitude": 6.0},
    "thin": LINEAR | {"strip.height_ratio": 0.01},
    "thick": LINEAR | {"strip.height_ratio": 0.4},
    "long": LINEAR | {"strip.length": 7.0},
    "nu zero": LINEAR | {"strip.poisson_ratio": 0.0},
    "nu .45": LINEAR | {"strip.poisson_ratio": 0.45},
    "plane stress": LINEAR | {"strip.plane": "stress"},
    "pinned": LINEAR | {"strip.far_end": "pinned"},
    "free": LINEAR | {"strip.far_end": "free"},
    "free, displaced": LINEAR | {"strip.far_end": "free"} | DISPLACED,
    "displaced": LINEAR | DISPLACED,
    "displaced, exact": SMALL | DISPLACED,
    "beyond gross slip": LINEAR | DISPLACED | {"load.amplitude": 2e-4},
    "arc length": LINEAR | ARC,
    "arc length, exact": SMALL | ARC,
    "table": LINEAR | TABLE,
    "table, exact": SMALL | TABLE,
    "from below": LINEAR | {"contact.bottom_pressure": 2.0},
    "pressure in steps": LINEAR | {"load.pressure_steps": 3},
    "lift": LINEAR | LIFT,
    "lift, exact": SMALL | LIFT,
    "lift, shell": LINEAR | LIFT | {"model.section": "shell"},
    "lift, p2": LINEAR | {"model.section": "p2"} | LIFT,
    "compliant": LINEAR | LIFT | {"contact.normal": "compliant"},
    "assumed": LINEAR | LIFT | {"model.section": "assumed"},
    "curved": LINEAR | LIFT | {"strip.curvature": 0.001},
    "curved, exact": SMALL | LIFT | {"strip.curvature": 0.001},
    "layers": LINEAR | LAYERS,
    "layers, exact": SMALL | LAYERS,
    "layers, lift": LINEAR | LAYERS | LIFT,
    "no friction": LINEAR | LIFT | {"contact.friction": 0.0, "load.cycles": 0},
    "no foundation": LINEAR
    | LIFT
    | {"contact.normal": "none", "contact.bottom_pressure": 10.0, "load.cycles": 0},
}


def scene(name: str) -> jb.Scene:
    """A scene by its name; it is held down unless it says otherwise."""
    found = jb.library.standard().replace(HELD | SCENES[name])
    return found if name in CLOSED_FORM else found.by_load_steps()


def results() -> dict[str, np.ndarray]:
    """Arrays by name, of every scene, of a gradient and of a sweep."""
    found = {}
    for name in tqdm(SCENES, disable=None):
        history = jb.solve(scene(name), throw=False)
        found |= {f"{name}/{figure}": np.asarray(getattr(history, figure)) for figure in FIGURES}
        if history.cycles:
            found[f"{name}/dissipation"] = np.asarray(history.dissipation)
            found[f"{name}/dissipation_error"] = np.asarray(history.dissipation_error)
    keys = ["contact.friction", "strip.height_ratio", "strip.poisson_ratio"]
    for name in ("linear", "smooth", "lift", "p2"):
        ask = jb.response(scene(name), keys, ["dissipation"])
        slopes = jax.jacrev(lambda x, ask=ask: ask(*x)["dissipation"])
        found[f"gradient, {name}/dissipation"] = np.asarray(slopes(np.array([0.12, 0.15, 0.25])))
    over = {"strip.height_ratio": np.geomspace(0.02, 0.4, 8), "load.amplitude": [0.3, 0.8, 1.9]}
    swept = jb.sweep(scene("linear"), over)
    return found | {f"sweep/{name}": np.asarray(values) for name, values in swept.data_vars.items()}


def main() -> int:
    """Write the results, or compare them with those of another checkout."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", metavar="FILE.npz")
    parser.add_argument("--against", metavar="FILE.npz")
    options = parser.parse_args()
    warnings.simplefilter("ignore", jb.DoubtfulWarning)
    found = results()
    if options.write:
        np.savez(options.write, **found)
        return 0
    with np.load(options.against) as file:
        before = dict(file)
    worst: dict[str, float] = {}
    for name in sorted(before.keys() | found.keys()):
        scene = name.partition("/")[0]
        worst[scene] = max(worst.get(scene, 0.0), _difference(before.get(name), found.get(name)))
    for scene, difference in worst.items():
        print(f"{scene:24s} {difference:.2g}")
    same = sum(difference == 0.0 for difference in worst.values())
    print(f"{len(worst)} compared, {same} equal to the last bit, worst {max(worst.values()):.2g}")
    return int(max(worst.values()) > 1e-12)


def _difference(a: np.ndarray | None, b: np.ndarray | None) -> float:
    if a is None or b is None or a.shape != b.shape:
        return np.inf
    a, b = a.astype(float), b.astype(float)
    if not np.array_equal(np.isnan(a), np.isnan(b)):
        return np.inf
    scale = max(np.nanmax(np.abs(a), initial=0.0), 1e-300)
    return float(np.nanmax(np.abs(a - b), initial=0.0) / scale)


if __name__ == "__main__":
    sys.exit(main())

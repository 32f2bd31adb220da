"""Time of one dissipation by condensed sections, beside load steps of the same section and nodes.

    python tests/benchmarks/bodies.py               # --nodes 41 --seconds 1 --rungs squeeze p4

prints microseconds of the core per call, best of repeated warm calls: from kept factors, with the
body built for its height ratio, by the walk of a whole history, and by 1 and 30 load steps per half
cycle of `jbeamshell.response`, with lift-off and without it; each with its difference from many
load steps.
"""

from condensed import AMPLITUDE, ETA, repeated  # isort: skip  # first: it takes one core

import argparse

import jax
import jax.numpy as jnp
import numpy as np

import jbeamshell as jb

KEYS = ("strip.height_ratio", "load.amplitude")
MANY = 160  # load steps per half cycle that stand for all


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--nodes", type=int, default=41)
    parser.add_argument("--seconds", type=float, default=1.0, help="of each repeated call")
    parser.add_argument("--rungs", nargs="+", default=["shell", "squeeze", "p4"])
    options = parser.parse_args()
    jb.configure(cache=False)
    eta, amplitude = jnp.asarray(ETA), jnp.asarray([AMPLITUDE])
    for rung in options.rungs:
        scene = jb.library.standard().replace(
            {"model.section": f"condensed-{rung}", "model.nodes": options.nodes}
        )

        def built(eta, amplitude, scene=scene):
            kept = jb.condensed.factors(scene.replace({"strip.height_ratio": eta}))
            return kept.dissipation(amplitude)

        def walk(rung, steps, scene=scene, **values):
            half = {"load.steps_per_half_cycle": steps, "model.kinematics": "linear"}
            return jb.response(scene.replace({"model.section": rung} | half | values), KEYS)

        lift = {"model.fields": [f for f in scene.plan.fields if f != "w"]}
        kept, whole = jb.condensed.factors(scene), jax.jit(built)
        few, some, many = (walk(rung, steps) for steps in (1, 30, MANY))
        frozen, frozen_some = (walk(rung, steps, **lift) for steps in (1, 30))
        history = walk(f"condensed-{rung}", 1)
        calls = {
            "factors kept": lambda kept=kept: kept.dissipation(amplitude),
            "body built": lambda whole=whole: whole(eta, amplitude),
            "history walked": lambda ask=history: ask(ETA, AMPLITUDE)["dissipation"],
            "1 step, w": lambda ask=few: ask(ETA, AMPLITUDE)["dissipation"],
            "30 steps, w": lambda ask=some: ask(ETA, AMPLITUDE)["dissipation"],
            "1 step": lambda ask=frozen: ask(ETA, AMPLITUDE)["dissipation"],
            "30 steps": lambda ask=frozen_some: ask(ETA, AMPLITUDE)["dissipation"],
        }
        exact = float(many(ETA, AMPLITUDE)["dissipation"])
        for name, call in calls.items():
            off = float(np.ravel(call())[0]) / exact - 1.0
            took = repeated(call, options.seconds)
            print(
                f"{rung:8} {name:15} {took['best_us']:9.1f} us  {100.0 * off:+8.4f} %", flush=True
            )


if __name__ == "__main__":
    main()

"""Time of one dissipation by condensed sections, beside load steps of the same section and nodes.

    python tests/benchmarks/bodies.py               # --nodes 41 --seconds 1 --sections squeeze p4

prints microseconds of the core per call, best of repeated warm calls: from kept factors, with the
body built for its height ratio, by a whole history on the contact line, and by 1 and 30 load steps
per half cycle of `jbeamshell.response`, with lift-off and without it; each with its difference from
many load steps.
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
    parser.add_argument("--sections", nargs="+", default=["shell", "squeeze", "p4"])
    options = parser.parse_args()
    jb.configure(cache=False)
    eta, amplitude = jnp.asarray(ETA), jnp.asarray([AMPLITUDE])
    for section in options.sections:
        linear = {"model.section": section, "model.kinematics": "linear"}
        scene = jb.library.standard().replace(linear | {"model.nodes": options.nodes})

        def built(eta, amplitude, scene=scene):
            kept = jb.contact_line.factors(scene.replace({"strip.height_ratio": eta}))
            return kept.dissipation(amplitude)

        def walk(steps, base="rigid", scene=scene):
            values = {"load.steps_per_half_cycle": steps, "contact.normal": base}
            return jb.response(scene.replace(values).by_load_steps(), KEYS)

        kept, whole = jb.contact_line.factors(scene), jax.jit(built)
        few, some, many = (walk(steps) for steps in (1, 30, MANY))
        held, held_some = (walk(steps, "held") for steps in (1, 30))
        history = jb.response(scene.replace({"load.steps_per_half_cycle": 1}), KEYS)
        calls = {
            "factors kept": lambda kept=kept: kept.dissipation(amplitude),
            "body built": lambda whole=whole: whole(eta, amplitude),
            "whole history": lambda ask=history: ask(ETA, AMPLITUDE)["dissipation"],
            "1 step, lift": lambda ask=few: ask(ETA, AMPLITUDE)["dissipation"],
            "30 steps, lift": lambda ask=some: ask(ETA, AMPLITUDE)["dissipation"],
            "1 step": lambda ask=held: ask(ETA, AMPLITUDE)["dissipation"],
            "30 steps": lambda ask=held_some: ask(ETA, AMPLITUDE)["dissipation"],
        }
        exact = float(many(ETA, AMPLITUDE)["dissipation"])
        for name, call in calls.items():
            off = float(np.ravel(call())[0]) / exact - 1.0
            took = repeated(call, options.seconds)
            print(
                f"{section:8} {name:15} {took['best_us']:9.1f} us  {100.0 * off:+8.4f} %",
                flush=True,
            )


if __name__ == "__main__":
    main()

"""Speed of two checkouts side by side.

``python -m verification two_checkouts before=PATH after=PATH`` takes their roots.  Each runs in
a process of its own, and the two take turns, so that other load on the machine meets both alike.
The table gives the best and the median of all rounds, and the ratio of after to before.
"""

import json
import os
import statistics
import subprocess
import sys
import time

ROUNDS = 15
FEW = {
    "contact.normal": "held",
    "model.nodes": 33,
    "load.cycles": 1,
    "load.steps_per_half_cycle": 1,
    "model.kinematics": "linear",
}


def calls():
    """Functions to be timed by name, with the number of calls in a round."""
    import jax

    jax.config.update("jax_enable_x64", True)
    import numpy as np

    import jbeamshell as jb

    jb.configure()
    numbers = (0.1126, 0.7855)
    over = ["strip.height_ratio", "load.amplitude"]
    scene = jb.library.standard().replace(FEW).by_load_steps()
    many = scene.replace({"load.steps_per_half_cycle": 20, "model.nodes": 41})
    exact = scene.replace({"model.kinematics": "exact", "load.steps_per_half_cycle": 4})
    ask = jb.response(scene, over, ["dissipation"])
    loop = jb.response(many, over, ["force", "displacement", "dissipation"])
    rotated = jb.response(exact, over, ["dissipation"])
    slope = jax.jit(jax.grad(lambda eta, load: ask(eta, load)["dissipation"], (0, 1)))
    line = {"model.section": "squeeze", "model.kinematics": "linear", "model.nodes": 33}
    walked = jb.library.standard().replace(line)
    lanes = {"strip.height_ratio": np.geomspace(0.02, 0.4, 64)}
    lanes["load.amplitude"] = np.linspace(0.3, 1.6, 64)
    return {
        "cycle": (lambda: ask(*numbers), 400),
        "loop of 20 steps": (lambda: loop(*numbers), 100),
        "exact rotations": (lambda: rotated(*numbers), 50),
        "gradient": (lambda: slope(*numbers), 200),
        "batch of 4,096": (lambda: jb.sweep(walked, lanes)["dissipation"].values, 1),
    }


def child() -> None:
    """Time a function by name and print the seconds of a call, for every line of the input."""
    import jax

    found = calls()
    for call, _ in found.values():
        jax.block_until_ready(call())
    print(json.dumps(list(found)), flush=True)
    for line in sys.stdin:
        call, count = found[line.strip()]
        begin = time.perf_counter()
        for _ in range(count):
            jax.block_until_ready(call())
        print((time.perf_counter() - begin) / count, flush=True)


def measure(before: str, after: str = ".", rounds: int = ROUNDS) -> None:
    """Let two checkouts take turns and print the table."""
    running = [
        subprocess.Popen(
            [sys.executable, os.path.abspath(__file__)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONPATH": root, "OMP_NUM_THREADS": "1"},
        )
        for root in (before, os.path.abspath(after))
    ]
    names, _ = (json.loads(process.stdout.readline()) for process in running)
    for name in names:
        seconds = [[], []]
        for _ in range(rounds):
            for process, found in zip(running, seconds, strict=True):
                process.stdin.write(name + "\n")
                process.stdin.flush()
                found.append(float(process.stdout.readline()))
        best, middle = ([f(s) * 1e6 for s in seconds] for f in (min, statistics.median))
        print(
            f"{name:18s} best {best[0]:9.1f} {best[1]:9.1f} us, {best[1] / best[0]:.3f}; "
            f"median {middle[0]:9.1f} {middle[1]:9.1f} us, {middle[1] / middle[0]:.3f}",
            flush=True,
        )
    for process in running:
        process.stdin.close()
        process.wait()


if __name__ == "__main__":
    child()

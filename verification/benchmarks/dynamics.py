"""Time and error of the time steps of a strip in motion, in a ring-down of four cycles.

Times are those of a second call, the error that of the motion against very small steps.
"""

import time
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

import jbeamshell as jb
from jbeamshell import dynamics
from jbeamshell.dynamics.release import HEAVY

CYCLES = 4
STRIP = {"model.kinematics": "linear", "contact.normal": "held", "contact.smoothing": 16.0}
NODES, END_SIZE = 21, 0.0278  # and the smallest elements over H, before the nodes scale all
STEPS = [100, 200, 400, 800, 1600, 3200]  # of a period
FINEST = 25600


def warm(run: Callable[[], Any]) -> tuple[Any, float]:
    """Result of a run, and the seconds of its second call."""
    jax.block_until_ready(run().time)
    begin = time.perf_counter()
    result = jax.block_until_ready(run())
    return result, time.perf_counter() - begin


def ringing(per_cycle: int) -> Any:
    """Ring-down of a payload of 50 strips, with a number of time steps in a period."""
    strip = jb.Scene().replace(STRIP).on_grid(NODES, END_SIZE)
    mass = HEAVY * 2.0 * float(strip.strip.half_height * strip.strip.length)
    period = 1.0 / float(dynamics.modes(strip, payload=mass).frequency[0])
    return dynamics.simulate(
        strip,
        CYCLES * period,
        dynamics.Recorded([0.0, 0.1 * period], [1.0, 0.0]),
        payload=mass,
        released=1.0,
        samples=50 * CYCLES + 1,
        step=period / per_cycle,
    )


def measure() -> dict[str, Any]:
    """Rows of all step sizes."""
    reference = ringing(FINEST)
    size = float(np.abs(np.asarray(reference.displacement)).max())
    rows = []
    for steps in STEPS:
        motion, seconds = warm(lambda s=steps: ringing(s))
        off = np.abs(np.asarray(motion.displacement - reference.displacement)).max() / size
        rows.append(
            {
                "steps": int(motion.steps),
                "seconds": seconds,
                "error": float(off),
                "friction_off": float(motion.friction_work[-1] / reference.friction_work[-1] - 1.0),
            }
        )
    return {"steps": rows}

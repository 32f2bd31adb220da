"""Time and error of the methods that integrate a strip in time, in a ring-down of four cycles.

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


def ringing(per_cycle: int | None, **options: Any) -> Any:
    """Ring-down of a payload of 50 strips, with a number of time steps in a period."""
    strip = jb.Scene().replace(STRIP).on_grid(NODES, END_SIZE)
    mass = HEAVY * 2.0 * float(strip.strip.half_height * strip.strip.length)
    attached = dynamics.AttachedMasses(mass)
    period = 1.0 / float(dynamics.modes(strip, attached=attached).frequency[0])
    step = {} if per_cycle is None else {"step": period / per_cycle}
    return dynamics.simulate(
        strip,
        CYCLES * period,
        dynamics.Recorded([0.0, 0.1 * period], [1.0, 0.0]),
        attached=attached,
        released=1.0,
        samples=50 * CYCLES + 1,
        **step,
        **options,
    )


def measure() -> dict[str, Any]:
    """Rows of all methods."""
    reference = ringing(FINEST)
    size = float(np.abs(np.asarray(reference.displacement)).max())
    runs: list[tuple[str, int | None, dict[str, Any]]] = [("midpoint", n, {}) for n in STEPS]
    runs += [("kvaerno3", None, {"tolerance": t}) for t in (1e-4, 1e-5, 1e-6)]
    runs += [("bosh3", None, {}), ("tsit5", None, {})]
    rows = []
    for method, steps, options in runs:
        motion, seconds = warm(
            lambda m=method, s=steps, o=options: ringing(s, method=m, throw=False, **o)
        )
        off = np.abs(np.asarray(motion.displacement - reference.displacement)).max() / size
        rows.append(
            {
                "method": method,
                **options,
                "steps": int(motion.steps),
                "seconds": seconds,
                "error": float(off),
                "friction_off": float(motion.friction_work[-1] / reference.friction_work[-1] - 1.0),
                "status": int(motion.status),
            }
        )
    return {"solvers": rows}

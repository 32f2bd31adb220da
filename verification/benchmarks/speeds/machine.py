"""Environment of processes beside that of a measurement, and the peak of a core."""

import os
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[3]
GIVEN_FLAGS = os.environ.get("XLA_FLAGS", "")  # before this process adds its own
PEAK_SIZE, PEAK_TRIES = 1024, 7


def peak_gflops() -> float:
    """Peak of one core: the fastest product of two square matrices by NumPy."""
    a = np.random.default_rng(0).normal(size=(PEAK_SIZE, PEAK_SIZE))
    seconds = []
    for _ in range(PEAK_TRIES):
        begin = time.perf_counter()
        a @ a
        seconds.append(time.perf_counter() - begin)
    return 2e-9 * PEAK_SIZE**3 / min(seconds)


def environment(**changes: str) -> dict[str, str]:
    """For a process that begins as this one did, without compiled programs of an earlier one."""
    values = {k: v for k, v in os.environ.items() if k != "JAX_COMPILATION_CACHE_DIR"}
    return values | {"XLA_FLAGS": GIVEN_FLAGS, "PYTHONPATH": str(ROOT)} | changes

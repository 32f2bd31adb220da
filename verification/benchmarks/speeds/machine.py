"""Processes beside that of a measurement, and the peak of a core."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

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


@contextmanager
def child(module: str, *words: object) -> Iterator[subprocess.Popen[str]]:
    """A module run in a process that can be asked, and that ends with the block."""
    with subprocess.Popen(
        [sys.executable, "-m", module, *map(str, words)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        bufsize=1,
        env=environment(),
    ) as process:
        yield process
        process.communicate()


def ask(process: subprocess.Popen[str], question: object) -> Any:
    """A child's answer to a line, as JSON both."""
    process.stdin.write(json.dumps(question) + "\n")
    return json.loads(process.stdout.readline())

"""Machine of a measurement, its versions and its peak; and processes beside this one."""

import json
import os
import platform
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import jax
import jaxlib
import numpy as np

from jbeamshell.common.jax_options import is_asynchronous

ROOT = Path(__file__).parents[3]
SCRIPT = Path(__file__).parents[1] / "speed.py"
GIVEN_FLAGS = os.environ.get("XLA_FLAGS", "")  # before this process adds its own
PEAK_SIZE, PEAK_TRIES = 1024, 7


def about() -> dict[str, Any]:
    """Machine, versions and settings of this process."""
    information = Path("/proc/cpuinfo")
    text = information.read_text(encoding="utf-8") if information.exists() else ""
    model = re.search(r"model name\s*:\s*(.*)", text)
    return {
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "cpu": model[1] if model else platform.processor(),
        "device": jax.devices()[0].device_kind,
        "python": platform.python_version(),
        "jax": jax.__version__,
        "jaxlib": jaxlib.__version__,
        "numpy": np.__version__,
        "dtype": "float64",
        "flags": os.environ.get("XLA_FLAGS", ""),
        "async_dispatch": is_asynchronous(),
        "omp_threads": int(os.environ["OMP_NUM_THREADS"]),
        "commit": _git("rev-parse", "--short", "HEAD"),
        "changed_since": bool(_git("status", "--porcelain", "jbeamshell")),
        "date": time.strftime("%Y-%m-%d"),
    }


def _git(*words: str) -> str:
    answer = subprocess.run(["git", *words], capture_output=True, text=True, cwd=ROOT)
    return answer.stdout.strip()


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
    return values | {"XLA_FLAGS": GIVEN_FLAGS} | changes


def told(*words: object, **changes: str) -> Any:
    """JSON that a child process of this script prints."""
    command = [sys.executable, str(SCRIPT), "--child", *map(str, words)]
    answer = subprocess.run(
        command, stdout=subprocess.PIPE, text=True, check=True, env=environment(**changes)
    )
    return json.loads(answer.stdout)


@contextmanager
def child(*words: object) -> Iterator[subprocess.Popen[str]]:
    """A child of this script's that can be asked, and that ends with the block."""
    command = [sys.executable, str(SCRIPT), "--child", *map(str, words)]
    with subprocess.Popen(
        command,
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

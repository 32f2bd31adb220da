"""Provenance of recorded figures: machine, versions, commit and date."""

import os
import platform
import re
import subprocess
import time
from pathlib import Path
from typing import Any

import jax
import jaxlib
import numpy as np

ROOT = Path(__file__).parents[1]


def provenance() -> dict[str, Any]:
    """Machine, versions, commit and date, for a record in double precision."""
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
        "commit": _git("rev-parse", "--short", "HEAD"),
        "changed_since": bool(_git("status", "--porcelain", "jbeamshell")),
        "date": time.strftime("%Y-%m-%d"),
    }


def _git(*words: str) -> str:
    """Answer of git; empty where there is none."""
    try:
        answer = subprocess.run(["git", *words], capture_output=True, text=True, cwd=ROOT)
    except OSError:
        return ""
    return answer.stdout.strip()

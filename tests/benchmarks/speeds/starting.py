"""Time of a fresh process until its first result."""

import json
import statistics
import subprocess
import sys
import tempfile
import time
from typing import Any

from . import machine
from .common import Plan

RUN = (sys.executable, "-m", "jbeamshell", "run", "--json")
SMALL = {
    "model.nodes": "41",
    "load.steps_per_half_cycle": "4",
    "load.cycles": "1",
    "model.kinematics": "linear",
}


def start(plan: Plan) -> dict[str, Any]:
    """Seconds to import, to a first result, and to one whose programs are found compiled."""
    words = [word for key, value in SMALL.items() for word in ("--set", f"{key}={value}")]
    imports = [
        _wall([sys.executable, "-c", "import jbeamshell"], machine.environment())[0]
        for _ in range(plan.starts)
    ]
    rows = []
    for what, command in (("standard strip", RUN), ("41 nodes, 4 steps", (*RUN, *words))):
        with tempfile.TemporaryDirectory(prefix="jbeamshell-speed-") as folder:
            environment = machine.environment(XDG_CACHE_HOME=folder)
            cold, first = _wall(command, environment)
            warm = [_wall(command, environment) for _ in range(plan.starts)]
        rows.append(
            {
                "what": what,
                "cold_s": cold,
                "cold_compile_s": json.loads(first)["compile_s"],
                "warm_s": statistics.median(seconds for seconds, _ in warm),
                "warm_compile_s": statistics.median(_said(warm, "compile_s")),
                "wall_s": statistics.median(_said(warm, "wall_s")),
            }
        )
    return {"import_s": statistics.median(imports), "starts": plan.starts, "rows": rows}


def _wall(command: Any, environment: dict[str, str]) -> tuple[float, str]:
    begin = time.perf_counter()
    answer = subprocess.run(
        command, env=environment, cwd=machine.ROOT, capture_output=True, text=True, check=True
    )
    return time.perf_counter() - begin, answer.stdout


def _said(runs: list[tuple[float, str]], key: str) -> list[float]:
    return [json.loads(text)[key] for _, text in runs]

"""Fresh processes until their result, with and without compiled programs at hand.

Programs of one thread take as much time on an idle machine as they take of its processors, which
other programs do not change; so that is what is recorded, beside the time by the clock.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from typing import Any

from . import machine

COMMANDS = {
    "jbeamshell run": ("run",),
    "jbeamshell run --out": ("run", "--out", "out"),
    "jbeamshell advise": ("advise",),
    "jbeamshell sweep, 1,000 strips": ("sweep", "--over", "load.amplitude=0.3:0.9:1000"),
    "jbeamshell ringdown": ("ringdown",),
}
RESULTS = {
    "jb.solve(jb.Scene())": "float(jb.solve(jb.Scene()).dissipation)",
    "jb.response, first figure": "jb.response(jb.Scene(), ['load.amplitude'])(.5)",
    "jb.solve, section plane": (
        "float(jb.solve(jb.Scene().replace({'model.section': 'plane'})).dissipation)"
    ),
    "jb.solve in load steps": "float(jb.solve(jb.Scene(), by='steps').dissipation)",
}
BEGIN = (
    "import jax; jax.config.update('jax_enable_x64', True); import jbeamshell as jb; "
    "jb.configure(); "
)


def start(starts: int = 1) -> dict[str, Any]:
    """Seconds of fresh processes: to import, and to a result without and with a cache."""
    python = sys.executable
    imports = [_seconds((python, "-c", "import jbeamshell"), ".") for _ in range(starts)]
    cases = {what: (python, "-m", "jbeamshell", *words) for what, words in COMMANDS.items()}
    cases |= {what: (python, "-c", BEGIN + code) for what, code in RESULTS.items()}
    rows = []
    for what, command in cases.items():
        with tempfile.TemporaryDirectory(prefix="jbeamshell-speed-") as folder:
            cold_cpu, cold = _seconds(command, folder)
            warm = [_seconds(command, folder) for _ in range(starts)]
        cpu, clock = (statistics.median(column) for column in zip(*warm, strict=True))
        rows.append(
            {
                "what": what,
                "cold_cpu_s": cold_cpu,
                "warm_cpu_s": cpu,
                "cold_s": cold,
                "warm_s": clock,
            }
        )
        print(rows[-1], file=sys.stderr, flush=True)
    import_cpu = statistics.median(cpu for cpu, _ in imports)
    load = os.getloadavg()[0]
    return {"import_cpu_s": import_cpu, "starts": starts, "load": load, "rows": rows}


def _seconds(command: tuple[str, ...], folder: str) -> tuple[float, float]:
    """Seconds of the processors and of the clock that a process takes in a folder."""
    environment = machine.environment(XDG_CACHE_HOME=folder)
    before, begin = os.times(), time.perf_counter()
    subprocess.run(command, env=environment, cwd=folder, capture_output=True, check=True)
    after = os.times()
    own = after.children_user - before.children_user
    return own + after.children_system - before.children_system, time.perf_counter() - begin

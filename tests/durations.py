"""Record of a test run: how long every test takes, and how much of that XLA compiles.

    python -m pytest -n 2 --record FILE

writes a JSON file with the tests by their time, the slowest first: seconds in all, programs that
were compiled or read from the folder of compiled programs, and seconds of that.
"""

from __future__ import annotations

import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import jax.monitoring
import pytest

COMPILED = "/jax/core/compile/backend_compile_duration"


class Recorder:
    """Plugin of pytest: workers count programs, and the process that started them writes."""

    def __init__(self, path: Path | None) -> None:
        """Record to a file; None is a worker, whose reports carry its counts to the other."""
        self.path, self.counted = path, [0, 0.0]
        self.tests: dict[str, list[Any]] = defaultdict(lambda: [0.0, 0, 0.0])
        jax.monitoring.register_event_duration_secs_listener(self._count)

    def _count(self, event: str, seconds: float, **_: Any) -> None:
        if event == COMPILED:
            self.counted = [self.counted[0] + 1, self.counted[1] + seconds]

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self) -> Any:
        """Give a report the programs since the one before."""
        report = yield
        report.compiled, self.counted = self.counted, [0, 0.0]
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Add what a part of a test took."""
        own = self.tests[report.nodeid]
        for place, more in enumerate((report.duration, *getattr(report, "compiled", (0, 0.0)))):
            own[place] += more

    def pytest_sessionfinish(self) -> None:
        """Write the record."""
        if self.path is None:
            return
        rows = sorted(self.tests.items(), key=lambda pair: -pair[1][0])
        lines = [
            json.dumps(
                {"test": name, "seconds": round(t, 2), "programs": n, "compiling": round(c, 2)}
            )
            for name, (t, n, c) in rows
        ]
        whole = [round(sum(row[place] for _, row in rows), 1) for place in range(3)]
        about = dict(zip(("seconds", "programs", "compiling"), whole, strict=True))
        text = ",\n".join(lines)
        self.path.write_text(f'{{"about": {json.dumps(about)}, "tests": [\n{text}\n]}}\n')

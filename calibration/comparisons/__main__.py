"""Command: compute the comparisons, print a table, and write the records."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

from tqdm import tqdm  # noqa: E402

import jbeamshell as jb  # noqa: E402
from calibration.comparisons import all_cases, measurements, table  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402

HERE = Path(__file__).parent


def main(arguments: list[str] | None = None) -> int:
    """Run the command; the exit code is 1 if a case is outside its bound."""
    parser = argparse.ArgumentParser(prog="python -m calibration.comparisons", description=__doc__)
    parser.add_argument("name", nargs="*", help="words of the names of the cases (default: all)")
    parser.add_argument("--data", type=Path, help="folder of measurements, to take them again")
    options = parser.parse_args(arguments)
    cases = all_cases()
    chosen = [c for c in cases if not options.name or any(word in c.name for word in options.name)]
    if not chosen:
        parser.error("no such case: choose among " + ", ".join(case.name for case in cases))
    jb.configure()
    if options.data is not None:
        measurements.record(options.data)
    results = [case.run() for case in tqdm(chosen, disable=None, unit="case")]
    print(table.as_text(results))
    if len(chosen) == len(cases):
        rows = [result.figures() for result in results]
        write_text(HERE / "results.json", json.dumps(rows, indent=1) + "\n")
        write_text(HERE / "table.md", table.as_page(results))
    return int(not all(result.within for result in results))


if __name__ == "__main__":
    sys.exit(main())

"""Time of a cycle at its error, beside other programs for it.

    python tests/benchmarks/speed.py            # --draw: only the picture, from the record

writes speed.json beside this file and draws speed.png from it.  An error stands beside every time:
against the same model on 321 nodes in 40 steps per half cycle, and against finite elements.  Its
sections, any of which ``--only`` does alone while the rest of the record stays:

- one: a run of the standard strip by all variants and rivals, interleaved;
- nodes: the same over nodes;
- gradient: gradients in four parameters beside a run, and dD/d(eta) over nodes;
- start: fresh processes, with and without compiled programs at hand.

Sweeps are those of sweeps.py.

``--quick`` measures little of everything, to try it out, into a temporary folder.

``--peer SCRIPT`` times condensed finite elements of your own beside the rest: called with ETA A NX
NY STEPS_PER_QUARTER it prints a JSON line with "ratio" (to the cubic law), "build_s" and
"run_s_2_cycles".
"""

import os

os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # before NumPy

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

from ladder import as_text  # noqa: E402
from speeds import gradients, machine, single, starting  # noqa: E402
from speeds.common import QUICK, Plan  # noqa: E402

import jbeamshell as jb  # noqa: E402
from calibration import charts  # noqa: E402
from jbeamshell import plotting  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402

RECORD = Path(__file__).with_suffix(".json")
SECTIONS = {
    "one": single.one,
    "nodes": single.nodes,
    "gradient": gradients.gradient,
    "start": starting.start,
}
CHILDREN = {
    "unflagged": single.unflagged,
}


def parsed() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", metavar="A,B", help=f"sections of {', '.join(SECTIONS)}")
    parser.add_argument("--rounds", type=int, help=f"default {Plan().rounds}")
    parser.add_argument("--quick", action="store_true", help="little of everything, elsewhere")
    parser.add_argument("--draw", action="store_true", help="draw the record that is there")
    parser.add_argument("--peer", metavar="SCRIPT", help="condensed elements to be timed beside")
    parser.add_argument("--child", nargs="+", help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.only = options.only.split(",") if options.only else list(SECTIONS)
    unknown = set(options.only) - set(SECTIONS)
    if unknown:
        parser.error(f"--only {', '.join(sorted(unknown))}: choose of {', '.join(SECTIONS)}")
    return options


def plan_of(options: argparse.Namespace) -> Plan:
    """Sizes of the measurement."""
    plan = (QUICK if options.quick else Plan())._replace(peer=options.peer)
    return plan._replace(rounds=options.rounds) if options.rounds else plan


def report(record: dict[str, Any]) -> str:
    """Summary of the record."""
    lines = []
    for name, section in record.items():
        lines.append(f"{name}: {section['took_s']:.0f} s, commit {section['about']['commit']}")
        own = {k: v for k, v in section.items() if k not in ("about", "study")}
        whole = {k: v for k, v in own.items() if not isinstance(v, list)}
        for row in (whole, *own.get("rows", []), *own.get("ratios", [])):
            words = (
                f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
                for key, value in row.items()
                if key not in ("returns", "took_s")
            )
            lines.append("    " + ", ".join(words))
    return "\n".join(lines)


def main() -> None:
    """Measure, write the record, say what it holds, draw it."""
    options = parsed()
    # First calls are to be compiled, whatever an earlier process has left.
    jax.config.update("jax_enable_compilation_cache", options.quick)
    if options.child:
        name, *rest = options.child
        jb.configure(fast_loops=name != "unflagged", cache=False)
        CHILDREN[name](*map(int, rest))
        return
    jb.configure(cache=False)
    target = RECORD
    if options.quick and not options.draw:
        target = Path(tempfile.mkdtemp(prefix="jbeamshell-speed-")) / RECORD.name
    record: dict[str, Any] = {}
    if target.exists():
        record = json.loads(target.read_text(encoding="utf-8"))
    plan = plan_of(options)
    for name in [] if options.draw else options.only:
        print(f"{name} ...", file=sys.stderr)
        begin = time.perf_counter()
        found = SECTIONS[name](plan)
        took = {"took_s": time.perf_counter() - begin}
        about = machine.about() | {"rounds": plan.rounds, "quick": options.quick}
        record[name] = {"about": about} | took | found
        record = {name: record[name] for name in SECTIONS if name in record}
        write_text(target, as_text(record))
        jax.clear_caches()
    print(report(record))
    print(f"record: {target}", file=sys.stderr)
    try:
        plotting.save(charts.speed.sheet(record), target.with_suffix(".png"))
    except jb.InputError as error:  # of sections without a picture
        print(error, file=sys.stderr)


if __name__ == "__main__":
    main()

"""Time of steady cycles of plane elasticity from factors, at their error, on one core.

    python tests/benchmarks/condensed.py            # --quick: little of everything, no record

writes condensed.json beside this file: best and median of repeated warm calls and their time of the
core, which other work on the machine disturbs least; compile time apart; with the machine, the
versions and the precision.  Rates and ratios are of the core's time.  Its parts:

- cycle: one pull and a cycle of the standard strip, factors kept and building included;
- batch: 64 height ratios x 256 amplitudes; sweeps are in sweeps.py;
- error: over the contact nodes, against converged finite elements;
- peer: given by ``--peer SCRIPT`` (a module with `Strip(eta, lines=, keep_lu=)` and `cyc(strip,
  amplitude, steps_per_quarter, cycles)`, which condenses finite elements), at equal error.
"""

import os

os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # before NumPy
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})

import argparse
import csv
import functools
import importlib.util
import statistics
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
from ladder import as_text  # noqa: E402
from speeds import machine  # noqa: E402

import jbeamshell as jb  # noqa: E402
from jbeamshell import contact_line  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.contact_line.dissipation import NODES, REFINED  # noqa: E402
from jbeamshell.measured.example import data_folder  # noqa: E402

ETA, AMPLITUDE = 0.1126, 0.7855
COUNTS = (17, 25, 33, 49, 65, 89, 129)
BUDGET = 2.0  # seconds of a repeated call
WANTED = (0.01, 0.005, 0.002)
MESHES = ((30, 3), (40, 4), (60, 6), (80, 8), (120, 12))
STEPS = (10, 20, 40)  # per quarter cycle


def cells() -> list[dict[str, float]]:
    """Dissipation by converged finite elements."""
    with (data_folder() / "energy.csv").open(encoding="utf-8") as table:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(table)]


def repeated(call: Callable[[], Any], budget: float) -> dict[str, float]:
    """Best and median time of a call and the mean of the core's, in microseconds."""
    jax.block_until_ready(call())
    seconds: list[float] = []
    core = time.process_time()
    end = time.perf_counter() + budget
    while len(seconds) < 3 or time.perf_counter() < end:
        begin = time.perf_counter()
        jax.block_until_ready(call())
        seconds.append(time.perf_counter() - begin)
    core = (time.process_time() - core) / len(seconds)
    times = {"core_us": core, "best_us": min(seconds), "median_us": statistics.median(seconds)}
    return {key: 1e6 * value for key, value in times.items()} | {"calls": len(seconds)}


def first(call: Callable[[], Any]) -> float:
    """Seconds of the first call."""
    begin = time.perf_counter()
    jax.block_until_ready(call())
    return time.perf_counter() - begin


def scene(eta: Any = ETA) -> jb.Scene:
    """Standard strip of a height ratio."""
    return jb.library.standard().replace({"strip.height_ratio": eta})


@functools.cache
def builder(nodes: int) -> Callable[[jax.Array], contact_line.CycleFactors]:
    """Compiled function from a height ratio to factors."""
    return jax.jit(lambda eta: contact_line.factors(scene(eta), nodes=nodes))


# --- parts ----------------------------------------------------------------------------------------


def cycle(budget: float) -> dict[str, Any]:
    """One pull and a cycle, dissipation only."""
    found = {}
    for name, nodes in (("default", NODES), ("refined", REFINED)):
        build = builder(nodes)
        ask = jax.jit(lambda kept, amplitudes: kept.dissipation(amplitudes))
        eta, amplitude = jnp.asarray(ETA), jnp.asarray([AMPLITUDE])
        found[name] = {"nodes": nodes, "compile_s": first(lambda b=build, e=eta: b(e))}
        kept = build(eta)
        slope = jax.jit(jax.value_and_grad(lambda kept, a: kept.dissipation(a)[0], argnums=1))
        calls = {
            "factors_kept": lambda k=kept, a=amplitude, f=ask: f(k, a),
            "value_and_slope": lambda k=kept, a=amplitude, f=slope: f(k, a),
            "built": lambda e=eta, a=amplitude, b=build, f=ask: f(b(e), a),
        }
        found[name] |= {key: repeated(call, budget) for key, call in calls.items()}
    return found


def batch(budget: float) -> dict[str, Any]:
    """Many strips and amplitudes."""
    etas, amplitudes = jnp.geomspace(0.03, 0.4, 64), jnp.linspace(0.1, 1.9, 256)
    many = etas.size * amplitudes.size

    def one(eta: jax.Array) -> contact_line.CycleFactors:
        return contact_line.factors(scene(eta))

    build = jax.jit(lambda etas: jax.lax.map(one, etas))
    ask = jax.jit(lambda kept: jax.lax.map(lambda own: own.dissipation(amplitudes), kept))
    both = jax.jit(lambda etas: jax.lax.map(lambda e: one(e).dissipation(amplitudes), etas))
    kept = build(etas)
    calls: dict[str, tuple[int, Callable[[], Any]]] = {
        "64 eta x 256 A, factors kept": (many, lambda: ask(kept)),
        "64 eta x 256 A, all built": (many, lambda: both(etas)),
    }
    found: dict[str, Any] = {}
    for name, (count, call) in calls.items():
        took = repeated(call, budget)
        rate = 1e6 * count / took["core_us"]
        found[name] = took | {"lanes": count, "lanes_per_s": rate}
    return found


def error(counts: tuple[int, ...]) -> list[dict[str, Any]]:
    """Worst errors over the nodes."""
    rows, found = cells(), []
    for nodes in counts:
        build = builder(nodes)
        worst = {"above_tenth": 0.0, "above_ten_thousandth": 0.0}
        for eta in sorted({row["eta"] for row in rows}):
            kept = build(jnp.asarray(eta))
            for row in rows:
                if row["eta"] == eta and row["ratio"] > 1e-4:
                    off = abs(float(kept.dissipation([row["A"]])[0]) / row["D"] - 1.0)
                    key = "above_tenth" if row["ratio"] > 0.1 else "above_ten_thousandth"
                    worst[key] = max(worst[key], off)
        found.append({"nodes": nodes} | worst)
    return found


def peer(script: str, counts: tuple[int, ...], budget: float) -> dict[str, Any]:
    """Cheapest settings of both that meet an error over the amplitudes of the standard strip."""
    module = loaded(script)
    rows = [row for row in cells() if row["eta"] == ETA and row["ratio"] > 0.25][::2]
    theirs = [settings for mesh in MESHES for settings in meshed(module, mesh, rows, budget)]
    ours = []
    for nodes in counts:
        build = builder(nodes)
        ask = jax.jit(lambda kept, a: kept.dissipation(a))
        eta, amplitude = jnp.asarray(ETA), jnp.asarray([AMPLITUDE])
        kept = build(eta)
        off = max(abs(float(kept.dissipation([r["A"]])[0]) / r["D"] - 1.0) for r in rows)
        run = repeated(lambda k=kept, a=amplitude, f=ask: f(k, a), budget)["core_us"]
        whole = run + repeated(lambda e=eta, b=build: b(e), budget)["core_us"]
        ours.append({"nodes": nodes, "error": off, "kept_us": run, "built_us": whole})
    ratios = []
    for wanted in WANTED:
        pair = [
            {
                key: min((s for s in side if s["error"] <= wanted), key=lambda s, k=key: s[k])
                for key in ("kept_us", "built_us")
            }
            for side in (ours, theirs)
            if any(s["error"] <= wanted for s in side)
        ]
        if len(pair) == 2:
            times = {key: pair[1][key][key] / pair[0][key][key] for key in pair[0]}
            ratios.append({"error": wanted, "ours": pair[0], "theirs": pair[1], "times": times})
    return {"amplitudes": [row["A"] for row in rows], "ours": ours, "theirs": theirs} | {
        "at_equal_error": ratios
    }


def meshed(
    module: Any, mesh: tuple[int, int], rows: list[dict[str, float]], budget: float
) -> list[dict[str, Any]]:
    """Error and time of the peer on a mesh, with several numbers of load steps."""
    nx, ny = mesh
    lengths, heights = 8.0 ** (-np.arange(nx) / nx), 4.0 ** (np.arange(ny) / ny)
    x = np.append(0.0, np.cumsum(lengths / lengths.sum())) * 2.0
    y = np.append(0.0, np.cumsum(heights / heights.sum())) * 2.0 * ETA

    def build() -> Any:
        return module.Strip(ETA, lines=(x, y), keep_lu=False)

    strip = build()
    built = repeated(build, budget)["core_us"]
    found = []
    for steps in STEPS:
        off = max(
            abs(module.cyc(strip, row["A"], steps, 2)["Dfric"][-1] / row["D"] - 1.0) for row in rows
        )
        run = repeated(lambda n=steps: module.cyc(strip, AMPLITUDE, n, 2), budget)["core_us"]
        whole = {"kept_us": run, "built_us": run + built}
        found.append({"mesh": [nx, ny], "steps_per_quarter": steps, "error": off} | whole)
    return found


def loaded(script: str) -> Any:
    """A module of a file."""
    spec = importlib.util.spec_from_file_location("peer", script)
    if spec is None or spec.loader is None:
        raise SystemExit(f"--peer {script}: is no Python file")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def report(record: Mapping[str, Any], indent: str = "") -> str:
    """Figures of a record, one on a line."""
    lines = []
    for key, value in record.items():
        if isinstance(value, Mapping):
            lines += [f"{indent}{key}", report(value, indent + "    ")]
        else:
            lines.append(
                f"{indent}{key}: {value:.4g}"
                if isinstance(value, float)
                else f"{indent}{key}: {value}"
            )
    return "\n".join(lines)


def main() -> None:
    """Measure, say what was found, write the record."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="little of everything, no record")
    parser.add_argument("--peer", metavar="SCRIPT", help="condensed elements to be timed beside")
    options = parser.parse_args()
    jb.configure(cache=False)
    jax.config.update("jax_enable_compilation_cache", False)
    budget = 0.1 if options.quick else BUDGET
    counts = (NODES,) if options.quick else COUNTS
    record: dict[str, Any] = {
        "about": machine.about() | {"cores_used": 1, "peak_gflops": machine.peak_gflops()},
        "cycle": cycle(budget),
        "batch": batch(budget),
        "error": error(counts),
    }
    if options.peer:
        record["peer"] = peer(options.peer, counts, 0.2 * budget)
    print(report(record))
    if not options.quick:
        write_text(Path(__file__).with_suffix(".json"), as_text(record))


if __name__ == "__main__":
    main()

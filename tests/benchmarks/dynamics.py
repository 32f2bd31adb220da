"""Benchmark of dynamics: energy balance, slow limit, Masing's prediction, solvers, real time.

    python tests/benchmarks/dynamics.py

writes dynamics.json and dynamics.png beside this file and takes some minutes.  With names of parts
(slow_limit, masing, solvers, ledger_of_100_cycles) it measures only these.  Times are those of a
second call; the record has the machine, the versions and the precision.
"""

import json
import os
import platform
import sys
import time
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

import jaxlib  # noqa: E402
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

import jbeamshell as jb  # noqa: E402

jb.configure(cache=False)

from jbeamshell import dynamics, plotting  # noqa: E402
from jbeamshell.dynamics.release import HEAVY, let_go  # noqa: E402

HERE = Path(__file__).parent
STRIP = {"model.kinematics": "linear", "contact.normal": "held"}
GRID, FINE = (41, 0.0278), (161, 1.0 / 6.0)  # nodes, and smallest elements before scaling
FORCES = [0.1, 0.2, 0.3, 0.5, 0.8, 1.2, 1.6]
STEPS = [100, 200, 400, 800, 1600, 3200]
FINEST = 25600
SMALLEST = 0.1126 / 12.0  # a dissertation-like mesh: H/12 at the loaded end, throughout


def warm(run):
    """Result of a run, and the seconds of its second call."""
    jax.block_until_ready(run().time)
    begin = time.perf_counter()
    result = jax.block_until_ready(run())
    return result, time.perf_counter() - begin


def scene(grid=GRID, **values):
    return jb.Scene().replace(STRIP | values).on_grid(*grid)


def ringing(strip, cycles, per_cycle, **options):
    """Ring-down of a payload of 50 strips, with a number of time steps in a period."""
    mass = HEAVY * 2.0 * float(strip.strip.half_height * strip.strip.length)
    attached = dynamics.AttachedMasses(mass)
    period = 1.0 / float(dynamics.modes(strip, attached=attached).frequency[0])
    step = {} if per_cycle is None else {"step": period / per_cycle}
    return dynamics.simulate(
        strip,
        cycles * period,
        dynamics.Recorded([0.0, 0.1 * period], [1.0, 0.0]),
        attached=attached,
        released=1.0,
        samples=round(50 * cycles) + 1,
        **step,
        **options,
    )


def ledger():
    """Error of the energy balance over a hundred cycles, relative to the initial energy."""
    rows = []
    for per_cycle in (200, 800, 3200):
        motion, seconds = warm(lambda n=per_cycle: ringing(scene(), 100, n))
        begin = float(motion.energy[0] - motion.energy.min())
        left = float(np.abs(motion.imbalance).max()) / begin
        span = float(motion.time[-1])
        rows.append(
            {"steps_per_cycle": per_cycle, "left_over": left, "seconds": seconds, "time": span}
        )
    return rows


def slow_limit():
    """Work of friction under a slow harmonic load over that of the quasi-static loop."""
    strip = scene()
    loop = float(jb.solve(strip).dissipation)
    attached = dynamics.AttachedMasses(
        HEAVY * 2.0 * float(strip.strip.half_height * strip.strip.length)
    )
    first = float(dynamics.modes(strip, attached=attached).frequency[0])
    rows = []
    for ratio in (0.1, 0.03, 0.01):
        slow = 1.0 / (ratio * first)
        load = dynamics.Harmonic(0.7855, 1.0 / slow, ramp=0.5)
        motion = dynamics.simulate(
            strip, 2.5 * slow, load, attached=attached, samples=501, step=slow / 10000
        )
        loss = float(motion.friction_work[-1] - motion.friction_work[-201])
        rows.append({"frequency_ratio": ratio, "dissipation_over_quasi_static": loss / loop})
    return rows


def masing():
    """Ring-down beside its prediction, and the log-slope of energy per cycle over force."""
    study = let_go(scene(), 1.0, cycles=60.0, per_cycle=800, whole=True)
    late = study.found.damping < 0.02
    off = np.abs(study.ratio[late] - 1.0)
    joint = dynamics.Joint.of(scene(FINE), 1.7)
    u = np.interp(FORCES, np.asarray(joint.forces), np.asarray(joint.displacements))
    slopes = np.diff(np.log(np.asarray(joint.dissipation(u)))) / np.diff(np.log(FORCES))
    bar = dynamics.Joint.of(scene(FINE, **{"strip.height_ratio": 0.02}), 1.7)
    v = np.interp(FORCES, np.asarray(bar.force), np.asarray(bar.displacement))
    cubic = np.diff(np.log(np.asarray(bar.dissipation(v)))) / np.diff(np.log(FORCES))
    figures = {name: np.asarray(v).tolist() for name, v in study.figures().items() if "d" in name}
    return {
        "median_off_below_2_per_cent_damping": float(np.median(off)),
        "largest_off_below_2_per_cent_damping": float(off.max()),
        "forces": FORCES,
        "log_slope_eta_0.1126": slopes.tolist(),
        "log_slope_eta_0.02": cubic.tolist(),
        "curve": {k: v for k, v in figures.items() if isinstance(v, list)},
    }


def work_precision():
    """Time and error of the solvers in a ring-down of four cycles with m = 16."""
    strip = scene((21, GRID[1]), **{"contact.smoothing": 16.0})
    reference = ringing(strip, 4, FINEST)
    size = float(np.abs(np.asarray(reference.displacement)).max())
    runs = [("midpoint", n, {}) for n in STEPS]
    runs += [("kvaerno3", None, {"tolerance": t}) for t in (1e-4, 1e-5, 1e-6)]
    runs += [("bosh3", None, {}), ("tsit5", None, {})]
    rows = []
    for method, steps, options in runs:
        motion, seconds = warm(
            lambda m=method, s=steps, o=options: ringing(strip, 4, s, method=m, throw=False, **o)
        )
        off = np.abs(np.asarray(motion.displacement - reference.displacement)).max() / size
        rows.append(
            {
                "method": method,
                **options,
                "steps": int(motion.steps),
                "seconds": seconds,
                "error": float(off),
                "friction_off": float(motion.friction_work[-1] / reference.friction_work[-1] - 1.0),
                "status": int(motion.status),
            }
        )
    return rows


def real_time(rows):
    """Computing time per time of a steel strip of 100 mm, and steps of explicit elements."""
    length, speed = 0.1, 5400.0  # m, m/s: sqrt(E'/rho) of steel
    mine = rows[0]
    unit = float(np.sqrt(scene().strip.plane_modulus)) * mine["time"] / 2.0  # transits
    span = unit * length / speed
    element = SMALLEST / 2.0 * length
    dilatation = speed * np.sqrt(1.0 / (1.0 - (0.3 / 0.7) ** 2))
    return {
        "seconds_followed": span,
        "seconds_taken": mine["seconds"],
        "slower_than_real_time": mine["seconds"] / span,
        "explicit_finite_element_steps": span * dilatation / element,
        "steps_taken": 100 * mine["steps_per_cycle"],
    }


def chart(record):
    with plotting.style():
        figure, axes = plt.subplots(1, 2, figsize=(10.0, 4.0))
        for number, method in enumerate(dict.fromkeys(r["method"] for r in record["solvers"])):
            rows = [r for r in record["solvers"] if r["method"] == method]
            axes[0].loglog(
                [r["seconds"] for r in rows],
                [r["error"] for r in rows],
                "o-",
                color=plotting.PALETTE[number],
                label=method,
            )
        axes[0].set(xlabel="seconds of a warm run", ylabel="largest error of $u(L)$, relative")
        axes[0].legend()
        curve = record["masing"]["curve"]
        axes[1].loglog(curve["amplitude"], curve["damping"], "o", color="0.15", markersize=3)
        axes[1].loglog(curve["amplitude"], curve["predicted_damping"], color=plotting.PALETTE[1])
        axes[1].set(xlabel="amplitude of $u(L)$", ylabel=r"damping ratio $\zeta$")
    plotting.save(figure, HERE / "dynamics.png")


PARTS = {
    "ledger_of_100_cycles": ledger,
    "slow_limit": slow_limit,
    "masing": masing,
    "solvers": work_precision,
}


def main() -> None:
    """Measure the named parts, or all, and write the record."""
    file = HERE / "dynamics.json"
    record = json.loads(file.read_text()) if file.exists() else {}
    record |= {
        "machine": f"{os.cpu_count()} cores, {platform.machine()}",
        "versions": {"jax": jax.__version__, "jaxlib": jaxlib.__version__},
        "precision": "float64",
    }
    for name in sys.argv[1:] or PARTS:
        record[name] = PARTS[name]()
    record["real_time"] = real_time(record["ledger_of_100_cycles"])
    file.write_text(json.dumps(record, indent=1) + "\n")
    chart(record)
    print(json.dumps({k: v for k, v in record.items() if k != "masing"}, indent=1))


if __name__ == "__main__":
    main()

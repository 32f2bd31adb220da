"""Many lanes: a sweep's speed and errors, several processes, and steps that do not settle."""

import functools
import json
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from tqdm import tqdm

import jbeamshell as jb
from jbeamshell.sweeping.lanes import Outcome

from . import machine
from .common import OVER, RANGE, Plan, errors, lanes, scene, seconds_of, swept

GRIDS: tuple[dict[str, Any], ...] = (
    {"model.nodes": 33, "model.end_size": 1.0 / 54.0},
    {"model.nodes": 61, "load.steps_per_half_cycle": 2, "model.end_size": 1.0 / 24.0},
)
WIDE = {"strip.height_ratio": (0.01, 0.4), "load.amplitude": (0.05, 1.9)}
CHUNK = 8  # lanes that advance together
STARTS = 3  # rounds, at the most, of what starts processes
TWO_DEVICES = "--xla_force_host_platform_device_count=2"


def batch(plan: Plan) -> dict[str, Any]:
    """Lanes per second over the batch's size, errors of its lanes, and the memory it takes."""
    rows, sizes = [], []
    for change in GRIDS:
        here = scene(change)
        case = {
            "nodes": here.model.nodes,
            "steps": here.load.steps_per_half_cycle,
            "end_size": here.model.end_size,
        }
        values = lanes(plan.lanes)
        cold = swept(values, change)
        warm = _warm(values, change, plan.rounds)
        row = case | {"lanes": plan.lanes, "compile_s": cold.compile_s, "warm_s": min(warm)}
        row |= {"lanes_per_s": plan.lanes / min(warm)}
        row |= {"lanes_per_s_median": plan.lanes / float(np.median(warm))}
        row |= errors(values, cold.values["dissipation"], plan.sample, change)
        rows.append(row)
        for size in tqdm(plan.sizes, disable=None, unit="size", desc="batch"):
            few = {key: column[:size] for key, column in values.items()}
            swept(few, change)
            seconds = min(_warm(few, change, plan.rounds))
            sizes.append(case | {"lanes": size, "warm_s": seconds, "lanes_per_s": size / seconds})
    memory = [
        {"lanes": size, "peak_mb": machine.told("memory", size)["peak_mb"]}
        for size in (plan.sizes[0], plan.lanes)
    ]
    return {
        "ranges": {key: list(pair) for key, pair in RANGE.items()},
        "rows": rows,
        "sizes": sizes,
        "memory": memory,
    }


def _warm(values: dict[str, np.ndarray], change: dict[str, Any], rounds: int) -> list[float]:
    return [seconds_of(lambda: swept(values, change).values) for _ in range(rounds)]


def memory(size: int) -> None:
    """Print the largest memory of a process that sweeps so many lanes."""
    swept(lanes(size), GRIDS[0])
    print(json.dumps({"peak_mb": machine.peak_memory_mb()}))


def processes(plan: Plan) -> dict[str, Any]:
    """One process, two of them, and two devices of one."""
    values = lanes(plan.lanes)
    alone, pair = _alone_and_paired(values, GRIDS[0], plan)
    told = machine.told("devices", plan.lanes, plan.rounds, XLA_FLAGS=_two_devices())
    right = alone[0].values["dissipation"]
    one_s = _run_s(alone)
    rows = [{"what": "1 process", "run_s": one_s, "lanes_per_s": plan.lanes / one_s}]
    for what, seconds, found in (
        ("2 processes", _run_s(pair), pair[0].values["dissipation"]),
        ("2 devices", told["run_s"], np.array(told["dissipation"])),
    ):
        rows.append(
            {
                "what": what,
                "run_s": seconds,
                "lanes_per_s": plan.lanes / seconds,
                "times_faster": one_s / seconds,
                "largest_difference": float(np.nanmax(np.abs(found / right - 1.0))),
            }
        )
    rows[0]["whole_s"] = float(np.median([each.wall_s for each in alone]))
    rows[1]["whole_s"] = float(np.median([each.wall_s for each in pair]))
    one, two = (plan.lanes / _run_s(sweeps) for sweeps in _alone_and_paired(values, GRIDS[1], plan))
    return {
        "lanes": plan.lanes,
        "steps": 1,
        "run_s_is": "without starting and compiling",
        "rows": rows,
        "finer_grid": {"lanes_per_s": one, "lanes_per_s_of_2_processes": two},
    }


def _alone_and_paired(
    values: dict[str, np.ndarray], change: dict[str, Any], plan: Plan
) -> tuple[list[jb.Sweep], list[jb.Sweep]]:
    """Sweeps in one process and in two, by turns."""
    swept(values, change)
    alone, pair = [], []
    for _ in tqdm(range(min(plan.rounds, STARTS)), disable=None, unit="round", desc="processes"):
        alone.append(swept(values, change, processes=1))
        pair.append(swept(values, change, processes=2))
    return alone, pair


def _run_s(sweeps: list[jb.Sweep]) -> float:
    return float(np.median([each.wall_s - each.compile_s for each in sweeps]))


def _two_devices() -> str:
    return f"{machine.GIVEN_FLAGS} {TWO_DEVICES}".strip()


def devices(size: int, rounds: int) -> None:
    """Print a sweep's answers and seconds, on all devices that this process has."""
    values = lanes(size)
    swept(values, GRIDS[0])
    warm = [swept(values, GRIDS[0]) for _ in range(rounds)]
    answer = {
        "devices": jax.local_device_count(),
        "run_s": _run_s(warm),
        "dissipation": warm[0].values["dissipation"].tolist(),
    }
    print(json.dumps(answer))


def unsettled(plan: Plan) -> dict[str, Any]:
    """Number of lanes of a wide field that do not converge in the batch, and at the end."""
    values = lanes(plan.unsettled, WIDE)
    hardness = values["load.amplitude"] / values["strip.height_ratio"]
    order = np.argsort(hardness, kind="stable")
    answer = jb.response(scene(), OVER)
    each = functools.partial(lax.map, lambda lane: answer(*lane)["status"], batch_size=CHUNK)
    status = np.asarray(jax.jit(each)(tuple(jnp.asarray(values[key][order]) for key in OVER)))
    found = swept(values, {})
    return {
        "lanes": plan.unsettled,
        "ranges": {key: list(pair) for key, pair in WIDE.items()},
        "not_converged_in_the_batch": _counts(status),
        "not_converged_at_the_end": _counts(found.status),
        **errors(values, found.values["dissipation"], plan.unsettled_sample, {}),
    }


def _counts(status: np.ndarray) -> dict[str, int]:
    """Lanes by outcome, but for those that converged."""
    codes, counts = np.unique(status[status != Outcome.CONVERGED], return_counts=True)
    named = {Outcome(int(code)).name: int(n) for code, n in zip(codes, counts, strict=True)}
    return {"lanes": int(counts.sum()), **named}

"""The strip that is timed, its truth, and how it is timed."""

import statistics
import time
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
from tqdm import tqdm

import jbeamshell as jb
from calibration.tables import energies

ETA, AMPLITUDE = 0.1126, 0.7855

OVER = ("strip.height_ratio", "load.amplitude")
STANDARD = {
    "strip.height_ratio": ETA,
    "load.amplitude": AMPLITUDE,
    "load.cycles": 1,
    "load.steps_per_half_cycle": 1,
    "contact.normal": "held",
    "model.kinematics": "linear",
    "model.nodes": 41,
}
FINE = {"model.nodes": 321, "load.steps_per_half_cycle": 40}
END_SIZE, FINE_END_SIZE = 1.0 / 36.0, 1.0 / 3.0  # smallest elements before scaling, over H
MOST, SPELL = 200, 0.1  # calls and seconds of a spell
ROUNDS = 7  # in each of which every variant is timed

Call = Callable[[], Any]


# --- the strip and its truth ----------------------------------------------------------------------


def scene(values: Mapping[str, Any] | None = None, end_size: float = END_SIZE) -> jb.Scene:
    """The standard strip in load steps on the grid that is timed, with what differs."""
    own = STANDARD | dict(values or {})
    found = jb.library.standard().replace(own)
    return found.on_grid(own["model.nodes"], end_size).by_load_steps()


def truth() -> float:
    """Dissipation of the standard strip by fine finite elements."""
    return energies()[ETA, AMPLITUDE]["D"]


# --- timing ---------------------------------------------------------------------------------------


def seconds_of(call: Call) -> float:
    """Seconds of one call, to the end of its work."""
    begin = time.perf_counter()
    jax.block_until_ready(call())
    return time.perf_counter() - begin


def spell(call: Call, seconds: float = SPELL) -> list[float]:
    """Seconds of every call, called again and again for so long, at least once."""
    found: list[float] = []
    end = time.perf_counter() + seconds
    while not found or (time.perf_counter() < end and len(found) < MOST):
        found.append(seconds_of(call))
    return found


def interleaved(calls: Mapping[str, Call], rounds: int, name: str) -> dict[str, list[float]]:
    """Seconds of the calls, all of them in every round."""
    found: dict[str, list[float]] = {key: [] for key in calls}
    for _ in tqdm(range(rounds), disable=None, unit="round", desc=name):
        for key, call in calls.items():
            found[key] += spell(call)
    return found


def summary(seconds: list[float]) -> dict[str, Any]:
    """Seconds of repeated calls."""
    return {
        "median_us": 1e6 * statistics.median(seconds),
        "best_us": 1e6 * min(seconds),
        "calls": len(seconds),
    }


def compiled(function: Callable, *given: Any) -> tuple[Any, float]:
    """A function compiled for arguments like these, and the seconds that took."""
    begin = time.perf_counter()
    program = jax.jit(function).lower(*given).compile()
    return program, time.perf_counter() - begin


def numbers(values: jb.Scene, keys: tuple[str, ...] = OVER) -> tuple[jax.Array, ...]:
    """A scene's numbers behind keys, on the device."""
    return tuple(jnp.asarray(values.get(key)) for key in keys)

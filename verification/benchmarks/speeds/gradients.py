"""Cost of gradients beside a run."""

from typing import Any

import jax
import jax.numpy as jnp

import jbeamshell as jb

from .common import ROUNDS, compiled, interleaved, numbers, scene, seconds_of, summary

KEYS = ("contact.friction", "strip.height_ratio", "strip.kappa_s", "strip.axial_stiffness")
STEPS = "load.steps_per_half_cycle"
OFF = 1.05  # times the parameters, with which the loop to be met is made


def gradient(rounds: int = ROUNDS) -> dict[str, Any]:
    """Gradients of a loop's misfit in four parameters."""
    start = jnp.ones(len(KEYS))
    ways = {"run": lambda f: f, "forward": jax.jacfwd, "reverse": jax.grad}
    built = {name: compiled(way(misfit(4)), start) for name, way in ways.items()}
    calls = {name: lambda f=program: f(start) for name, (program, _) in built.items()}
    for call in calls.values():
        seconds_of(call)
    seconds = interleaved(calls, rounds, "gradient")
    found = {name: summary(own) for name, own in seconds.items()}
    rows = [
        {"what": name, "compile_s": built[name][1]}
        | found[name]
        | {
            f"{key}_runs": found[name][f"{key}_us"] / found["run"][f"{key}_us"]
            for key in ("median", "best")
        }
        for name in ways
    ]
    forward, reverse = (calls[name]() for name in ("forward", "reverse"))
    return {
        "parameters": list(KEYS),
        "steps": 4,
        "nodes": scene().plan.nodes,
        "rows": rows,
        "forward_to_reverse": float(jnp.max(jnp.abs(forward / reverse - 1.0))),
    }


def misfit(steps: int) -> Any:
    """Mean square of a loop's distance from another, over its size; of factors (4,)."""
    here = scene({STEPS: steps})
    loop = jb.response(here, KEYS, ("displacement",))
    nominal = jnp.stack(numbers(here, KEYS))
    target = loop(*(OFF * nominal))["displacement"]
    size = jnp.mean(target**2)

    def function(factors: jax.Array) -> jax.Array:
        return jnp.mean((loop(*(factors * nominal))["displacement"] - target) ** 2) / size

    return function

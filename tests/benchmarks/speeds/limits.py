"""Floating-point operations of a run beside what the core could do in its time."""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jbeamshell as jb
from jbeamshell.equilibrium import Drive, System
from jbeamshell.stiffness import matrix, stiffness_at_rest, unknowns_at_rest

from . import machine
from .common import (
    OVER,
    Plan,
    compiled,
    interleaved,
    lanes,
    numbers,
    scene,
    seconds_of,
    summary,
    swept,
)
from .single import STEPS, dissipation_call


def limit(plan: Plan) -> dict[str, Any]:
    """Floating-point operations of a run over what the core could do in its time.

    Counted are block solves, by formula, and residuals and tangents, by the compiler's own count;
    setting up the grid and the constant stiffness are not, though their time is in.
    """
    peak = machine.peak_gflops()
    values = lanes(plan.lanes)
    rows = []
    for steps in (1, 4):
        here = scene({STEPS: steps})
        count = jax.jit(jax.vmap(functools.partial(_iterations, here)))
        single = int(count(*(jnp.asarray([number]) for number in numbers(here)))[0])
        batched = float(np.mean(count(*(jnp.asarray(values[key][: plan.sample]) for key in OVER))))
        solve, residual, tangent = operations(here)
        walked = len(here.load.unit_path()) + here.load.pressure_steps
        call = dissipation_call({STEPS: steps})
        seconds_of(call)
        us = summary(interleaved({"one": call}, plan, "limit")["one"])["median_us"]
        swept(values, {STEPS: steps})
        lane_us = 1e6 * seconds_of(lambda s=steps: swept(values, {STEPS: s}).values) / plan.lanes
        for what, iterations, time_us in (("single", single, us), ("batched", batched, lane_us)):
            counted = iterations * (solve + residual + tangent) + 2 * walked * residual
            gflops = 1e-3 * counted / time_us
            rows.append(
                {
                    "what": what,
                    "steps": steps,
                    "iterations": iterations,
                    "operations": counted,
                    "of_solves": iterations * solve / counted,
                    "us": time_us,
                    "gflops": gflops,
                    "of_peak": gflops / peak,
                }
            )
    return {"peak_gflops": peak, "peak_by": "numpy dgemm, 1 thread", "rows": rows}


def _iterations(here: jb.Scene, *given: jax.Array) -> jax.Array:
    own = here.replace(dict(zip(OVER, given, strict=True)))
    return jnp.sum(jb.solve(own, throw=False).iterations)


def operations(here: jb.Scene) -> tuple[int, float, float]:
    """Of one block solve, one residual, one tangent."""
    system = System(here)
    zero = jnp.zeros(())
    drive = Drive(zero, zero + 1.0, zero, zero + 1.0)
    change, before = unknowns_at_rest(system), system.rest()
    stiffness = stiffness_at_rest(system, 1.0)
    seen = system.advance(change, before, drive)[2]
    advance = compiled(lambda s, *given: s.advance(*given), system, change, before, drive)[0]
    tangent = compiled(matrix, system, stiffness, seen, before, drive)[0]
    return (
        solve_operations(here.model.nodes, len(system.model.active)),
        *(float(program.cost_analysis()["flops"]) for program in (advance, tangent)),
    )


def solve_operations(count: int, m: int) -> int:
    """Of block elimination and substitution with m x m blocks inverted by cofactors, m = 3."""
    dot = 2 * m - 1
    seen = m * (m + 1) * dot
    pivot = m * m + m
    inverse = 3 * m * m + (dot + 1) + m * m
    times = (m + 1) * m * dot
    substitution = m * (dot + 1)
    return count * (seen + pivot + inverse + times + substitution)

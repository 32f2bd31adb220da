"""Floating-point operations of a run beside what the core could do in its time."""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jbeamshell as jb
from jbeamshell.quasistatic.system import Prescribed, System
from jbeamshell.quasistatic.tangent import zero_unknowns

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

GUESS = 60  # operations at a node for its rows, its reaction and its status


def limit(plan: Plan) -> dict[str, Any]:
    """Floating-point operations of a run over what the core could do in its time.

    Counted are block solves and what is done for each of them at the nodes, by formula, and a
    residual for every step of a single run, by the compiler's own count; setting up the grid and
    the constant stiffness are not, though their time is in.
    """
    peak = machine.peak_gflops()
    values = lanes(plan.lanes)
    rows = []
    for steps in (1, 4):
        here = scene({STEPS: steps})
        count = jax.jit(jax.vmap(functools.partial(_iterations, here)))
        single = int(count(*(jnp.asarray([number]) for number in numbers(here)))[0])
        batched = float(np.mean(count(*(jnp.asarray(values[key][: plan.sample]) for key in OVER))))
        walked = len(here.load.unit_path()) + here.load.pressure_steps
        call = dissipation_call({STEPS: steps})
        seconds_of(call)
        us = summary(interleaved({"one": call}, plan, "limit")["one"])["median_us"]
        swept(values, {STEPS: steps})
        lane_us = 1e6 * seconds_of(lambda s=steps: swept(values, {STEPS: s}).values) / plan.lanes
        for what, iterations, time_us in (("single", single, us), ("batched", batched, lane_us)):
            solve = solve_operations(here.model.nodes, 3, lanes=what == "batched")
            guesses = iterations * (solve + GUESS * here.model.nodes)
            # A batch is checked by the assembled stiffness, 17 operations a row.
            check = 3 * 17 * here.model.nodes if what == "batched" else residual(here)
            counted = guesses + walked * check
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


def residual(here: jb.Scene) -> float:
    """Operations of one residual."""
    system = System(here)
    zero = jnp.zeros(())
    prescribed = Prescribed(zero, zero + 1.0, zero, zero + 1.0)
    given = system, zero_unknowns(system), system.unloaded(), prescribed
    program = compiled(lambda s, *rest: s.advance(*rest), *given)[0]
    return float(program.cost_analysis()["flops"])


def solve_operations(count: int, m: int, *, lanes: bool) -> int:
    """Operations of block elimination: by cofactors in one strip, by quotients in lanes."""
    dot = 2 * m - 1
    seen = m * (m + 1) * dot
    pivot = m * m + m
    if lanes:
        rows = range(m)
        divided = sum(2 * k * (2 * m - k) + 2 * m - k for k in rows)
        divided += sum(2 * k * (m + 1) for k in rows)
    else:
        divided = 3 * m * m + (dot + 1) + m * m + (m + 1) * m * dot
    substitution = m * (dot + 1)
    return count * (seen + pivot + divided + substitution)

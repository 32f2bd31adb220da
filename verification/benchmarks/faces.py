"""Time of a loop of a contact on a face, over its pairs, beside CalculiX; seconds of the processor.

A block on a rigid base is pressed unevenly, pulled and turned, a cycle in 40 load steps for each
half, with the softness that CalculiX is given.  The time has the runs of half the load steps and of
a coarser mesh, by which the errors are estimated.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import jax
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from calibration.finite_elements import block
from calibration.finite_elements.bricks import (
    SOFTNESS,
    area,
    displacement_there,
    run,
    seconds_of_programs,
)
from jbeamshell.bodies.contact import solve_contact
from jbeamshell.bodies.substructure import Substructure
from jbeamshell.plotting.style import DATA, PALETTE, style

FACES = ((9, 4), (14, 9), (19, 19), (39, 19), (49, 39))  # bricks along and across the face
LAYERS = 3
BESIDE = 400  # pairs up to which CalculiX runs
CALLS = 3  # of which the quickest counts; of larger faces one
OPTIONS: dict[str, Any] = block.LOAD | {
    "steps_per_half_cycle": 40,
    "softness": SOFTNESS,
    "throw": False,
}


def row(counts: tuple[int, int]) -> dict[str, Any]:
    """Times of one face, and the differences to CalculiX."""
    made = block.block((*counts, LAYERS), (40.0, 20.0, 10.0))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        body = block.body_of(made, folder)
        begin = time.perf_counter()
        history = jax.block_until_ready(solve_contact(body, **OPTIONS))
        found: dict[str, Any] = {
            "pairs": body.places.shape[0],
            "first_s": time.perf_counter() - begin,
            "seconds": best(body),
            "iterations": int(np.sum(history.iterations)),
            "dissipation": float(history.dissipation),
            "estimate": float(history.dissipation_error),
        }
        if body.places.shape[0] <= BESIDE:
            found["calculix"] = beside(made, history, folder)
    return found


def best(body: Substructure) -> float:
    """Least time of the processor for a warm call."""
    seconds = []
    for _ in range(CALLS if body.places.shape[0] <= BESIDE else 1):
        begin = time.process_time()
        jax.block_until_ready(solve_contact(body, **OPTIONS))
        seconds.append(time.process_time() - begin)
    return min(seconds)


def beside(made: block.Block, history: Any, folder: Path) -> dict[str, float]:
    """Time of CalculiX, and its figures over ours."""
    begin = seconds_of_programs()
    text = run(block.contact_deck(made, np.asarray(history.force)[1:]), folder, "contact")
    seconds = seconds_of_programs() - begin
    start, _, stop = history.cycles[-1]
    cycle = slice(start, stop + 1)
    force, here = (np.asarray(a)[cycle] for a in (history.force, history.displacement))
    there = displacement_there(made.pull, "BLOCK", text)[cycle]
    return {
        "seconds": seconds,
        "dissipation_ratio": area(force, there) / area(force, here),
        "stiffness_ratio": np.ptp(here) / np.ptp(there),
    }


def measure() -> dict[str, Any]:
    """Times over the pairs, and the power of their growth."""
    rows = [row(counts) for counts in FACES]
    pairs, seconds = (np.array([r[key] for r in rows]) for key in ("pairs", "seconds"))
    power = np.diff(np.log(seconds)) / np.diff(np.log(pairs))
    return {"rows": rows, "powers": power.tolist()}


def draw(record: dict[str, Any]) -> Figure:
    """Draw the time of a loop over the pairs of its face, both logarithmic."""
    rows = record["rows"]
    with style():
        figure, axes = plt.subplots(figsize=(5.2, 3.8))
        for key, colour, words in (
            ("seconds", PALETTE[0], "warm call"),
            ("first_s", PALETTE[1], "first call"),
        ):
            values = [r[key] for r in rows]
            axes.plot([r["pairs"] for r in rows], values, "o-", color=colour, label=words)
        there = [(r["pairs"], r["calculix"]["seconds"]) for r in rows if "calculix" in r]
        axes.plot(*zip(*there, strict=True), "P", color=DATA, label="CalculiX")
        axes.set(xscale="log", yscale="log")
        axes.set_xlabel("pairs of nodes")
        axes.set_ylabel("processor time of a loop  [s]")
        axes.legend()
    return figure

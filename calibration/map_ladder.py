"""Errors and costs of every rung of the ladder: the map behind `jbeamshell.advise`.

Runs every rung, on its grids and load paths, on the strips of data/random_strips.csv, whose
dissipation and secant stiffness finite elements have computed, and writes the ratios of its answers
to theirs, with the time of a single warm run, to ladder_map.json beside this file and, for the set
that `advise` uses, to the package.  Takes half an hour on one core:

    python calibration/map_ladder.py [RUNG@NODESxSTEPS ...] [--times]

Given names are measured anew, and no others; --times measures none anew.  Times are always those
of all.
"""

import csv
import json
import sys
import time
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

import equinox as eqx  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
from provenance import provenance  # noqa: E402
from tqdm import tqdm  # noqa: E402

import jbeamshell as jb  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.ladder.candidates import CANDIDATES, Candidate  # noqa: E402

HERE = Path(__file__).parent
RECORD = HERE / "ladder_map.json"
SHIPPED = HERE.parent / "jbeamshell" / "advice" / "measured.json"
NUMBERS = ("eta", "A", "mu", "nu")
QUANTITIES = ("dissipation", "secant_stiffness")
TINY = 1e-12  # a strip so thick that nothing slips in the finite elements
WIDEST = (1e-3, 1e3)  # of a ratio; beyond, it is wrong and that is that
STIFFNESS = 1e4  # E' 2H, by which the table has D and u multiplied; any will do where all is linear
LANES = 16  # solved at once
COARSEST = (41, 4)
REPEATS = 15
# eta and A of the strips that are timed
STANDARD = ((0.0511, 1.0), (0.1126, 0.7855), (0.2358, 1.0))


def strips() -> dict[str, np.ndarray]:
    """Columns of the table of strips, with the secant stiffness from the displacement."""
    with (HERE / "data" / "random_strips.csv").open(encoding="utf-8") as table:
        rows = list(csv.DictReader(table))
    columns = {key: np.array([float(row[key]) for row in rows]) for key in (*NUMBERS, "D", "u")}
    columns["set"] = np.array([row["set"] for row in rows])
    return columns


def scene_of(candidate: Candidate, eta, amplitude, mu, nu) -> jb.Scene:
    """Strip with mu F_N = 1, as in the table."""
    return jb.Scene().replace(
        {
            "strip.axial_stiffness": STIFFNESS,
            "strip.height_ratio": eta,
            "strip.poisson_ratio": nu,
            "contact.friction": mu,
            "contact.pressure": 1.0 / mu,
            "load.amplitude": amplitude,
            "model.kinematics": "linear",
            **candidate.settings,
        }
    )


def answers(candidate: Candidate, points: np.ndarray) -> np.ndarray:
    """Dissipation and secant stiffness of (n, 4) strips, (n, 2), in the table's units."""

    @eqx.filter_jit
    def many(points):
        def one(point):
            history = jb.solve(scene_of(candidate, *point), throw=False)
            return jnp.stack(
                [history.dissipation * STIFFNESS, history.secant_stiffness / STIFFNESS]
            )

        return jax.vmap(one)(points)

    padded = np.concatenate([points, np.repeat(points[-1:], -len(points) % LANES, axis=0)])
    found = np.concatenate([many(chunk) for chunk in np.split(padded, len(padded) // LANES)])
    found = found[: len(points)]
    for lane in np.flatnonzero(~np.isfinite(found).all(axis=1)):  # alone, a failed step is mended
        history = jb.solve(scene_of(candidate, *points[lane]))
        found[lane] = history.dissipation * STIFFNESS, history.secant_stiffness / STIFFNESS
    return found


def milliseconds(candidate: Candidate, kinematics: str) -> float:
    """Median over strips of the fastest of some warm runs that return a whole History."""
    times = []
    for eta, amplitude in STANDARD:
        scene = scene_of(candidate, eta, amplitude, 0.1, 0.3)
        scene = scene.replace({"model.kinematics": kinematics})
        jax.block_until_ready(jb.solve(scene))
        own = []
        for _ in range(REPEATS):
            begin = time.perf_counter()
            jax.block_until_ready(jb.solve(scene))
            own.append(time.perf_counter() - begin)
        times.append(min(own))  # what others do on the machine only ever adds
    return round(1e3 * float(np.median(times)), 3)


def measure(candidate: Candidate, table: dict[str, np.ndarray]) -> dict:
    """Ratios of a candidate's figures to those of finite elements, and its time."""
    points = np.stack([table[key] for key in NUMBERS], axis=1)
    found = answers(candidate, points)
    truth = np.stack([table["D"], table["A"] / table["u"]], axis=1)
    ratios = np.clip(found / np.maximum(truth, TINY), *WIDEST)
    rounded = [[float(f"{r:.5g}") for r in column] for column in ratios.T]
    return dict(zip(QUANTITIES, rounded, strict=True))


def ship(record: dict, table: dict[str, np.ndarray]) -> None:
    """Write the table that `advise` uses: the strips of the map alone."""
    own = table["set"] == "map"
    ratios = {
        name: {quantity: np.array(values)[own].tolist() for quantity, values in found.items()}
        for name, found in record["ratios"].items()
    }
    strips = {key: table[key][own].tolist() for key in NUMBERS}
    write_text(SHIPPED, json.dumps(record | {"strips": strips, "ratios": ratios}) + "\n")


def main() -> None:
    """Measure, write the record after every candidate, and write the table of `advise`."""
    table, chosen = strips(), [name for name in sys.argv[1:] if name != "--times"]
    record = json.loads(RECORD.read_text()) if RECORD.exists() else {"ratios": {}}
    record["provenance"] = provenance()
    if "--times" not in sys.argv:
        for name in tqdm(chosen or list(CANDIDATES), disable=None, unit="candidate"):
            record["ratios"][name] = measure(CANDIDATES[name], table)
            write_text(RECORD, json.dumps(record) + "\n")
    record["linear_ms"] = {
        name: milliseconds(candidate, "linear")
        for name, candidate in tqdm(CANDIDATES.items(), desc="linear", disable=None)
    }
    # Exact kinematics cost a rung the same factor on all its grids, near enough.
    record["exact_over_linear"] = {
        c.rung: milliseconds(c, "exact") / record["linear_ms"][c.name]
        for c in tqdm(CANDIDATES.values(), desc="exact", disable=None)
        if (c.nodes, c.steps) == COARSEST
    }
    write_text(RECORD, json.dumps(record) + "\n")
    ship(record, table)


if __name__ == "__main__":
    main()

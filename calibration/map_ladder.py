"""Errors and costs of every rung of the ladder: the map behind `jbeamshell.advise`.

Runs every rung, on its grids and load paths, on the strips of data/random_strips.csv, whose
dissipation and secant stiffness finite elements have computed, and writes the ratios of its answers
to theirs, with the time of a single warm run, to ladder_map.json beside this file and, for the set
that `advise` uses, to the package.  Where so little slips that the finite elements do not resolve
it, refined plane elasticity is the reference.  Takes half an hour on one core:

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

import numpy as np  # noqa: E402
from provenance import provenance  # noqa: E402
from strip import in_load_steps  # noqa: E402
from tqdm import tqdm  # noqa: E402

import jbeamshell as jb  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.ladder.candidates import CANDIDATES, Candidate  # noqa: E402

HERE = Path(__file__).parent
RECORD = HERE / "ladder_map.json"
SHIPPED = HERE.parent / "jbeamshell" / "ladder" / "measured.json"
NUMBERS = ("eta", "A", "mu", "nu")
KEYS = (
    "strip.height_ratio",
    "strip.poisson_ratio",
    "contact.friction",
    "contact.pressure",
    "load.amplitude",
)
QUANTITIES = ("dissipation", "secant_stiffness")
DOUBT = "dissipation_error"  # by which a run doubts itself
DOUBTS = (1e-4, 10.0)  # range within which it matters
# Below these the elements of the table, 4e-4 to 1e-3 H at the corner, see too little slip: part of
# the bar's dissipation, and A over mu F_N L/2, which is the slip zone over half the length.
UNSEEN, SHORT = 0.3, 0.3
NOTHING = 1e-6  # of the bar's dissipation, which counts as none
WIDEST = (1e-3, 1e3)  # of a ratio; beyond, it is wrong and that is that
STIFFNESS = 1e4  # E' 2H, by which the table has D and u multiplied; any will do where all is linear
REFINED = Candidate("plane", 257, 4)
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


def scene_of(candidate: Candidate, eta=0.1, amplitude=1.0, mu=0.1, nu=0.3) -> jb.Scene:
    """Strip with mu F_N = 1, as in the table."""
    return in_load_steps().replace(
        {
            "strip.axial_stiffness": STIFFNESS,
            "model.kinematics": "linear",
            **candidate.settings,
            **dict(zip(KEYS, (eta, nu, mu, 1.0 / mu, amplitude), strict=True)),
        }
    )


def answers(candidate: Candidate, points: np.ndarray) -> np.ndarray:
    """Dissipation, secant stiffness and doubt of (n, 4) strips, (n, 3), in the table's units."""
    names = (*QUANTITIES, DOUBT)
    ask = jb.response(scene_of(candidate), KEYS, names)
    found = np.empty((len(points), 3))
    for own, (eta, amplitude, mu, nu) in zip(found, points, strict=True):
        figures = ask(eta, nu, mu, 1.0 / mu, amplitude)
        if int(figures["status"]) != 0:  # alone, a failed step is mended
            figures = vars_of(jb.solve(scene_of(candidate, eta, amplitude, mu, nu)), names)
        own[:] = [figures[name] for name in names]
    return found * [STIFFNESS, 1.0 / STIFFNESS, 1.0]


def vars_of(history: jb.History, names: tuple[str, ...]) -> dict[str, float]:
    """Figures of a history by name."""
    return {name: float(getattr(history, name)) for name in names}


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


def bars(table: dict[str, np.ndarray]) -> np.ndarray:
    """Dissipation of Goodman's bar."""
    return 2.0 / 3.0 * table["A"] ** 3


def reference(table: dict[str, np.ndarray]) -> np.ndarray:
    """Dissipation by finite elements, or by refined plane elasticity where they see no slip."""
    unseen = (table["D"] < UNSEEN * bars(table)) | (table["A"] < SHORT)
    points = np.stack([table[key] for key in NUMBERS], axis=1)
    found = table["D"].copy()
    found[unseen] = answers(REFINED, points[unseen])[:, 0]
    return found


def measure(
    candidate: Candidate, table: dict[str, np.ndarray], truth: np.ndarray
) -> tuple[dict[str, list[float]], list[float]]:
    """Ratios of a candidate's figures to the reference, and its doubts on the map's strips."""
    points = np.stack([table[key] for key in NUMBERS], axis=1)
    work, stiffness, doubt = answers(candidate, points).T
    nothing = NOTHING * bars(table)
    ratios = (work + nothing) / (truth + nothing), stiffness * table["u"] / table["A"]
    own = dict(zip(QUANTITIES, (rounded(np.clip(r, *WIDEST), 5) for r in ratios), strict=True))
    return own, rounded(np.clip(doubt, *DOUBTS)[table["set"] == "map"], 2)


def rounded(values: np.ndarray, digits: int) -> list[float]:
    """Values with so many digits."""
    return [float(f"{value:.{digits}g}") for value in values]


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
    record = json.loads(RECORD.read_text()) if RECORD.exists() else {"ratios": {}, "doubts": {}}
    record["provenance"] = provenance()
    if "reference" not in record:
        record["reference"] = reference(table).tolist()
    if "--times" not in sys.argv:
        for name in tqdm(chosen or list(CANDIDATES), disable=None, unit="candidate"):
            truth = np.array(record["reference"])
            record["ratios"][name], record["doubts"][name] = measure(CANDIDATES[name], table, truth)
            write_text(RECORD, json.dumps(record) + "\n")
    record["linear_ms"] = {
        name: milliseconds(candidate, "linear")
        for name, candidate in tqdm(CANDIDATES.items(), desc="linear", disable=None)
    }
    # Exact kinematics cost a rung the same factor on all its grids, near enough.
    stepwise = [c for c in CANDIDATES.values() if not c.on_contact_line]
    coarsest = {c.rung: c for c in reversed(stepwise)}
    record["exact_over_linear"] = {
        rung: milliseconds(c, "exact") / record["linear_ms"][c.name]
        for rung, c in tqdm(coarsest.items(), desc="exact", disable=None)
    }
    write_text(RECORD, json.dumps(record) + "\n")
    ship(record, table)


if __name__ == "__main__":
    main()

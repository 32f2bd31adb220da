"""Dissipation of sections of order p over that of finite elements, on sixteen standard strips.

The figures are compared with those of an independent prototype of the same sections (linear
kinematics, end element H/12, 40 load steps per half cycle, second cycle). Writes ladder_table.json
beside this file; two minutes:

    python calibration/ladder_table.py
"""

import csv
import json
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

import equinox as eqx  # noqa: E402
import numpy as np  # noqa: E402
from provenance import provenance  # noqa: E402
from strip import in_load_steps  # noqa: E402
from tqdm import tqdm  # noqa: E402

import jbeamshell as jb  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402

HERE = Path(__file__).parent
HEIGHTS, AMPLITUDES = (0.0511, 0.1126, 0.2358, 0.4), (0.3247, 0.5851, 1.0, 1.6)
PROTOTYPE = {  # cells in the order of heights, then of amplitudes
    1: [
        *(1.061, 1.016, 1.005, 1.001, 1.78, 1.11, 1.03, 1.01),
        *(17, 2.4, 1.21, 1.06, 139, 15, 2.5, 1.3),
    ],
    2: [
        *(1.005, 1.0, 1.0, 0.999, 1.28, 1.014, 1.002, 1.0),
        *(7.9, 1.58, 1.034, 1.005, 55, 6.8, 1.61, 1.055),
    ],
    3: [
        *(0.997, 1.0, 1.0, 0.999, 1.07, 1.002, 1.0, 0.999),
        *(5.1, 1.19, 1.009, 1.001, 36, 4.2, 1.2, 1.014),
    ],
    4: [
        *(0.997, 1.0, 1.0, 0.999, 1.015, 1.0, 0.999, 0.999),
        *(3.6, 1.06, 1.002, 0.999, 21, 2.9, 1.065, 1.003),
    ],
    6: [
        *(0.998, 1.0, 1.0, 0.999, 1.003, 1.0, 0.999, 0.999),
        *(2.0, 1.011, 0.998, 0.999, 18, 1.7, 1.015, 0.999),
    ],
}
COUNTS = 0.1  # of the cubic law: below, the corner rules and every mesh has its own answer


def truth() -> dict[tuple[float, float], float]:
    """Dissipation over the cubic law by finite elements, by eta and A."""
    with (HERE / "data" / "energy.csv").open(encoding="utf-8") as table:
        return {(float(r["eta"]), float(r["A"])): float(r["ratio"]) for r in csv.DictReader(table)}


def ratios(order: int) -> np.ndarray:
    """Dissipation over the cubic law on all cells, (16,)."""
    section = {"model.section": f"p{order}", "model.kinematics": "linear"}
    scene = in_load_steps().replace(section).on_grid(81, 1.0 / 12.0)

    @eqx.filter_jit
    def one(eta, amplitude):
        cell = {"strip.height_ratio": eta, "load.amplitude": amplitude}
        return jb.solve(scene.replace(cell)).dissipation_ratio

    return np.array([float(one(*np.array([eta, a]))) for eta in HEIGHTS for a in AMPLITUDES])


def main() -> None:
    """Measure, compare, and write the record."""
    known = truth()
    fe = np.array([known[eta, a] for eta in HEIGHTS for a in AMPLITUDES])
    counts = fe >= COUNTS - 1e-3
    record = {"provenance": provenance(), "cells": [(e, a) for e in HEIGHTS for a in AMPLITUDES]}
    record["finite_elements"] = fe.tolist()
    for order, prototype in tqdm(PROTOTYPE.items(), disable=None):
        found = ratios(order) / fe
        off = np.abs(found / prototype - 1.0)[counts]
        record[f"p{order}"] = {
            "over_finite_elements": [float(f"{r:.5g}") for r in found],
            "off_prototype_where_it_counts": float(f"{off.max():.3g}"),
        }
        print(f"p{order}: off the prototype by {100.0 * off.max():.2g} % at most")
    write_text(HERE / "ladder_table.json", json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()

"""Plain calls beside finite elements: how far off `jb.solve(scene)` is, and whether it says so.

    python -m calibration.plain_call

solves every scene of the finite elements in calibration/data (strips under every entry of the
force, and lap joints) without a single setting.  It writes plain_call.json beside this file: of
each scene the section and the nodes that were taken, how far its dissipation and its secant
stiffness are off, in per cent, what it doubts, and the time of a warm call; and a summary.  Scenes
that lose less than a thousandth of the bar's cubic law are left out.
"""

from __future__ import annotations

import csv
import json
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402

import jbeamshell as jb  # noqa: E402
from calibration.provenance import provenance  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402

HERE = Path(__file__).parent
RECORD = Path(__file__).with_suffix(".json")
LEAST = 1e-3  # dissipation over the bar's
LIMITS = 1.2, 2.0  # per cent
Values = dict[str, Any]


def rows_of(name: str) -> list[dict[str, str]]:
    """Rows of a table of finite elements."""
    with (HERE / "data" / name).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def scenes() -> Iterator[tuple[str, jb.Scene, float, float | None]]:
    """Kind, scene, dissipation and secant stiffness (None where unknown) by finite elements."""
    for row in rows_of("energy.csv"):
        if float(row["ratio"]) > LEAST:
            values = {"strip.height_ratio": float(row["eta"]), "load.amplitude": float(row["A"])}
            yield "standard", jb.library.standard().replace(values), float(row["D"]), None
    for row in rows_of("entry.csv"):
        if float(row["overhang_over_H"]) in (0.0, 4.0) and float(row["D_over_bar"]) > LEAST:
            values = {
                "strip.height_ratio": float(row["eta"]),
                "contact.friction": float(row["mu"]),
                "load.amplitude": float(row["A"]),
                "load.entry": row["entry"],
            }
            stiffness = float(row["K_conjugate"] or "nan")
            yield row["entry"], jb.Scene().replace(values), float(row["D"]), stiffness
    for row in rows_of("lap_joints.csv"):
        height = float(row["H2"]) / float(row["H1"])
        values = {
            "strip.height_ratio": float(row["H1"]),
            "member.height_ratio": float(row["H2"]),
            "member.axial_stiffness": 3.4e4 * float(row["E2_over_E1"]) * height,
            "load.amplitude": float(row["A"]),
        }
        double = row["problem"] == "double-shear"
        joint = jb.library.double_shear().replace(values) if double else jb.library.single_lap()
        yield row["problem"], joint, float(row["D"]), float(row["K_sec"])


def solved(kind: str, scene: jb.Scene, work: float, stiffness: float | None) -> Values:
    """Row of the record."""
    history = jb.solve(scene, throw=False)
    begin = time.perf_counter()
    history = jb.solve(scene, throw=False)
    taken = time.perf_counter() - begin
    found = {"D_percent": 100.0 * (float(history.dissipation) / work - 1.0)}
    if stiffness is not None and np.isfinite(stiffness):
        found["K_percent"] = 100.0 * (float(history.secant_stiffness) / stiffness - 1.0)
    strip, load = scene.strip, scene.load
    place = {"eta": float(strip.height_ratio), "A": float(load.amplitude)}
    place["mu"] = float(scene.contact.friction)
    figures = {name: float(f"{value:.4g}") for name, value in (place | found).items()}
    section = {"section": history.scene.plan.section, "nodes": int(history.x.size)}
    return {"kind": kind} | section | figures | {"ms": 1e3 * taken, "doubts": list(history.doubts)}


def summary(rows: list[Values]) -> Values:
    """Parts of the scenes within the limits, and the worst that nothing doubts."""
    off = np.array([max(abs(row["D_percent"]), abs(row.get("K_percent", 0.0))) for row in rows])
    doubted = np.array([bool(row["doubts"]) for row in rows])
    return {
        "scenes": len(rows),
        "within_percent": {str(limit): float(np.mean(off <= limit)) for limit in LIMITS},
        "worst_undoubted_percent": float(np.max(off[~doubted], initial=0.0)),
        "doubted": float(np.mean(doubted)),
        "doubted_though_within_1_percent": float(np.mean(doubted & (off <= 1.0))),
        "elasticity": float(np.mean([row["section"] == "plane" for row in rows])),
    }


def main() -> None:
    """Solve, print and record."""
    jb.configure()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", jb.DoubtfulWarning)
        rows = [solved(*scene) for scene in scenes()]
    kinds = sorted({row["kind"] for row in rows})
    parts = {kind: summary([row for row in rows if row["kind"] == kind]) for kind in kinds}
    found = {"about": provenance(), "all": summary(rows), "kinds": parts, "rows": rows}
    write_text(RECORD, json.dumps(found, indent=1) + "\n")
    print(json.dumps({"all": found["all"]} | parts, indent=1))


if __name__ == "__main__":
    main()

"""Plain calls beside finite elements: how far off `jb.solve(scene)` is, and whether it says so.

Solves every scene of the finite elements in calibration/data (strips under every entry of the
force, and lap joints) without a single setting.  Of each scene the record has the section and the
nodes that were taken, how far its dissipation and its secant stiffness are off, in per cent, what
it doubts, and the time of a warm call; and a summary.  Scenes
that lose less than a thousandth of the bar's cubic law are left out.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np

import jbeamshell as jb
from calibration.running import as_text
from calibration.tables import rows

LEAST = 1e-3  # dissipation over the bar's
LIMITS = 1.2, 2.0  # per cent
Values = dict[str, Any]


def scenes() -> Iterator[tuple[str, jb.Scene, float, float | None]]:
    """Kind, scene, dissipation and secant stiffness (None where unknown) by finite elements."""
    for row in rows("energy.csv"):
        if row["ratio"] > LEAST:
            values = {"strip.height_ratio": row["eta"], "load.amplitude": row["A"]}
            yield "standard", jb.library.standard().replace(values), row["D"], None
    for row in rows("entry.csv"):
        if row["overhang_over_H"] in (0.0, 4.0) and row["D_over_bar"] > LEAST:
            values = {
                "strip.height_ratio": row["eta"],
                "contact.friction": row["mu"],
                "load.amplitude": row["A"],
                "load.entry": row["entry"],
            }
            yield row["entry"], jb.Scene().replace(values), row["D"], row["K_conjugate"]
    for row in rows("lap_joints.csv"):
        height = row["H2"] / row["H1"]
        values = {
            "strip.height_ratio": row["H1"],
            "member.height_ratio": row["H2"],
            "member.axial_stiffness": 3.4e4 * row["E2_over_E1"] * height,
            "load.amplitude": row["A"],
        }
        double = row["problem"] == "double-shear"
        joint = jb.library.double_shear().replace(values) if double else jb.library.single_lap()
        yield row["problem"], joint, row["D"], row["K_sec"]


def solved(kind: str, scene: jb.Scene, work: float, stiffness: float | None) -> Values:
    """Row of the record."""
    history = jb.solve(scene, throw=False)
    begin = time.perf_counter()
    history = jb.solve(scene, throw=False)
    taken = time.perf_counter() - begin
    found = {"D_percent": 100.0 * (float(history.dissipation) / work - 1.0)}
    if stiffness is not None:
        found["K_percent"] = 100.0 * (float(history.secant_stiffness) / stiffness - 1.0)
    strip, load = scene.strip, scene.load
    place = {"eta": float(strip.height_ratio), "A": float(load.amplitude)}
    place["mu"] = float(scene.contact.friction)
    figures = {name: float(f"{value:.4g}") for name, value in (place | found).items()}
    section = {"section": history.scene.plan.section, "nodes": int(history.x.size)}
    return {"kind": kind} | section | figures | {"ms": 1e3 * taken, "doubts": list(history.doubts)}


def summary(found: list[Values]) -> Values:
    """Parts of the scenes within the limits, and the worst that nothing doubts."""
    off = np.array([max(abs(row["D_percent"]), abs(row.get("K_percent", 0.0))) for row in found])
    doubted = np.array([bool(row["doubts"]) for row in found])
    return {
        "scenes": len(found),
        "within_percent": {str(limit): float(np.mean(off <= limit)) for limit in LIMITS},
        "worst_undoubted_percent": float(np.max(off[~doubted], initial=0.0)),
        "doubted": float(np.mean(doubted)),
        "doubted_though_within_1_percent": float(np.mean(doubted & (off <= 1.0))),
        "elasticity": float(np.mean([row["section"] == "plane" for row in found])),
    }


def measure() -> Values:
    """Solve all scenes."""
    found = [solved(*scene) for scene in scenes()]
    kinds = sorted({row["kind"] for row in found})
    parts = {kind: summary([row for row in found if row["kind"] == kind]) for kind in kinds}
    return {"all": summary(found), "kinds": parts, "rows": found}


def tell(record: Values) -> str:
    """Summaries of all and of each kind."""
    return as_text({"all": record["all"]} | record["kinds"])

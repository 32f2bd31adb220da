"""Plain calls of random scenes of every kind beside the same scenes on 257 nodes.

A plain call is wrong if its dissipation is off by more than 2 % from that on the fine grid, and
its failure is silent if it doubts nothing.  It doubts in vain where it doubts its accuracy and both
its dissipation and its stiffness are right.  Doubts about something else than the grid (linear
kinematics, a column that may buckle, a mount) are counted apart: a fine grid cannot tell whether
they are right.  Scenes that hardly slip count too, except those that lose less than a millionth of
Goodman's loss.
"""

from __future__ import annotations

import warnings
import zlib
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

import jbeamshell as jb
from calibration.running import as_text
from jbeamshell.mechanics.bar import bar_backbone

EACH, SEED = 167, 66
FINE = {"model.section": "plane", "model.nodes": 257}
FINE_CURVED = FINE | {"model.section": "squeeze"}  # plane elasticity knows no curved strips
WRONG = 0.02
LEAST = 1e-6  # of Goodman's loss, which is rounding
OF_GRID = "the dissipation may be off", "nothing slips", "the last loop does not close"
OF_OTHERS = "kinematics are linear"
ENTRIES = "traction", "face", "member", "guided"
AMPLITUDE, PRESSURE = "load.amplitude", "contact.pressure"
Random, Values = np.random.Generator, dict[str, Any]


def _log(random: Random, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def entries(random: Random) -> Values:
    """Homogeneous strip under any entry of the force, up to .97 of gross slip."""
    mu = _log(random, 0.05, 0.6)
    return {
        "load.entry": str(random.choice(ENTRIES)),
        "strip.height_ratio": _log(random, 0.01, 0.4),
        "strip.poisson_ratio": random.uniform(0.0, 0.45),
        "contact.friction": mu,
        AMPLITUDE: random.uniform(0.03, 0.97) * 20.0 * mu,
    }


def _patch(random: Random, begin: float, end: float) -> list[list[float]]:
    low, high = random.uniform(5.0, 20.0, 2)
    return [[begin, 0.0], [begin, low], [end, high], [end, 0.0]]


def _pressed(random: Random, rows: list[list[float]]) -> Values:
    """Strip under such rows of pressure, pulled by a part of its gross slip."""
    x, p = np.array(rows).T
    values = entries(random) | {PRESSURE: rows}
    gross = values["contact.friction"] * float(np.trapezoid(p, x))
    return values | {AMPLITUDE: random.uniform(0.05, 0.95) * gross}


def rows(random: Random) -> Values:
    """Pressure that falls or rises in two pieces over the whole strip."""
    at, ends = random.uniform(0.3, 1.7), random.uniform(2.0, 20.0, 3)
    return _pressed(random, [[0.0, ends[0]], [at, ends[1]], [2.0, ends[2]]])


def gap(random: Random) -> Values:
    """Pressure on two patches, or on one, and nothing beside them."""
    if random.uniform() < 0.5:
        begin, end = random.uniform(0.0, 0.8), random.uniform(1.0, 2.0)
        return _pressed(random, _patch(random, begin, end))
    first, second = random.uniform(0.3, 0.8), random.uniform(1.0, 1.6)
    return _pressed(random, _patch(random, 0.0, first) + _patch(random, second, 2.0))


def strip_bolts(random: Random) -> Values:
    """Strip on a rigid base under one to three bolts."""
    count = int(random.integers(1, 4))
    places = 2.0 * (np.arange(count) + 0.5) / count
    found = [
        [float(x), float(force), float(width)]
        for x, force, width in zip(
            places, random.uniform(5.0, 20.0, count), random.uniform(0.1, 0.5, count), strict=True
        )
    ]
    values = entries(random)
    gross = values["contact.friction"] * sum(force for _, force, _ in found)
    return values | {"contact.bolts": found, AMPLITUDE: random.uniform(0.05, 0.95) * gross}


def both_faces(random: Random) -> Values:
    """Pressures on both faces."""
    values = entries(random)
    begin, end = np.sort(random.uniform(0.0, 2.0, 2)).tolist()
    up = random.uniform(0.1, 0.6) * 10.0
    values["contact.bottom_pressure"] = [[begin, 0.0], [begin, up], [end, up], [end, 0.0]]
    values[AMPLITUDE] *= 1.0 - up * (end - begin) / 20.0
    return values


def laminate(random: Random) -> Values:
    """Two or three layers."""
    values = entries(random)
    height = 2.0 * values["strip.height_ratio"]
    share = random.dirichlet(np.full(random.integers(2, 4), 4.0))
    del values["strip.poisson_ratio"]
    return values | {
        "strip.layers": [
            [float(part * height), _log(random, 3e4, 1e6), random.uniform(0.0, 0.45)]
            for part in share
        ]
    }


def ends(random: Random) -> Values:
    """Pinned and free ends."""
    return entries(random) | {"strip.far_end": str(random.choice(["pinned", "free"]))}


def overhang(random: Random) -> Values:
    """Strip that goes on beyond its contact, loaded at the end of its overhang."""
    values = entries(random) | {"strip.overhang": random.uniform(0.1, 1.0)}
    return values | {"load.entry": str(random.choice(["traction", "face", "guided"]))}


def sliders(random: Random) -> Values:
    """Elastic sliders in place of rigid ones."""
    return entries(random) | {"contact.stick_stiffness": _log(random, 1.0, 1e3)}


def displaced(random: Random) -> Values:
    """Displacement control, up to two thirds of gross slip of a bar."""
    values = entries(random)
    force = values[AMPLITUDE] * 0.66
    u = float(bar_backbone(force, 3.4e4, 10.0 * values["contact.friction"]))
    return values | {"load.control": "displacement", AMPLITUDE: u}


def curved(random: Random) -> Values:
    """Strip curved before loading, so little that the pressure closes most of it."""
    values = entries(random)
    flat = 10.0 * 2.0**2 / (3.4e4 * values["strip.height_ratio"] ** 2)
    sign = random.choice([-1, 1])
    return values | {"strip.curvature": float(sign * flat * random.uniform(0.01, 0.5))}


def lap(random: Random) -> Values:
    """Lap joint of unequal members with two bolts."""
    values = entries(random)
    thinner, softer = np.exp(random.uniform(-0.7, 0.7, 2)).tolist()
    height = _log(random, 0.02, 0.2)
    widths, forces = random.uniform(0.2, 0.5, 2), random.uniform(5.0, 20.0, 2)
    places = [random.uniform(0.4, 0.8), random.uniform(1.2, 1.6)]
    bolts = [[x, float(f), float(b)] for x, f, b in zip(places, forces, widths, strict=True)]
    gross = values["contact.friction"] * float(np.sum(forces))
    values |= {
        "load.entry": str(random.choice(["traction", "face"])),
        "strip.height_ratio": height,
        "strip.far_end": "free",
        "member.support": str(random.choice(["rolling", "clamped"])),
        "member.height_ratio": thinner * height,
        "member.axial_stiffness": 3.4e4 * thinner * softer,
        "member.poisson_ratio": random.uniform(0.0, 0.45),
        "contact.bolts": bolts,
        AMPLITUDE: random.uniform(0.1, 0.9) * gross,
    }
    return values | (
        {"member.loaded_end": "level"} if values["member.support"] == "clamped" else {}
    )


def lap_extras(random: Random) -> Values:
    """Lap joint with one of: overhangs, shanks, bearings, an arm, a moment, a gap, friction."""
    values = lap(random)
    force, height = values[AMPLITUDE], values["strip.height_ratio"]
    extra = random.choice(["overhang", "shanks", "bearings", "arm", "moment", "gap", "assembly"])
    if extra == "overhang":
        spans = random.uniform(0.1, 1.0, 2).tolist()
        return values | {"strip.overhang": spans[0], "member.overhang": spans[1]}
    if extra == "shanks":
        return values | {"member.bolt_stiffness": _log(random, 1e2, 1e4)}
    if extra == "bearings":
        clearance = force / 3.4e4 * random.uniform(0.05, 1.0)
        stiffness = _log(random, 1e3, 1e5)
        return values | {"member.bearing_stiffness": stiffness, "member.clearance": clearance}
    if extra == "arm":
        return values | {"load.arm": height * random.uniform(-1.0, 1.0)}
    if extra == "moment":
        return values | {"load.kind": "moment", AMPLITUDE: force * height}
    if extra == "gap":
        wide = _log(random, 1e-6, 1e-4)
        return values | {"member.gap": [[0.0, wide], [1.0, 0.0], [2.0, wide]]}
    return values | {"member.assembly": "frictional"}


Kinds = dict[str, Callable[[Random], Values]]
KINDS: Kinds = {
    "entries": entries,
    "rows": rows,
    "gaps between pressures": gap,
    "bolts": strip_bolts,
    "both faces": both_faces,
    "laminates": laminate,
    "pinned and free ends": ends,
    "overhangs": overhang,
    "elastic sliders": sliders,
    "displacement control": displaced,
    "curved": curved,
    "lap joints": lap,
    "lap joints with extras": lap_extras,
}


def drawn(kind: str, number: int, seed: int = SEED) -> Values:
    """Values of one scene of a kind."""
    return KINDS[kind](np.random.default_rng([seed, zlib.crc32(kind.encode()), number]))


def row(kind: str, number: int, seed: int = SEED) -> Values:
    """Errors of a plain call, and what it doubts."""
    found: Values = {"number": number}
    try:
        scene = jb.Scene().replace(drawn(kind, number, seed))
        plain = jb.solve(scene, throw=False)
    except jb.InputError as refusal:
        return found | {"refused": str(refusal)}
    if not plain.converged:
        return found | {"failed": True}
    doubts = [doubt for doubt in plain.doubts if not _of_others(doubt)]
    found |= {"nodes": scene.plan.nodes, "stated": float(plain.dissipation_error)}
    found |= {"doubts": doubts, "others": len(plain.doubts) - len(doubts)}
    fine = FINE_CURVED if kind == "curved" else FINE
    truth = jb.solve(scene.replace(fine), throw=False)
    if not truth.converged:
        return found | {"failed": True}
    found["of_goodman"] = float(truth.dissipation_ratio)
    if found["of_goodman"] > LEAST:
        found["D"] = float(plain.dissipation) / float(truth.dissipation) - 1.0
    found["K"] = float(plain.secant_stiffness) / float(truth.secant_stiffness) - 1.0
    return found


def _of_others(doubt: str) -> bool:
    return OF_OTHERS in doubt or not doubt.startswith(OF_GRID)


def wrong(found: Values) -> bool:
    """True if a plain call's dissipation or stiffness is off by more than 2 %."""
    return max(abs(found.get("D", 0.0)), abs(found.get("K", 0.0))) > WRONG


def measured(kind: str, seed: int = SEED, each: int = EACH) -> Values:
    """Rows of random scenes of a kind, and how many are wrong and doubted."""
    found = []
    for number in range(each):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", jb.DoubtfulWarning)
            found.append(row(kind, number, seed))
        # Lap joints have programs of their own, and a process maps so many.
        often = 20 if kind.startswith("lap") else 100
        if number % often == often - 1:
            jax.clear_caches()
            print(f"{kind} {number + 1} of {each}", flush=True)
    return {"summary": summary(found), "rows": found}


def summary(found: list[Values]) -> Values:
    """Outcomes of the rows of a kind, with the errors in per cent."""
    solved = [row for row in found if "K" in row]
    names = {"D": [row["D"] for row in solved if "D" in row], "K": [row["K"] for row in solved]}
    told = [bool(row["doubts"]) for row in solved]
    off = [wrong(row) for row in solved]
    both = list(zip(off, told, strict=True))
    return {
        "scenes": len(solved),
        "refused": sum("refused" in row for row in found),
        "failed": sum("failed" in row for row in found),
        "wrong": sum(off),
        "wrong and not doubted": sum(o and not t for o, t in both),
        "doubted in vain": sum(t and not o for o, t in both),
        "other doubts": sum(row["others"] > 0 for row in solved),
    } | {
        f"{name}, {part} %": float(np.percentile(100.0 * np.abs(sizes), part))
        for name, sizes in names.items()
        for part in (50, 95, 100)
    }


PARTS = {kind: lambda kind=kind: measured(kind) for kind in KINDS}


def tell(record: Values) -> str:
    """Outcomes of each kind."""
    return as_text({kind: record[kind]["summary"] for kind in KINDS if kind in record})

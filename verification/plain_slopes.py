"""Slopes of plain calls beside smooth ones of a fine grid, strips and lap joints.

Random strips under all entries of the force and random lap joints with bolts are solved as a plain
call plans them, with their derivatives by automatic differentiation.  The truth is a cubic through
runs on a fine grid, a few per cent to both sides of each number.  Scenes that hardly slip are left
out of the summary, because their loss is that of a corner.

Two more parts: how much a slope jumps between even steps of one number, beside that of the polygon
of the events; and the losses of thick strips that hardly slip, where a grid is easily too coarse.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jbeamshell as jb
from calibration.running import as_text
from jbeamshell.contact_line.solve import strip_of
from verification import smooth_slopes

STRIPS, JOINTS, STEPS, THICK = 200, 40, 200, 300
FINE = {"strip": 257, "joint": 285}  # nodes of the truth
WIDTH, POINTS = 0.05, 5  # of a logarithm to both sides of a slope, and runs in it
SLIPS = 2e-3  # least loss over Goodman's
SEED = 8
DOUBTFUL = 0.02  # stated error, from which on a plain call is doubted
KEYS = ("load.amplitude", "contact.friction", "strip.height_ratio", "strip.poisson_ratio")
BOLTS = "contact.bolts"
ENTRIES = "traction", "face", "member", "guided"
FIGURES = "dissipation", "dissipation_error"
SPANS = {KEYS[0]: (0.8, 1.2), KEYS[1]: (0.09, 0.12), KEYS[2]: (0.09, 0.14)}  # of even steps
WRONG = 0.02  # error from which on a plain call is wrong
Record = dict[str, Any]


def strips(random: np.random.Generator) -> Iterator[dict[str, Any]]:
    """Random strips under all entries in turn."""
    number = 0
    while True:
        friction = float(np.exp(random.uniform(np.log(0.05), np.log(0.6))))
        yield {
            "load.entry": ENTRIES[number % 4],
            "strip.height_ratio": float(np.exp(random.uniform(np.log(0.02), np.log(0.4)))),
            "contact.friction": friction,
            "strip.poisson_ratio": random.uniform(0.05, 0.42),
            "load.amplitude": random.uniform(0.1, 0.9) * 20.0 * friction,
        }
        number += 1


def joints(random: np.random.Generator) -> Iterator[dict[str, Any]]:
    """Random lap joints of two bolts, in single and in double shear."""
    while True:
        friction = float(np.exp(random.uniform(np.log(0.05), np.log(0.6))))
        height = float(np.exp(random.uniform(np.log(0.03), np.log(0.2))))
        forces, widths = random.uniform(5.0, 20.0, 2), random.uniform(0.2, 0.5, 2)
        single = random.uniform() < 0.5
        rows = [[x, float(f), float(b)] for x, f, b in zip((0.6, 1.4), forces, widths, strict=True)]
        yield {
            "strip.height_ratio": height,
            "contact.friction": friction,
            "strip.poisson_ratio": random.uniform(0.05, 0.42),
            "strip.far_end": "free",
            "member.support": "clamped" if single else "rolling",
            "member.height_ratio": height,
            "load.entry": "traction",
            BOLTS: rows,
            "load.amplitude": random.uniform(0.1, 0.8) * friction * float(np.sum(forces)),
        } | ({"member.loaded_end": "level"} if single else {})


def _asked(kind: str) -> tuple[str, ...]:
    return KEYS if kind == "strip" else (*KEYS[:3], BOLTS)


def _values(scene: jb.Scene, keys: tuple[str, ...]) -> list[Any]:
    return [np.asarray(scene.get(key)) for key in keys]


def plain(scene: jb.Scene, keys: tuple[str, ...]) -> tuple[float, float, list[float]]:
    """Loss, its stated error and its logarithmic slopes, as a plain call has them.

    The slope by bolts is that of the force of the first.
    """
    ask = jb.response(scene, keys, FIGURES)
    values = _values(scene, keys)
    found = ask(*values)
    loss = float(found["dissipation"])
    by = jax.jacfwd(lambda given: ask(*given)["dissipation"])(values)
    slopes = []
    for key, value, slope in zip(keys, values, by, strict=True):
        place = (0, 1) if key == BOLTS else ()
        slopes.append(float(value[place]) * float(slope[place]) / loss)
    return loss, float(found["dissipation_error"]), slopes


def smooth(scene: jb.Scene, keys: tuple[str, ...]) -> tuple[float, list[float]]:
    """Loss and logarithmic slopes from cubics through runs of a scene."""
    shifts, slopes, loss = np.linspace(-WIDTH, WIDTH, POINTS), [], np.nan
    for key in keys:
        # Loads and friction leave the body as it is; with all keys each run condenses its own.
        over = keys[:2] if key in keys[:2] else keys
        ask, values = jb.response(scene, over, FIGURES[:1]), _values(scene, over)
        runs = []
        for shift in shifts:
            moved = [np.array(value, float) for value in values]
            moved[over.index(key)][(0, 1) if key == BOLTS else ()] *= np.exp(shift)
            runs.append(float(ask(*moved)["dissipation"]))
        cubic = np.polynomial.Polynomial.fit(shifts, np.log(runs), 3)
        loss, slope = float(np.exp(cubic(0.0))), float(cubic.deriv()(0.0))
        slopes.append(slope)
    return loss, slopes


def _row(kind: str, values: dict[str, Any]) -> Record:
    scene, keys = jb.Scene().replace(values), _asked(kind)
    row: Record = {"kind": kind, "values": values, "nodes": scene.plan.nodes}
    loss, stated, slopes = plain(scene, keys)
    if not loss > 0.0:
        return row | {"D": loss}
    load, limit = values["load.amplitude"], float(scene.gross_slip)
    goodman = 4.0 * load**3 / (3.0 * limit * float(scene.get("strip.axial_stiffness")))
    row |= {"D": loss, "stated": stated, "of_goodman": loss / goodman, "slopes": slopes}
    if row["of_goodman"] > SLIPS:
        fine = {"model.section": "plane", "model.nodes": FINE[kind]}
        true, right = smooth(scene.replace(fine), keys)
        row |= {"true_D": true, "true_slopes": right}
    return row


def _summary(kind: str, rows: list[Record]) -> Record:
    own = [row for row in rows if "true_D" in row]
    off = np.array([row["D"] / row["true_D"] - 1.0 for row in own])
    found: Record = {"scenes": len(own), "D": _errors(off)}
    found["D"]["doubtful"] = sum(row["stated"] > DOUBTFUL for row in own)
    each = []
    for i, key in enumerate(_asked(kind)):
        errors = np.array([row["slopes"][i] - row["true_slopes"][i] for row in own])
        each.append(errors / [max(1.0, abs(row["true_slopes"][i])) for row in own])
        found[key] = _errors(each[-1])
    return found | {"all slopes": _errors(np.concatenate(each))}


def _errors(off: Any) -> Record:
    """Median, 95 % and largest size of relative errors, in per cent."""
    size = 100.0 * np.abs(off)
    named = ("median_percent", 50.0), ("percent_95", 95.0), ("largest_percent", 100.0)
    return {name: float(np.percentile(size, part)) for name, part in named}


def measured(kind: str, count: int) -> Record:
    """Rows of random scenes of a kind, so many of which slip, and their errors."""
    drawn, rows, slipping = DRAWN[kind](np.random.default_rng(SEED)), [], 0
    while slipping < count:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", jb.DoubtfulWarning)
            rows.append(_row(kind, next(drawn)))
        slipping += "true_D" in rows[-1]
        if kind == "joint":  # each has programs of its own, and a process may map so many only
            jax.clear_caches()
        print(f"{kind} {slipping} of {count}", flush=True)
    return {"summary": _summary(kind, rows), "rows": rows}


def stepped() -> Record:
    """Largest change of a logarithmic slope from one even step to the next, in per cent.

    Beside it, for load and friction, that of the polygon of the events on 93 nodes.
    """
    scene, record = jb.Scene(), {}
    body = strip_of(scene.replace({"model.section": "plane", "model.nodes": 93})).body
    for i, (key, span) in enumerate(SPANS.items()):
        ask, at = jb.response(scene, (key,), FIGURES[:1]), jnp.linspace(*span, STEPS)

        def loss(value: Any, ask: Any = ask) -> Any:
            return ask(value)["dissipation"]

        jumps = {"plain": _jump(at, *jax.jit(jax.vmap(jax.value_and_grad(loss)))(at))}
        if key in KEYS[:2]:
            own = [np.asarray(scene.get(name)) for name in KEYS[:2]]
            found = []
            for value in at:
                own[i] = value
                work, by = smooth_slopes.steps(body, own[1], own[0])
                found.append((work, by[1 - i]))
            jumps["polygon"] = _jump(at, *map(np.asarray, zip(*found, strict=True)))
        record[key] = jumps
    return record


def _jump(at: Any, value: Any, slope: Any) -> float:
    slopes = np.asarray(at) * np.asarray(slope) / np.asarray(value)
    return 100.0 * float(np.max(np.abs(np.diff(slopes)) / np.abs(slopes[1:])))


def thick() -> Record:
    """Losses of thick strips of nearly incompressible material under small loads."""
    random, rows = np.random.default_rng(SEED), []
    for number in range(THICK):
        friction = random.uniform(0.4, 1.2)
        values = {
            "load.entry": ENTRIES[number % 4],
            "strip.height_ratio": random.uniform(0.25, 0.4),
            "contact.friction": friction,
            "strip.poisson_ratio": random.uniform(0.4, 0.49),
            "load.amplitude": random.uniform(0.05, 0.25) * 20.0 * friction,
        }
        scene = jb.Scene().replace(values)
        fine = scene.replace({"model.section": "plane", "model.nodes": FINE["strip"]})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", jb.DoubtfulWarning)
            plain, truth = jb.solve(scene), jb.solve(fine)
        error = float(plain.dissipation) / float(truth.dissipation) - 1.0
        doubts = bool(plain.doubts)
        rows.append({"values": values, "error": error, "doubted": doubts})
        if number % 50 == 49:
            print(f"thick strip {number + 1} of {THICK}", flush=True)
    wrong = [abs(row["error"]) > WRONG for row in rows]
    doubted = [row["doubted"] for row in rows]
    summary = _errors([row["error"] for row in rows]) | {
        "doubted": sum(doubted),
        "wrong and not doubted": sum(w and not d for w, d in zip(wrong, doubted, strict=True)),
        "doubted in vain": sum(d and not w for w, d in zip(wrong, doubted, strict=True)),
    }
    return {"summary": summary, "rows": rows}


DRAWN = {"strip": strips, "joint": joints}
PARTS = {
    "strip": lambda: measured("strip", STRIPS),
    "joint": lambda: measured("joint", JOINTS),
    "steps": stepped,
    "thick": thick,
}


def tell(record: Record) -> str:
    """Errors of each kind of scene, and jumps of slopes."""
    found = {kind: record[kind] for kind in PARTS if kind in record}
    return as_text({kind: part.get("summary", part) for kind, part in found.items()})

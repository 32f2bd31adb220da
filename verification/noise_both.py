"""Planted fits with noise in force and displacement: intervals that hold, and the bias.

Recordings of random laws, strips and lap joints whose numbers are known: 1 to 5 steady cycles as a
sine or at a constant rate, 40 to 240 samples each, and white noise of up to 3 % of the range in
each column.  Each is fitted by a plain call.  An error is told over the standard error that the fit
states, in its search space, where most numbers are logarithms.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import jbeamshell as jb
from calibration.running import as_text
from jbeamshell import identify, laws
from jbeamshell.common.errors import InputError, UnconvergedError
from jbeamshell.measured.loops import Loop, make_loop

COUNTS = {"law": 160, "strip": 28, "joint": 12}
NOISE = 0.03  # most of a column over its range
CYCLES, SAMPLES = (1, 5), (40, 240)
AMPLITUDES = (0.006, 0.012, 0.03)  # of a law
LEVELS = (0.45, 0.85)  # of gross slip
AWAY = 1.3  # friction of the start over that of the truth
SEED = 31
MU, ETA, STIFF = "contact.friction", "strip.height_ratio", "strip.axial_stiffness"
Record = dict[str, Any]


class Planted(NamedTuple):
    """Recordings of a joint whose numbers are known.

    Attributes
    ----------
    truth : true values of the numbers to fit
    start : law by name, or scene, from which a fit starts
    loops : recordings
    about : how they were made
    """

    truth: dict[str, float]
    start: Any
    loops: list[Loop]
    about: Record


class Form(NamedTuple):
    """Form of recordings: cycles, samples of one, whether as a sine, noise over the ranges."""

    cycles: int
    samples: int
    sine: bool
    force: float
    displacement: float


def form(random: np.random.Generator) -> Form:
    """Random form of recordings."""
    return Form(
        int(random.integers(CYCLES[0], CYCLES[1] + 1)),
        2 * int(random.integers(SAMPLES[0] // 2, SAMPLES[1] // 2 + 1)),
        bool(random.uniform() < 0.5),
        random.uniform(0.0, NOISE),
        random.uniform(0.0, NOISE),
    )


def cycle(of: Form) -> NDArray[np.float64]:
    """Drive (samples + 1,) of one cycle of unit amplitude from its high turn."""
    time = np.arange(of.samples + 1) / of.samples
    return np.cos(2.0 * np.pi * time) if of.sine else np.abs(4.0 * time - 2.0) - 1.0


def recording(
    force: Any, displacement: Any, of: Form, random: np.random.Generator, label: str
) -> Loop:
    """Recording of steady cycles (samples + 1,) of both columns, with noise."""
    columns = []
    for column, noise in ((force, of.force), (displacement, of.displacement)):
        own = np.append(np.tile(np.asarray(column)[:-1], of.cycles), column[-1])
        columns.append(own + noise * np.ptp(own) * random.standard_normal(own.size))
    return make_loop(*columns, label)


def law_of(random: np.random.Generator, number: int) -> tuple[laws.Law, tuple[float, ...]]:
    """Random law, and the amplitudes that tell its numbers."""
    name = ("jenkins", "iwan4", "mindlin", "bouc-wen", "bar")[number % 5]
    if name == "jenkins":
        return laws.Jenkins(1.0, random.uniform(80.0, 300.0)), AMPLITUDES[-1:]
    if name == "iwan4":
        chi, beta = random.uniform(-0.7, -0.2), random.uniform(0.2, 0.8)
        return laws.Iwan4(1.0, 100.0, chi, beta), AMPLITUDES
    if name == "mindlin":
        return laws.Mindlin(1.0, random.uniform(80.0, 120.0)), AMPLITUDES[1:2]
    if name == "bouc-wen":
        exponent, hardening = random.uniform(1.2, 2.0), random.uniform(0.03, 0.2)
        return laws.BoucWen(1.0, 100.0, exponent, 0.5, hardening), AMPLITUDES
    return laws.Bar(1.0, random.uniform(0.01, 0.02)), AMPLITUDES[-1:]


def of_law(number: int) -> Planted:
    """Recordings of a law that the displacement drives."""
    random = np.random.default_rng([SEED, number])
    law, sizes = law_of(random, number)
    of = form(random)
    loops = []
    for size in sizes:
        way = size * cycle(of)
        approach = size * np.linspace(0.0, 1.0, 17)[1:-1]
        force = np.asarray(law.path_forces(np.concatenate([approach, way, way[1:]])))
        loops.append(recording(force[-way.size :], way, of, random, f"U = {size:g}"))
    truth = {key: float(law.get(key)) for key in law.free()}
    return Planted(truth, law.heading, loops, of._asdict())


def strip(random: np.random.Generator, number: int) -> tuple[jb.Scene, list[str]]:
    """Random strip, and what is fitted of it."""
    height = float(np.exp(random.uniform(np.log(0.04), np.log(0.25))))
    scene = jb.Scene().replace({MU: random.uniform(0.1, 0.4), ETA: height})
    return scene, [MU, (STIFF, ETA)[number % 2]]


def joint(random: np.random.Generator, number: int) -> tuple[jb.Scene, list[str]]:
    """Random lap joint with two bolts, in double or single shear, and what is fitted of it."""
    height = random.uniform(0.05, 0.15)
    single = {"member.support": "clamped", "member.loaded_end": "level"}
    values = {
        MU: random.uniform(0.1, 0.4),
        ETA: height,
        "member.height_ratio": height,
        "strip.far_end": "free",
        "load.entry": "traction",
        "contact.bolts": [[0.6, 10.0, 0.3], [1.4, 10.0, 0.3]],
    }
    return jb.Scene().replace(values | (single if number % 2 else {"member.support": "rolling"})), [
        MU
    ]


def of_scene(
    drawn: Callable[[np.random.Generator, int], tuple[jb.Scene, list[str]]], number: int
) -> Planted:
    """Recordings of a strip or a joint that the force drives."""
    random = np.random.default_rng([SEED, number])
    scene, free = drawn(random, number)
    of = form(random)
    loops = []
    for part in LEVELS:
        way = part * float(scene.gross_slip) * cycle(of)
        approach = way[0] * np.linspace(0.0, 1.0, 9)[1:-1]
        history = jb.solve(
            scene.replace({"load.amplitude": float(way[0])}),
            np.concatenate([approach, way, way[1:]]),
        )
        columns = (np.asarray(c)[-way.size :] for c in (history.force, history.displacement))
        loops.append(recording(*columns, of, random, f"F = {part:g}"))
    truth = {key: float(scene.get(key)) for key in free}
    return Planted(truth, scene.replace({MU: AWAY * truth[MU]}), loops, of._asdict())


PLANTED: dict[str, Callable[[int], Planted]] = {
    "law": of_law,
    "strip": lambda number: of_scene(strip, number),
    "joint": lambda number: of_scene(joint, number),
}


def row(kind: str, number: int) -> Record:
    """Fit of one planted joint: the error of each number over its standard error."""
    planted = PLANTED[kind](number)
    name = planted.start if isinstance(planted.start, str) else kind
    found: Record = {"number": number, "of": name} | planted.about
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", jb.DoubtfulWarning)
            fit = identify.fit(planted.loops, planted.start, list(planted.truth))
    except (InputError, UnconvergedError) as error:
        return found | {"told": str(error)}
    u, truth = fit.uncertainty, list(planted.truth.values())
    off = (u.point - u.space.point(truth)) / np.sqrt(np.diag(u.covariance))
    inside = [low < planted.truth[key] < high for key, (low, high) in fit.intervals.items()]
    relative = [fit.values[key] / value - 1.0 for key, value in planted.truth.items()]
    names = list(planted.truth)
    return found | {
        "off": dict(zip(names, off.tolist(), strict=True)),
        "inside": dict(zip(names, inside, strict=True)),
        "relative": dict(zip(names, relative, strict=True)),
        "noise": fit.noises,
    }


def summary(rows: list[Record]) -> Record:
    """Numbers in their intervals, and mean and deviation of the errors over standard errors."""
    solved = [row for row in rows if "off" in row]
    found: Record = {"fits": len(rows), "without result": len(rows) - len(solved)}
    off = np.array([each for row in solved for each in row["off"].values()])
    inside = [each for row in solved for each in row["inside"].values()]
    found |= {"numbers": off.size, "inside": float(np.mean(inside))}
    return found | {"bias": float(np.mean(off)), "deviation": float(np.std(off))}


def planted_fits(kind: str, count: int) -> Record:
    """Rows of a kind, with their summary."""
    rows = []
    for number in range(count):
        rows.append(row(kind, number))
        told = rows[-1].get("told", rows[-1].get("off"))
        print(f"{kind} {number + 1} of {count}: {told}", flush=True)
    return {"summary": summary(rows), "rows": rows}


PARTS = {kind: partial(planted_fits, kind, count) for kind, count in COUNTS.items()}


def tell(record: Record) -> str:
    """Summaries of all kinds, and of all together."""
    found = {kind: record[kind]["summary"] for kind in PARTS if kind in record}
    rows = [row for kind in found for row in record[kind]["rows"]]
    return as_text(found | {"all": summary(rows)})

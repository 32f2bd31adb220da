"""One run: every variant and rival side by side, and over nodes."""

import functools
import shutil
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import numpy as np
from tqdm import tqdm

import jbeamshell as jb
from calibration import finite_elements
from calibration.running import read
from verification.benchmarks.rivals import condensed_elements, iwan, patterns_numpy

from . import machine
from .common import (
    AMPLITUDE,
    ETA,
    FINE,
    FINE_END_SIZE,
    OVER,
    ROUNDS,
    SPELL,
    Call,
    numbers,
    scene,
    seconds_of,
    spell,
    summary,
    truth,
)

STEPS = "load.steps_per_half_cycle"
EXACT = {"model.kinematics": "exact"}
LIFT = {"contact.normal": "rigid"}
SMOOTH = {"contact.smoothing": 16.0}
LOOP = ("force", "displacement", "dissipation")
CALCULIX = machine.ROOT / "calibration" / "finite_elements" / "check.json"
SLOW_ROUNDS = 2  # of what takes seconds
BACKBONE = np.linspace(0.0, 1.9, 41)  # forces of Iwan's network


class Variant(NamedTuple):
    """One way to a cycle's dissipation.

    Attributes
    ----------
    row : what the record says of it
    spell : from the seconds to spend to those of every call
    dissipation, limit : found, and where the same model ends on fine grids
    rounds : in how many it is timed, at the most
    """

    row: dict[str, Any]
    spell: Callable[[float], list[float]]
    dissipation: float
    limit: float
    rounds: int = 1000


def dissipation_call(
    change: Mapping[str, Any], figures: tuple[str, ...] = ("dissipation",)
) -> Callable[[], dict[str, jax.Array]]:
    """A warm call's worth of `jbeamshell.solving.response` on the standard strip."""
    here = scene(change)
    return functools.partial(jb.response(here, OVER, figures), *numbers(here))


def of_call(row: dict[str, Any], call: Call, dissipation: Callable, limit: float) -> Variant:
    """A variant that is called here, whose first call is what compiles it."""
    first = seconds_of(call)
    own = {"first_s": first} if row["by"] == "jbeamshell" else {}
    spelled = functools.partial(spell, call)
    return Variant(row | own, spelled, float(dissipation(call())), limit)


@functools.cache
def fine(*change: tuple[str, Any]) -> float:
    """Dissipation on the fine grid, of the standard strip with what differs."""
    return float(jb.solve(scene(dict(change) | FINE, FINE_END_SIZE)).dissipation)


def own_variants() -> list[Variant]:
    """Jbeamshell's."""
    cases: list[tuple[str, dict[str, Any], int, tuple[str, ...]]] = [
        ("dissipation, 1 step", {}, 1, ("dissipation",)),
        ("dissipation, 4 steps", {}, 4, ("dissipation",)),
        ("loop, 20 steps", {}, 20, LOOP),
        ("exact kinematics, 1 step", EXACT, 1, ("dissipation",)),
        ("exact kinematics, 4 steps", EXACT, 4, ("dissipation",)),
        ("with lift, 4 steps", LIFT, 4, ("dissipation",)),
        ("m = 16, 4 steps", SMOOTH, 4, ("dissipation",)),
    ]
    found = []
    for name, change, steps, figures in tqdm(cases, disable=None, desc="compile"):
        limit = fine(*change.items())
        call = dissipation_call(change | {STEPS: steps}, figures)
        row = {"what": name, "by": "jbeamshell", "steps": steps, "returns": ", ".join(figures)}
        found.append(of_call(row, call, lambda answer: answer["dissipation"], limit))
    for steps in (1, 20):
        here = scene({STEPS: steps})
        name = f"History, {steps} step" + "s" * (steps > 1)
        row = {"what": name, "by": "jbeamshell", "steps": steps, "returns": "History"}
        call = functools.partial(jb.solve, here)
        found.append(of_call(row, call, lambda history: history.dissipation, fine()))
    return found


def rival_variants() -> list[Variant]:
    """Everything else."""
    found = []
    for size, steps in (((40, 4), 1), ((40, 4), 4), ((60, 6), 1)):
        name = "condensed elements {} x {}, {} step".format(*size, steps) + "s" * (steps > 1)
        row = {"what": name, "by": "condensed elements", "steps": steps}
        row["returns"] = "dissipation; building and cycle"
        call = functools.partial(_condensed, size, steps)
        found.append(of_call(row, call, lambda answer: answer["dissipation"], truth()))
    for steps in (1, 4):
        name = f"patterns in NumPy, {steps} step" + "s" * (steps > 1)
        row = {"what": name, "by": "NumPy", "steps": steps}
        row["returns"] = "dissipation; building without the grid, and cycle; default end_size"
        strip = patterns_numpy.Strip(ETA, 41)
        call = functools.partial(patterns_numpy.cycle, strip, AMPLITUDE, steps)
        variant = of_call(row, call, lambda answer: answer["dissipation"], fine())
        found.append(variant._replace(spell=functools.partial(_patterns, steps)))
    network = iwan.network(*_backbone())
    row = {"what": "Iwan's network, 20 steps", "by": "Iwan", "steps": 20}
    row["returns"] = "loop; the cycle alone, of a network fitted to jbeamshell's backbone before"
    call = functools.partial(iwan.cycle, network, AMPLITUDE, 20)
    found.append(of_call(row, call, lambda answer: answer["dissipation"], fine()))
    if shutil.which("ccx"):
        found += [_calculix(steps) for steps in (4, 20)]
    else:
        found.append(_calculix_recorded())
    return found


def _condensed(size: tuple[int, int], steps: int) -> dict[str, float]:
    return condensed_elements.cycle(condensed_elements.Strip(ETA, *size), AMPLITUDE, steps)


def _patterns(steps: int, seconds: float) -> list[float]:
    """The strip's own seconds, which leave out the grid, and the cycle's."""
    strip = patterns_numpy.Strip(ETA, 41)
    cycles = spell(functools.partial(patterns_numpy.cycle, strip, AMPLITUDE, steps), seconds)
    return [strip.seconds + cycle for cycle in cycles]


def _backbone() -> tuple[np.ndarray, np.ndarray]:
    """Mean of a pull's and a push's backbone of the strip on the timed grid."""
    runs = [jb.solve(scene(), sign * BACKBONE[1:]) for sign in (1.0, -1.0)]
    pull, push = (np.abs(np.asarray(run.displacement)) for run in runs)
    return 0.5 * (pull + push), BACKBONE


def _calculix(steps: int) -> Variant:
    here = scene({STEPS: steps})
    call = functools.partial(finite_elements.solve, here)
    row = {"what": f"CalculiX, {steps} steps", "by": "CalculiX", "steps": steps}
    row["returns"] = "History; quadratic elements, meshing and reading included"
    found = float(call().dissipation)
    return Variant(row, lambda _: [seconds_of(call)], found, truth(), SLOW_ROUNDS)


def _calculix_recorded() -> Variant:
    record = read(CALCULIX)
    loop = next(
        loop
        for loop in record["loops"]
        if (loop["eta"], loop["A"], loop["elements"]) == (ETA, AMPLITUDE, "quadratic")
    )
    row = {"what": "CalculiX, 20 steps", "by": "CalculiX", "steps": record["steps"][STEPS]}
    row["returns"] = "History; recorded by calibration/finite_elements/check.py, not run here"
    return Variant(row, lambda _: [loop["wall_s"]], loop["D"], truth(), 1)


def one(rounds: int = ROUNDS) -> dict[str, Any]:
    """All variants of one run, interleaved."""
    variants = own_variants() + rival_variants()
    seconds: list[list[float]] = [[] for _ in variants]
    for number in tqdm(range(rounds), disable=None, unit="round", desc="one"):
        for own, variant in zip(seconds, variants, strict=True):
            if number < variant.rounds:
                own += variant.spell(SPELL)
    rows = [
        variant.row
        | summary(own)
        | {
            "error": variant.dissipation / variant.limit - 1.0,
            "error_to_elements": variant.dissipation / truth() - 1.0,
        }
        for variant, own in zip(variants, seconds, strict=True)
    ]
    return {"eta": ETA, "A": AMPLITUDE, "nodes": 41, "rows": rows}

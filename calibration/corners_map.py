"""Map of the corners of the domain: random scenes of unusual kinds, and whether errors are silent.

    python calibration/corners_map.py [--scenes 40] [--only KIND ...] [--seed 22]

solves every scene as it is and against one or two references: the same model on a mesh twice as
fine with more load steps, and the other solver where both apply (the contact line by events
against load steps).  It writes corners_map.json beside this file after every scene; --only computes
these kinds anew.  A failure is silent if the dissipation is off by more than
2 % from a reference, and the run neither raised nor doubted itself.
"""

import argparse
import json
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from default_settings import displaced, layered, plain, pressed_in_part  # noqa: E402
from provenance import provenance  # noqa: E402
from tqdm import tqdm  # noqa: E402

import jbeamshell as jb  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.history.reliability import TOLERANCE  # noqa: E402

RECORD = Path(__file__).parent / "corners_map.json"
SEED = 22
Values = dict[str, Any]
Random = np.random.Generator
LIFT = {"model.fields": ["v", "w", "beta", "psi"]}
STEPWISE = {"model.solution": "stepwise"}
EXACT = STEPWISE | {"model.kinematics": "exact"}
MANY_STEPS = {"load.steps_per_half_cycle": 40}
FINE = MANY_STEPS | {"model.nodes": 129, "model.end_size": 1.0 / 48.0}


def bottom(random: Random) -> Values:
    """Pressures on both faces, with zeros and steps."""
    found = pressed_in_part(random)
    top = np.array(found["contact.pressure"])
    begin, end = np.sort(random.uniform(0.0, 2.0, 2))
    up = random.uniform(0.1, 0.6) * np.min(top[top[:, 1] > 0.0, 1])
    found["contact.bottom_pressure"] = [
        [0.0, 0.0],
        [begin, 0.0],
        [begin, up],
        [end, up],
        [end, 0.0],
    ]
    found["load.amplitude"] *= 0.4  # the bottom pressure takes a part of the friction
    return found


def curved(random: Random) -> Values:
    """Curved before loading, up or down, so little that the pressure closes most of it."""
    found = plain(random)
    height = found["strip.height_ratio"]
    flat = 10.0 * 2.0**2 / (3.4e4 * height**2)  # curvature of a strip as the pressure bends it
    return (
        found | LIFT | {"strip.curvature": random.choice([-1, 1]) * flat * random.uniform(0.01, 1)}
    )


def supported(random: Random) -> Values:
    """Pinned and free ends, under pressures that leave gaps."""
    make = plain if random.uniform() < 0.5 else pressed_in_part
    return make(random) | {"strip.far_end": str(random.choice(["pinned", "free"]))}


def beyond(random: Random) -> Values:
    """Displacements beyond gross slip."""
    found = displaced(random)
    gross = (20.0 * found["contact.friction"]) ** 2 / (2 * 3.4e4 * 10.0 * found["contact.friction"])
    return found | {"load.amplitude": gross * random.uniform(1.1, 4.0)}


def along_the_arc(random: Random) -> Values:
    """Arc length beyond gross slip."""
    return beyond(random) | {"load.control": "arc-length"}


def squeezed(random: Random) -> Values:
    """Assumed squeeze, or the printed constants."""
    kind = random.choice(["assumed", "printed"])
    return plain(random) | (
        LIFT | {"model.squeeze": "assumed"} if kind == "assumed" else {"model.constants": "printed"}
    )


def higher(random: Random) -> Values:
    """Sections of order 3 and 5, and plane elasticity, under pressures that leave gaps."""
    make = plain if random.uniform() < 0.5 else pressed_in_part
    return make(random) | {"model.rung": str(random.choice(["p3", "p5", "plane"]))}


def masing(random: Random) -> Values:
    """Masing's rule on scenes without symmetry and of large friction."""
    make = plain if random.uniform() < 0.5 else pressed_in_part
    found = make(random) | {"model.rung": str(random.choice(["masing", "masing-pull"]))}
    larger = random.uniform(1.0, 2.0)
    found["contact.friction"] *= larger
    found["load.amplitude"] *= larger
    return found


def few_steps(random: Random) -> Values:
    """One, two and four load steps at a friction coefficient near one."""
    found, mu = plain(random), random.uniform(0.5, 1.0)
    found["load.amplitude"] *= mu / found["contact.friction"]
    steps = {"load.steps_per_half_cycle": int(random.choice([1, 2, 4]))}
    return found | EXACT | LIFT | steps | {"contact.friction": mu}


def layers(random: Random) -> Values:
    """Laminates that lift, on elastic sliders, some of a large contrast."""
    found = layered(random)
    contrast = random.uniform(0.0, 2.0)
    for row in found["strip.layers"]:
        row[1] *= 10.0 ** random.uniform(-contrast, contrast)
    return found | {
        "contact.stick_stiffness": float(np.exp(random.uniform(np.log(10), np.log(1e3))))
    }


def soft(random: Random) -> Values:
    """Compliant foundation, or smooth friction under pressures that leave gaps."""
    if random.uniform() < 0.5:
        return pressed_in_part(random) | LIFT | {"contact.smoothing": random.uniform(4.0, 16.0)}
    stiffness = float(np.exp(random.uniform(np.log(5.0), np.log(5e3))))
    return (
        plain(random)
        | LIFT
        | {
            "contact.normal": "compliant",
            "contact.normal_stiffness": stiffness,
        }
    )


def frozen(random: Random) -> Values:
    """A strip that may not lift, under pressures with zeros and steps."""
    return pressed_in_part(random) | EXACT


def events(random: Random) -> Values:
    """Scenes of the contact line, of whatever friction."""
    make = plain if random.uniform() < 0.5 else pressed_in_part
    return make(random)


def lap(random: Random) -> Values:
    """Lap joints: two members of other heights and stiffness, pressed evenly or as by a bolt."""
    found = plain(random)
    thinner, softer = np.exp(random.uniform(-1.0, 1.0, 2))
    support = str(random.choice(["rolling", "clamped"]))
    found |= {
        "strip.far_end": "free",
        "member.support": support,
        "member.height_ratio": thinner * found["strip.height_ratio"],
        "member.axial_stiffness": 3.4e4 * thinner * softer,
        "member.poisson_ratio": random.uniform(0.0, 0.45),
        "model.rung": str(random.choice(["squeeze", "p2", "plane"])),
    }
    if support == "clamped":
        found["strip.loaded_end"] = "guided"
    if random.uniform() < 0.5:
        begin, end = np.sort(random.uniform(0.2, 1.8, 2))
        bolt = [[begin, 0.0], [begin, 20.0], [end, 20.0], [end, 0.0]]
        found["contact.pressure"] = bolt
        if support == "clamped":
            found["contact.bottom_pressure"] = bolt
            found["contact.assembly"] = str(random.choice(["frictionless", "frictional"]))
        found["load.amplitude"] *= end - begin
    return found


def sliders(random: Random) -> Values:
    """Elastic slip from soft to stiff, in plane strain or stress, on every support."""
    make = plain if random.uniform() < 0.5 else pressed_in_part
    return make(random) | {
        "contact.stick_stiffness": float(np.exp(random.uniform(np.log(3.0), np.log(1e4)))),
        "strip.far_end": str(random.choice(["held", "pinned", "free"])),
        "strip.plane": str(random.choice(["strain", "stress"])),
        "strip.poisson_ratio": random.uniform(-0.5, 0.499),
    }


def given(random: Random) -> Values:
    """Settings that a user gives, coarse ones among them, in place of those that are chosen."""
    make = (plain, pressed_in_part, bottom, layered, displaced)[random.integers(5)]
    found = make(random) | {
        "model.nodes": int(random.choice([17, 33, 65])),
        "load.steps_per_half_cycle": int(random.choice([2, 4, 10])),
        "model.kinematics": str(random.choice(["linear", "exact"])),
        "model.rung": str(random.choice(["shell", "squeeze"])),
    }
    if random.uniform() < 0.5:
        found["model.end_size"] = float(random.choice([1.0, 0.25, 1.0 / 24.0]))
    return found


# Kinds of scenes, and what the other solver sets; none where one solver applies.
KINDS: dict[str, tuple[Callable[[Random], Values], Values | None]] = {
    "both faces": (bottom, STEPWISE | LIFT),
    "curved": (curved, None),
    "pinned and free": (supported, STEPWISE | LIFT),
    "beyond gross slip": (beyond, STEPWISE | LIFT),
    "arc length": (along_the_arc, None),
    "assumed and printed": (squeezed, None),
    "higher sections": (higher, None),
    "Masing": (masing, EXACT | LIFT | MANY_STEPS),
    "few steps": (few_steps, MANY_STEPS),
    "layers that lift": (layers, STEPWISE | LIFT),
    "compliant and smooth": (soft, None),
    "frozen": (frozen, EXACT | LIFT),
    "events": (events, STEPWISE | LIFT),
    "lap joints": (lap, None),
    "elastic sliders": (sliders, STEPWISE | LIFT),
    "given settings": (given, FINE),
}


def finer(scene: jb.Scene) -> jb.Scene:
    """Scene with the same model on a mesh twice as fine, and four times at its ends."""
    model = scene.model
    mesh = {"model.nodes": 2 * model.nodes - 1, "model.end_size": 0.5 * model.end_size}
    return scene.pinned().replace(mesh)


def solved(scene: jb.Scene) -> jb.History | None:
    """Result of a scene; None if it has none."""
    try:
        history = jb.solve(scene, throw=False)
    except jb.InputError:
        return None
    return history if history.converged else None


def off(value: float, reference: float) -> float:
    """Relative error of a number; of one whose reference is zero, 0 if it is zero too, else 1."""
    return abs(value / reference - 1.0) if reference else float(value != 0.0)


def compared(values: Values, other: Values | None) -> Values:
    """Outcome of one scene, errors against its references, estimate and doubts."""
    try:
        scene = jb.Scene().replace(values)
        found = jb.solve(scene, throw=False)
    except jb.InputError as error:
        return {"outcome": "refused", "reason": str(error)}
    if not found.converged:
        return {"outcome": "fails, and says so"}
    doubts, errors = list(found.doubts), {}
    references = {"refined": solved(finer(scene))}
    if other is not None:
        given = {key: value for key, value in values.items() if key != "model.rung"}
        references["other"] = solved(jb.Scene().replace(given | other))
    for name, reference in references.items():
        if reference is not None:
            errors[name] = off(float(found.dissipation), float(reference.dissipation))
    known = list(errors.values())
    wrong = bool(known) and max(known) > TOLERANCE
    outcome = "wrong" if wrong else "right"
    ends = {("right", 0): "right", ("right", 1): "right, but doubted"}
    ends |= {("wrong", 0): "wrong, silently", ("wrong", 1): "wrong, and says so"}
    return {
        "outcome": ends[outcome, int(bool(doubts))] if known else "without reference",
        "errors": errors,
        "estimate": float(found.dissipation_error),
        "bar_ratio": float(found.dissipation_ratio),
        "doubts": doubts,
        "rung": scene.model.rung,
        "kinematics": scene.model.kinematics,
    }


def rows(kind: str, seed: int, scenes: int) -> Iterator[Values]:
    """Random scenes of one kind and their outcomes, one after the other."""
    make, other = KINDS[kind]
    random = np.random.default_rng([seed, list(KINDS).index(kind)])
    for _ in tqdm(range(scenes), kind, disable=None):
        values = make(random)
        yield {"values": values} | compared(values, other)


def counts(found: list[Values]) -> dict[str, int]:
    """Number of scenes of each outcome."""
    ends = [row["outcome"] for row in found]
    return {end: ends.count(end) for end in sorted(set(ends))}


def main() -> None:
    """Solve the scenes of the kinds asked for, and write the record after each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=40, help="scenes of each kind")
    parser.add_argument("--only", nargs="*", default=list(KINDS), choices=list(KINDS))
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--record", type=Path, default=RECORD)
    given = parser.parse_args()
    record: Values = {"about": provenance(), "kinds": {}}
    if given.record.exists():
        record = json.loads(given.record.read_text(encoding="utf-8"))
    for kind in given.only:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", jb.DoubtfulWarning)
            found: list[Values] = []
            for row in rows(kind, given.seed, given.scenes):
                found.append(row)
                record["kinds"][kind] = {"seed": given.seed, "scenes": found}
                write_text(given.record, json.dumps(record, indent=1))
        print(kind, counts(found), file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()

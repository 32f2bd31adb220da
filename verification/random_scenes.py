"""Random scenes of all kinds, for verification/campaign.py.

A kind is a function that draws the values of one scene, what the other solver sets, and how many
scenes of it the campaign holds.  Values are as `strip.changed` reads them.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from jbeamshell.mechanics.bar import bar_backbone

Values = dict[str, Any]
Random = np.random.Generator

STEPS = {"by": "steps"}
EXACT = STEPS | {"model.kinematics": "exact"}
HELD = {"contact.normal": "held"}
LIFT = {"contact.normal": "rigid"}
MANY_STEPS = {"load.steps_per_half_cycle": 40}
FINE = MANY_STEPS | {"model.nodes": 129, "end_size": 1.0 / 48.0}


def _log(random: Random, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def plain(random: Random) -> Values:
    """Homogeneous strip of any height, friction, load and Poisson's ratio."""
    mu = _log(random, 0.05, 0.5)
    return {
        "strip.height_ratio": _log(random, 0.01, 0.4),
        "strip.kappa_s": random.uniform(0.3, 1.5),
        "strip.poisson_ratio": random.uniform(0.0, 0.45),
        "contact.friction": mu,
        "load.amplitude": random.uniform(0.03, 0.97) * 20.0 * mu,
    }


def pressed_in_part(random: Random) -> Values:
    """Pressure on a part of the strip, even or falling, so that the rest lifts off."""
    begin, end = random.uniform(0.0, 0.8), random.uniform(1.0, 2.0)
    low, high = sorted(random.uniform(5.0, 20.0, 2))
    table = [[0.0, 0.0], [begin, 0.0], [begin, high], [end, low]]
    table += [[end, 0.0], [2.0, 0.0]] if end < 2.0 else []
    force = 0.5 * (low + high) * (end - begin)
    found = plain(random)
    part = random.uniform(0.05, 0.9) * found["contact.friction"] * force
    return found | {"contact.pressure": table, "load.amplitude": part}


def both_faces(random: Random) -> Values:
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


def ramp(random: Random) -> Values:
    """Pressure that changes along the whole strip, without jumps."""
    found, ends = plain(random), random.uniform(2.0, 20.0, 2)
    force = found["contact.friction"] * np.sum(ends)
    return found | {
        "contact.pressure": [[0.0, ends[0]], [2.0, ends[1]]],
        "load.amplitude": random.uniform(0.03, 0.95) * force,
    }


def curved(random: Random) -> Values:
    """Curved before loading, up or down, so little that the pressure closes most of it."""
    found = plain(random)
    height = found["strip.height_ratio"]
    flat = 10.0 * 2.0**2 / (3.4e4 * height**2)  # curvature of a strip as the pressure bends it
    return found | {"strip.curvature": random.choice([-1, 1]) * flat * random.uniform(0.01, 1)}


def supported(random: Random) -> Values:
    """Pinned and free ends."""
    return plain(random) | {"strip.far_end": str(random.choice(["pinned", "free"]))}


def displaced(random: Random) -> Values:
    """Displacement control, up to two thirds of a bar's gross slip."""
    found = plain(random)
    force = found["load.amplitude"] * 0.66
    u = float(bar_backbone(force, 3.4e4, 10.0 * found["contact.friction"]))
    return found | {"load.control": "displacement", "load.amplitude": u}


def beyond(random: Random) -> Values:
    """Displacements beyond gross slip, of a strip that is held or free."""
    found = plain(random)
    gross = (20.0 * found["contact.friction"]) ** 2 / (2 * 3.4e4 * 10.0 * found["contact.friction"])
    return found | {
        "load.control": "displacement",
        "load.amplitude": gross * random.uniform(1.1, 4.0),
        "strip.far_end": str(random.choice(["guided", "free"])),
    }


def along_the_arc(random: Random) -> Values:
    """Arc length beyond gross slip."""
    return beyond(random) | {"load.control": "arc-length", "strip.far_end": "guided"}


def squeezed(random: Random) -> Values:
    """Assumed squeeze, or the printed constants."""
    kind = random.choice(["assumed", "printed"])
    assumed, printed = {"model.section": "assumed"}, {"model.constants": "printed"}
    return plain(random) | (assumed if kind == "assumed" else printed)


def shells(random: Random) -> Values:
    """Sections without squeeze strain."""
    return plain(random) | {"model.section": "shell"}


def elastic(random: Random) -> Values:
    """Plane elasticity under pressures that leave gaps."""
    return pressed_in_part(random) | {"model.section": "plane"}


def few_steps(random: Random) -> Values:
    """One, two and four load steps at a friction coefficient near one."""
    found, mu = plain(random), random.uniform(0.5, 1.0)
    found["load.amplitude"] *= mu / found["contact.friction"]
    steps = {"load.steps_per_half_cycle": int(random.choice([1, 2, 4]))}
    return found | EXACT | steps | {"contact.friction": mu}


def layered(random: Random) -> Values:
    """Two or three layers, some of a large contrast, on elastic sliders."""
    found = plain(random)
    share = random.dirichlet(np.full(random.integers(2, 4), 4.0))
    contrast = random.uniform(0.0, 2.0)
    layers = [
        [
            h * 2.0 * found["strip.height_ratio"],
            _log(random, 1e4, 1e6) * 10.0 ** random.uniform(-contrast, contrast),
            random.uniform(0.0, 0.45),
        ]
        for h in share
    ]
    layers[-1][0] += 2.0 * found["strip.height_ratio"] - sum(row[0] for row in layers)
    del found["strip.poisson_ratio"]
    stiffness = _log(random, 10.0, 1e3)
    return found | {"strip.layers": layers, "contact.stick_stiffness": stiffness}


def incompressible(random: Random) -> Values:
    """Nearly incompressible strips, of one layer or of two."""
    found = plain(random)
    nu = 0.5 - 10.0 ** -random.uniform(1.0, 4.0)
    if random.uniform() < 0.5:
        return found | {"strip.poisson_ratio": nu}
    del found["strip.poisson_ratio"]
    half = found["strip.height_ratio"]
    rows = [[half, _log(random, 1e4, 1e6), ratio] for ratio in (nu, random.uniform(0.0, nu))]
    return found | {"strip.layers": rows}


def slender(random: Random) -> Values:
    """Slender strips, of which an overhang may buckle."""
    found = plain(random)
    height, free = _log(random, 0.005, 0.04), random.uniform(0.4, 1.5)
    euler = 0.25 * np.pi**2 * 3.4e4 * height**2 / 3.0 / free**2
    load = euler * random.uniform(0.1, 2.0)
    pressed = 2.0 - free
    pressure = load / (found["contact.friction"] * pressed * random.uniform(0.2, 0.95))
    table = [[0.0, pressure], [pressed, pressure], [pressed, 0.0], [2.0, 0.0]]
    return found | {
        "strip.height_ratio": height,
        "contact.pressure": table,
        "load.amplitude": load,
        "model.kinematics": str(random.choice(["linear", "auto"])),
    }


def smooth(random: Random) -> Values:
    """Smooth law of friction."""
    return plain(random) | {"contact.smoothing": random.uniform(4.0, 16.0)}


def compliant(random: Random) -> Values:
    """Compliant foundation."""
    base = {"contact.normal": "compliant", "contact.normal_stiffness": _log(random, 5.0, 5e3)}
    return plain(random) | base


def frozen(random: Random) -> Values:
    """A strip that may not lift, under pressures with zeros and steps."""
    return pressed_in_part(random) | EXACT | HELD


def rotating(random: Random) -> Values:
    """Pressure so large that rotations matter."""
    found, stronger = plain(random), _log(random, 100.0, 1000.0)
    found["strip.height_ratio"] = _log(random, 0.03, 0.3)
    return found | {
        "contact.pressure": 10.0 * stronger,
        "load.amplitude": found["load.amplitude"] * stronger,
    }


def sliders(random: Random) -> Values:
    """Elastic slip from soft to stiff, held in plane strain or free in plane stress."""
    plane, end = (("strain", "guided"), ("stress", "free"))[random.integers(2)]
    return plain(random) | {
        "contact.stick_stiffness": _log(random, 3.0, 1e3),
        "strip.far_end": end,
        "strip.plane": plane,
        "strip.poisson_ratio": random.uniform(-0.5, 0.499),
    }


def given(random: Random) -> Values:
    """Settings that a user gives, coarse ones among them, in place of those that are chosen."""
    nodes, steps, kinematics, section = (
        (17, 2, "linear", "squeeze"),
        (33, 4, "linear", "shell"),
        (65, 4, "exact", "squeeze"),
    )[random.integers(3)]
    make = (plain, pressed_in_part)[random.integers(2)]
    return make(random) | {
        "model.nodes": nodes,
        "end_size": _log(random, 1.0 / 48.0, 1.0),
        "load.steps_per_half_cycle": steps,
        "model.kinematics": kinematics,
        "model.section": section,
    }


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
        "model.section": str(random.choice(["squeeze", "plane"])),
    }
    if support == "clamped":
        found["member.loaded_end"] = "level"
    if random.uniform() < 0.5:
        begin, end = np.sort(random.uniform(0.2, 1.8, 2))
        bolt = [[begin, 0.0], [begin, 20.0], [end, 20.0], [end, 0.0]]
        found["contact.pressure"] = bolt
        if support == "clamped":
            found["contact.bottom_pressure"] = bolt
            found["member.assembly"] = str(random.choice(["frictionless", "frictional"]))
        found["load.amplitude"] *= end - begin
    return found


def bolted(random: Random) -> Values:
    """Lap joints with two bolts: shanks, bearings, gaps, overhangs and moments."""
    found = lap(random)
    for key in ("contact.pressure", "contact.bottom_pressure", "member.assembly"):
        found.pop(key, None)
    widths, forces = random.uniform(0.2, 0.5, 2), random.uniform(5.0, 20.0, 2)
    bolts = [[x, force, width] for x, force, width in zip((0.6, 1.4), forces, widths, strict=True)]
    gross = found["contact.friction"] * np.sum(forces)
    found |= {"contact.bolts": bolts, "load.amplitude": random.uniform(0.1, 0.9) * gross}
    extra = random.choice(["shanks", "bearings", "overhang", "arm", "moment"])
    if extra == "shanks":
        found["member.bolt_stiffness"] = _log(random, 1e2, 1e4)
    elif extra == "bearings":
        found["member.bearing_stiffness"] = _log(random, 1e3, 1e5)
        found["member.clearance"] = gross / 3.4e4 * random.uniform(0.05, 1.0)
    elif extra == "overhang":
        found |= {
            "strip.overhang": random.uniform(0.1, 1.0),
            "member.overhang": random.uniform(0.1, 1.0),
        }
    elif extra == "arm":
        found["load.arm"] = found["strip.height_ratio"] * random.uniform(-1.0, 1.0)
    else:
        found |= {
            "load.kind": "moment",
            "load.amplitude": random.uniform(0.05, 0.5) * gross * found["strip.height_ratio"],
        }
    return found


class Kind(NamedTuple):
    """Kind of scenes.

    Attributes
    ----------
    make : function that draws the values of a scene
    other : values of another solver for the same model; None where one solver applies
    scenes : number in a whole campaign; the record may hold fewer
    """

    make: Callable[[Random], Values]
    other: Values | None
    scenes: int


KINDS = {
    "plain": Kind(plain, STEPS, 1000),
    "pressed in part": Kind(pressed_in_part, STEPS, 150),
    "both faces": Kind(both_faces, STEPS, 80),
    "ramps": Kind(ramp, STEPS, 300),
    "pinned and free": Kind(supported, STEPS, 300),
    "displacement control": Kind(displaced, STEPS, 450),
    "beyond gross slip": Kind(beyond, STEPS, 300),
    "elastic sliders": Kind(sliders, STEPS, 300),
    "layers that lift": Kind(layered, STEPS, 300),
    "nearly incompressible": Kind(incompressible, STEPS | {"model.grid": "collocation"}, 100),
    "shells": Kind(shells, STEPS, 60),
    "assumed and printed": Kind(squeezed, None, 40),
    "slender": Kind(slender, EXACT, 20),
    "few steps": Kind(few_steps, MANY_STEPS, 20),
    "given settings": Kind(given, FINE, 40),
    "lap joints": Kind(lap, None, 20),
    "bolts, bearings": Kind(bolted, None, 20),
    "elasticity with gaps": Kind(elastic, None, 12),
    "smooth friction": Kind(smooth, None, 20),
    "compliant": Kind(compliant, None, 20),
    "frozen": Kind(frozen, EXACT | LIFT, 20),
    "rotations": Kind(rotating, None, 20),
    "curved": Kind(curved, None, 20),
    "arc length": Kind(along_the_arc, None, 20),
}

"""Finite elements: those computed for this project, and CalculiX as its own users run it."""

from __future__ import annotations

import csv
import functools
from collections.abc import Callable
from pathlib import Path

import numpy as np

import jbeamshell as jb
from calibration.comparisons.case import Case, Floats, Source
from calibration.running import read
from jbeamshell.measured.example import data_folder

OWN = Source(
    "Plane-strain finite elements of this project, graded to the corners and condensed to the "
    "contact line, exact Coulomb friction and unilateral contact; written apart from the library; "
    "README.md beside the data tells the meshes and their errors",
    "MIT, shipped with the library",
)
CALCULIX = Source(
    "G. Dhondt and K. Wittig, CalculiX 2.20, penalty contact face to face; decks and figures of "
    "this project's studies (check.json, lap.json, flange.json in calibration/finite_elements)",
    "own decks, MIT",
)
EVEN = "plane strain; even traction on the loaded face; no stick compliance"
FLANGE = Path(__file__).parents[1] / "finite_elements" / "flange.json"
Row = dict[str, str]
AMPLITUDES = (0.4359, 0.7855, 1.3)
BOLTS = [[0.6, 10.0, 0.3], [1.4, 10.0, 0.3]]  # X, force and width of the patch


@functools.cache
def rows(name: str) -> tuple[Row, ...]:
    """Rows of a table of the shipped finite elements."""
    with (data_folder() / name).open(encoding="utf-8") as file:
        return tuple(csv.DictReader(file))


def column(picked: tuple[Row, ...], name: str) -> Floats:
    """Column of picked rows as numbers."""
    return np.array([float(row[name]) for row in picked])


@functools.cache
def solved(scene: Callable[[], jb.Scene], values: tuple[tuple[str, object], ...]) -> jb.History:
    """History of a scene with other values, by a plain call."""
    return jb.solve(scene().replace(dict(values)))


def flange(side: str) -> Floats:
    """Figures of the bolted flange of one side of the record."""
    found = read(FLANGE)[side]
    return np.array([found[key] for key in ("dissipation", "secant_stiffness", "open_area_turn")])


def strip(row: Row) -> jb.History:
    """Strip of a row of energy.csv or entry.csv."""
    values = {"strip.height_ratio": float(row["eta"]), "load.amplitude": float(row["A"])}
    if "mu" in row:
        values |= {"contact.friction": float(row["mu"]), "load.entry": row["entry"]}
    scene = jb.Scene if "mu" in row else jb.library.standard
    return solved(scene, tuple(values.items()))


def lap(row: Row) -> jb.History:
    """Lap joint of a row of lap_joints.csv."""
    height = float(row["H2"]) / float(row["H1"])
    values = {
        "strip.height_ratio": float(row["H1"]),
        "member.height_ratio": float(row["H2"]),
        "member.axial_stiffness": 3.4e4 * float(row["E2_over_E1"]) * height,
        "load.amplitude": float(row["A"]),
    }
    double = row["problem"] == "double-shear"
    scene = jb.library.double_shear if double else jb.library.single_lap
    return solved(scene, tuple(values.items()))


def bolted(entry: str) -> Floats:
    """Energy lost and secant stiffness of a single lap with two bolts, frictionless assembly.

    Its nodes are those of the study (calibration/finite_elements/lap.py): elements are .7 % off.
    """
    values = {"contact.bolts": BOLTS, "load.amplitude": 0.6, "load.entry": entry}
    values |= {"member.assembly": "frictionless", "model.nodes": 257}
    scene = jb.library.single_lap().replace(values)
    history = jb.solve(scene, throw=False)  # both go on by 2 H, whatever other overhangs make of it
    return np.array([float(history.dissipation), float(history.secant_stiffness)])


def entries(entry: str) -> tuple[Row, ...]:
    """Rows of entry.csv for one entry of the force."""
    return tuple(
        row
        for row in rows("entry.csv")
        if row["entry"] == entry
        and (row["eta"], row["mu"]) in {("0.1126", "0.1"), ("0.2358", "0.3")}
        and row["overhang_over_H"] in ("0", "4")
        and row["A"] in ("0.4359", "0.7855", "1.3077", "3.9")
    )


def dissipation(picked: Callable[[], tuple[Row, ...]], of: Callable[[Row], jb.History]) -> Floats:
    """Our dissipation for each row."""
    return np.array([float(of(row).dissipation) for row in picked()])


def stiffness(picked: Callable[[], tuple[Row, ...]], of: Callable[[Row], jb.History]) -> Floats:
    """Our secant stiffness for each row."""
    return np.array([float(of(row).secant_stiffness) for row in picked()])


def heights() -> tuple[Row, ...]:
    """Rows of energy.csv: four heights at three amplitudes."""
    return tuple(
        row
        for row in rows("energy.csv")
        if row["eta"] in ("0.0305", "0.0511", "0.1126", "0.2358") and float(row["A"]) in AMPLITUDES
    )


def joints(problem: str) -> tuple[Row, ...]:
    """Rows of lap_joints.csv of one problem."""
    return tuple(row for row in rows("lap_joints.csv") if row["problem"] == problem)


def random_strips() -> tuple[Row, ...]:
    """Every sixtieth of the random strips that lose more than a thousandth of the bar."""
    losing = [
        row
        for row in rows("random_strips.csv")
        if float(row["D"]) > 1e-3 * 2.0 / 3.0 * float(row["A"]) ** 3
    ]
    return tuple(losing[::60])


def random_strip(row: Row) -> jb.History:
    """Strip of a row of random_strips.csv, in the units of its table."""
    values = {
        "strip.height_ratio": float(row["eta"]),
        "strip.poisson_ratio": float(row["nu"]),
        "contact.friction": float(row["mu"]),
        "contact.pressure": 1.0 / float(row["mu"]),
        "load.amplitude": float(row["A"]),
    }
    return solved(jb.library.standard, tuple(values.items()))


def loop_of(row: Row) -> Floats:
    """Force at the half and the whole of the displacement, up and down, of our loop."""
    force, displacement = (np.asarray(a) for a in strip(row).loop)
    return force_at(force, displacement)


def their_loop() -> Floats:
    """The same of the loop by finite elements."""
    own = [row for row in rows("loops_eta0.2358.csv") if float(row["A"]) == 1.3]
    force, displacement = column(tuple(own), "force"), column(tuple(own), "displacement")
    start = int(np.argmax(force))
    return force_at(np.roll(force[:-1], -start), np.roll(displacement[:-1], -start))


def force_at(force: Floats, displacement: Floats) -> Floats:
    """Force at seven displacements of each branch of a loop that starts at its upper turn."""
    turn = int(np.argmin(force))
    middle, half = 0.5 * (displacement[0] + displacement[turn]), 0.5 * np.ptp(displacement)
    at = middle + half * np.linspace(-0.9, 0.9, 7)
    down = np.interp(at, displacement[: turn + 1][::-1], force[: turn + 1][::-1])
    back = (np.append(a[turn:], a[0]) for a in (displacement, force))
    up = np.interp(at, *back)
    return np.append(down, up)


def pulled(direction: str) -> tuple[Row, ...]:
    """Rows of the first loading, in one direction, near five forces."""
    own = [
        row
        for row in rows("backbones.csv")
        if row["eta"] == "0.2358" and row["direction"] == direction
    ]
    force = np.abs(column(tuple(own), "force"))
    return tuple(own[int(np.argmin(np.abs(force - f)))] for f in (0.3, 0.6, 1.0, 1.4, 1.8))


def backbone(direction: str) -> Floats:
    """Our displacements there."""
    scene = jb.library.standard().replace({"strip.height_ratio": 0.2358})
    path = np.insert(column(pulled(direction), "force"), 0, 0.0)
    return np.asarray(jb.solve(scene, path).displacement)[-5:]


def receding() -> jb.History:
    """Strip 200 x 2 mm on a frictionless base, pressed over its middle by 100 MPa."""
    return jb.solve(frictionless([[0.0, 100.0], [50.0, 100.0], [50.0, 0.0], [100.0, 0.0]]))


def frictionless(pressure: list[list[float]], length: float = 100.0) -> jb.Scene:
    """Half of a steel strip, 2 mm high, on a rigid frictionless base; no section named."""
    return jb.Scene().replace(
        {
            "strip.length": length,
            "strip.half_height": 1.0,
            "strip.youngs_modulus": 2.09e5,
            "contact.friction": 0.0,
            "contact.pressure": pressure,
            "load.cycles": 0,
        }
    )


def lifted() -> Floats:
    """End of contact beyond the load's edge, largest reaction, slope of the lifted end."""
    figures = receding().figures()
    return np.array([figures["contact_end"] - 50.0, figures["reaction_max"], figures["lift_slope"]])


def squeezed() -> tuple[Floats, Floats]:
    """Places, and the mean stress through the height, of a strip squeezed over its middle."""
    history = jb.solve(jb.library.squeezed())
    return np.asarray(history.middles), np.asarray(history.squeeze_stress[0])


SQUEEZED_AT = np.array([40.0, 45.0, 49.0, 49.6, 50.4, 51.0, 55.0])


def their_squeeze() -> Floats:
    """Mean stress by finite elements, MPa."""
    picked = rows("squeeze/b2.csv")
    return np.interp(SQUEEZED_AT, column(picked, "x_mm"), column(picked, "sy_avg"))


def bent() -> Floats:
    """Deflection of a bi-material strip at 10, 50 and 90 mm."""
    history = jb.solve(jb.library.bimaterial())
    return np.interp([10.0, 50.0, 90.0], np.asarray(history.x), np.asarray(history.w[0]))


def their_bend() -> Floats:
    """The same by finite elements, for the library's pressure and modulus."""
    scene, picked = jb.library.bimaterial(), rows("squeeze/b1_stress.csv")
    layers = scene.strip.layers
    soft, pressed = float(layers[0][1]), float(np.max(np.asarray(scene.contact.pressure)))
    unit = np.interp([10.0, 50.0, 90.0], column(picked, "x_mm"), column(picked, "deflection_fe"))
    return unit * pressed / soft


def own_body() -> Floats:
    """Dissipation of a body of CalculiX's matrices on our contact."""
    body = jb.Substructure.read(data_folder() / "calculix_body.npz")
    return np.array(
        [
            float(jb.solve_contact(body, friction=0.1, amplitude=a, cycles=2).dissipation)
            for a in (0.7855, 1.3)
        ]
    )


def energy(eta: str, amplitudes: tuple[float, ...]) -> Floats:
    """Dissipation of energy.csv for one height."""
    own = [row for row in rows("energy.csv") if row["eta"] == eta]
    return np.array([float(r["D"]) for a in amplitudes for r in own if float(r["A"]) == a])


def by_entry(entry: str) -> Case:
    """Case of one entry of the force."""
    words = {
        "traction": "an even traction on the loaded face",
        "face": "a rigid face that may turn",
        "guided": "a rigid face that may not turn",
        "member": "a strip that goes on beyond the contact",
    }
    picked = functools.partial(entries, entry)
    return Case(
        f"entry {entry}",
        "finite elements",
        OWN,
        "energy lost in a cycle; two heights, two coefficients of friction",
        f"plane strain; {words[entry]}",
        lambda: column(picked(), "D"),
        lambda: dissipation(picked, strip),
        0.01,
    )


CASES = (
    Case(
        "strips of four heights",
        "finite elements",
        OWN,
        "energy lost in a cycle, eta = .03 to .24, three amplitudes",
        EVEN,
        lambda: column(heights(), "D"),
        lambda: dissipation(heights, strip),
        0.01,
    ),
    Case(
        "random strips",
        "finite elements",
        OWN,
        "energy lost in a cycle, strips drawn over height, force, friction and Poisson's ratio",
        EVEN,
        lambda: column(random_strips(), "D") / 3.4e4,
        lambda: dissipation(random_strips, random_strip),
        0.02,
        explained="their coarse meshes are 1 % off where little slips",
    ),
    Case(
        "loop of a strip",
        "finite elements",
        OWN,
        "force at seven displacements of each branch of the steady loop, eta = .24, A = 1.3",
        EVEN,
        their_loop,
        lambda: loop_of({"eta": "0.2358", "A": "1.3"}),
        0.01,
        each=False,
    ),
    Case(
        "first pull",
        "finite elements",
        OWN,
        "end displacement of the first loading by a pull, five forces, eta = .24",
        EVEN,
        lambda: column(pulled("pull"), "displacement"),
        lambda: backbone("pull"),
        0.01,
    ),
    Case(
        "first push",
        "finite elements",
        OWN,
        "end displacement of the first loading by a push, five forces, eta = .24",
        EVEN,
        lambda: column(pulled("push"), "displacement"),
        lambda: backbone("push"),
        0.01,
    ),
    *map(by_entry, ("traction", "face", "guided", "member")),
    Case(
        "stiffness by entry",
        "finite elements",
        OWN,
        "secant stiffness at the point that the force moves; a rigid face and a long member",
        "plane strain; how the force enters",
        lambda: column(entries("face") + entries("member"), "K_conjugate"),
        lambda: stiffness(lambda: entries("face") + entries("member"), strip),
        0.01,
    ),
    Case(
        "double shear, energy",
        "finite elements",
        OWN,
        "energy lost in a cycle of a strip on an inner member, two heights, six amplitudes",
        "plane strain; even traction; rolling inner member",
        lambda: column(joints("double-shear"), "D"),
        lambda: dissipation(lambda: joints("double-shear"), lap),
        0.01,
    ),
    Case(
        "double shear, stiffness",
        "finite elements",
        OWN,
        "secant stiffness of the same joints",
        "plane strain; even traction; rolling inner member",
        lambda: column(joints("double-shear"), "K_sec"),
        lambda: stiffness(lambda: joints("double-shear"), lap),
        0.01,
    ),
    Case(
        "single lap",
        "finite elements",
        OWN,
        "energy lost in a cycle, and secant stiffness; contact breathes",
        "plane strain; pressed with friction; loaded end guided",
        lambda: np.concatenate([column(joints("single-lap"), k) for k in ("D", "K_sec")]),
        lambda: np.concatenate(
            [f(lambda: joints("single-lap"), lap) for f in (dissipation, stiffness)]
        ),
        0.01,
    ),
    Case(
        "strips of CalculiX",
        "finite elements",
        CALCULIX,
        "energy lost in a cycle, two heights, three amplitudes",
        "plane strain; even traction; their stick stiffness 100 E'/H",
        [7.211287783539165e-06, 7.519285338754579e-05, 8.525875385123236e-06],
        lambda: np.array(
            [
                float(strip({"eta": eta, "A": a}).dissipation)
                for eta, a in (("0.1126", "0.7855"), ("0.1126", "1.6"), ("0.2358", "1.0"))
            ]
        ),
        0.01,
    ),
    Case(
        "bolted single lap of CalculiX",
        "finite elements",
        CALCULIX,
        "energy lost in a cycle, and secant stiffness, two bolts; finest of three meshes",
        "plane strain; even traction; pressed without friction",
        [9.48278980231488e-07, 19864.375219231908],
        lambda: bolted("traction"),
        0.01,
    ),
    Case(
        "bolted single lap that goes on, of CalculiX",
        "finite elements",
        CALCULIX,
        "energy lost in a cycle, and secant stiffness; finest of three meshes",
        "plane strain; both members go on beyond the contact; pressed without friction",
        [1.276347552167655e-06, 17834.716913322172],
        lambda: bolted("member"),
        0.01,
    ),
    Case(
        "bolted flange of CalculiX",
        "finite elements",
        CALCULIX,
        "energy lost in a cycle, secant stiffness, and open area at the turn",
        "two plates of bricks on 171 pairs of nodes, two washers; same bricks and softness of the "
        "contact; both of a study's record, as it takes CalculiX",
        functools.partial(flange, "calculix"),
        functools.partial(flange, "here"),
        0.002,
    ),
    Case(
        "a body of CalculiX's matrices",
        "finite elements",
        OWN,
        "energy lost in a cycle, bricks condensed by CalculiX on our contact, two amplitudes",
        "plane strain by two planes of bricks; a mesh of 1/24 of the length at the corner",
        lambda: energy("0.1126", (0.7855, 1.3)),
        own_body,
        0.03,
        explained="the bricks are coarse at the corner; the run doubts itself",
    ),
    Case(
        "receding contact",
        "finite elements",
        OWN,
        "end of contact beyond the load, largest reaction, slope of the lifted end",
        "plane strain; no friction",
        [0.779, 103.12, 1.9858e-4],
        lifted,
        0.01,
    ),
    Case(
        "squeezed strip",
        "finite elements",
        OWN,
        "mean stress through the height at seven places about a load's edge",
        "plane strain; no base; one squeeze strain through the height, kappa_s = .44",
        their_squeeze,
        lambda: np.interp(SQUEEZED_AT, *squeezed()),
        0.03,
        each=False,
        explained="one squeeze strain decays as an exponential and has no tension beyond the edge",
    ),
    Case(
        "bi-material strip",
        "finite elements",
        OWN,
        "deflection of two layers under an even squeeze at 10, 50 and 90 mm",
        "plane stress",
        their_bend,
        bent,
        0.01,
        each=False,
    ),
)

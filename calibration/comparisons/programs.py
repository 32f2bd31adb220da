"""Other programs: what their makers publish of them, and what was run for this project."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import jbeamshell as jb
from calibration.comparisons import bodies
from calibration.comparisons.case import Case, Floats, Source
from calibration.comparisons.closed_forms import cylinder
from calibration.comparisons.measured import recorded
from jbeamshell import dynamics, laws, reference

CONTACT = Source(
    "E. Vollebregt, CONTACT, case cattaneo, https://github.com/eve70a/CONTACT at d431cdb",
    "Apache-2.0, one figure quoted from examples/cattaneo.ref_out",
)
LEVEL_SET = Source(
    "I. Llavori, LevelSetWear, https://github.com/illavori/LevelSetWear at f5a3cad, "
    "figures/fig11_surface_mindlin, contact_standard.csv and contact_level_set.csv",
    "BSD-3-Clause, figures quoted, means of both sides",
)
FRONTISTR = Source(
    "FrontISTR, NAFEMS contact patch test CGS-4, "
    "https://gitlab.com/FrontISTR-Commons/FrontISTR/-/merge_requests/599",
    "MIT (its License.txt was read), figures quoted",
    "Read in the text of the merge request; the case is not in the repository, so it was not run.",
)
TMDSIMPY = Source(
    "J. H. Porter, tmdsimpy, https://github.com/tmd-lab/tmdsimpy at 17d5fc3; its VectorIwan4 with "
    "1000 sliders was run over 4096 points of a cosine",
    "MIT, figures of own runs",
)
EPMC = Source(
    "J. H. Porter, tmdsimpy, https://github.com/tmd-lab/tmdsimpy at 17d5fc3, "
    "examples/structures/results/brb_epmc_flat.yaml and brb_epmc_meso.yaml",
    "MIT; derived figures only",
)
OPENSEES = Source(
    "OpenSees 3.7.1 (openseespy 3.7.1.2), uniaxialMaterial BoucWen in 4000 steps for each branch",
    "figures of own runs",
)
PYHARM = Source(
    "Safran, pyHarm 1.2.2 (pyharm-os on PyPI), element Jenkins, harmonics 0 to 9, 1024 samples, "
    "each frequency solved from its linear start",
    "Apache-2.0, figures of own runs",
)
ELASTIC_DRY = Source(
    "J. H. Porter, tmdsimpy, https://github.com/tmd-lab/tmdsimpy at 17d5fc3, its "
    "ElasticDryFriction3D over 32 points of a cycle",
    "MIT, figures of own runs",
    "Its limit is a square of the two directions, ours a circle: the path keeps to one direction.",
)
SLOPE, FRICTION = 0.1, 0.3  # of the patch test
PAIR_STIFFNESS = 4.0, 5.0  # tangential and normal
PAIR_FORCES = [
    1.967810624741,
    1.711490422038,
    1.302108728029,
    0.8715098052281,
    0.5523532823524,
    0.3062508947862,
    0.02692093572899,
    -0.09213802960766,
    0.05038192826017,
    0.02486899400358,
    0.0,
    0.0,
    -0.0,
    -0.0,
    -0.0,
    -0.0,
    -0.1321893752586,
    -0.2127736466739,
    -0.1978912719709,
    -0.20422612606,
    -0.2080018699122,
    0.03810051765399,
    0.3174304767112,
    0.4364894420478,
    0.29396948418,
    -0.08274873198061,
    -0.546031049793,
    -0.8785453496788,
    -0.8688667112679,
    -0.3865583255799,
    0.5687253916304,
    1.860861668566,
]  # tangential forces of a pair that slips, lifts and touches again
IWAN = (1000.0, 2e6, -0.5, 0.3)  # F_S, K_T, chi, beta
AMPLITUDES = np.array([1e-4, 3e-4, 6e-4, 9e-4, 2e-3])
PLACES = np.array([0.0, 0.328458, 0.547429, 0.766401])  # over half of the width of the contact
ABAQUS = [0.29451, 0.31995, 0.38492, 0.61452, 0.02710, 0.03453, 0.05597, 0.16861, 0.99760]
IMMERSED = [0.29313, 0.31859, 0.39064, 0.63802, 0.02665, 0.03419, 0.06287, 0.17577, 0.99705]
DRIVEN = {0.1: (1.1, 1.15, 1.2, 1.25, 1.3), 0.4: (0.9, 1.0, 1.05, 1.1, 1.3)}  # rad/s by force
TURNS = np.array([0.05, -0.03, 0.04, -0.05, 0.05])  # nested reversals


def patch_test() -> float:
    """Force over weight that moves a block up a slope, from our friction over normal force."""
    pressed = 10.0
    values = {"contact.friction": FRICTION, "contact.pressure": pressed, "load.entry": "traction"}
    driven = {"load.control": "displacement", "load.amplitude": 2e-3, "strip.far_end": "free"}
    history = jb.solve(jb.Scene().replace(values | driven))
    ratio = float(np.max(history.force)) / (pressed * float(history.scene.strip.length))
    return (SLOPE + ratio) / (1.0 - ratio * SLOPE)


def sphere() -> float:
    """Shift of a sphere, mm, at .875 of gross slip."""
    slip = 0.4 * 9.195
    law = reference.sphere_law(slip, 1.0, reference.pair_compliance(200.0, 0.42))
    return float(law.displacement(0.875 * slip))


def sheared() -> Floats:
    """Shear of a cylinder at `PLACES`, at half of gross slip and back at no force, and pressure."""
    history = cylinder()
    start, turn, _ = history.cycles[-1]
    rest = start + int(np.argmin(np.abs(np.asarray(history.force[start : turn + 1]))))
    x = np.asarray(history.places)
    peak = bodies.FRICTION * 2.0 / np.pi  # Hertz, for a load of 1 on 2
    sense = np.sign(np.asarray(history.traction[start, x.size // 2]))
    shear = [
        0.5 * (np.interp(PLACES, x, row) + np.interp(-PLACES, x, row)) * sense / peak
        for row in np.asarray(history.traction)[[start, rest]]
    ]
    return np.append(shear, np.max(np.asarray(history.reaction[0])) * np.pi / 2.0)


def iwan() -> Floats:
    """Energy of a cycle, and largest force, of five amplitudes."""
    law = laws.Iwan4(*IWAN)
    return np.append(law.dissipation(AMPLITUDES), law.backbone(AMPLITUDES))


def bouc_wen() -> Floats:
    """Forces at the turns, for straight and for bent unloading."""
    forces = [
        laws.BoucWen(
            slip_force=1.2, stiffness=50.0, exponent=2.0, unloading=bend, hardening=0.1
        ).path_forces(TURNS)
        for bend in (0.5, 0.8)
    ]
    return np.concatenate([np.asarray(force) for force in forces])


def oscillator() -> Floats:
    """Amplitude of a unit mass on a spring and a slider, below, at and above its resonance."""
    slider = dynamics.Attachment(laws.Jenkins(slip_force=0.3, stiffness=0.6), 0)
    structure = dynamics.Structure([[1.0]], [[1.0]], [slider], damping=[[0.02]])
    ends = [(force, omega / (2.0 * np.pi)) for force, row in DRIVEN.items() for omega in row]
    return np.array(
        [
            dynamics.forced_response(structure, [force], (0.98 * end, end)).amplitude[-1]
            for force, end in ends
        ]
    )


def pair() -> Floats:
    """Tangential forces of one pair of a face, on the loads that move it along their path."""
    angle = 2.0 * np.pi * np.arange(32) / 32
    slip = 0.9 * np.sin(angle) + 0.3 * np.sin(3.0 * angle + 0.4)
    closing = 0.5 + 0.8 * np.cos(angle + 0.7) + 0.2 * np.cos(4.0 * angle)
    pressed = PAIR_STIFFNESS[1] * np.maximum(closing, 0.0)
    # On springs of 1.
    body = jb.Substructure([[0.0, 0.0, 0.0]], np.eye(3), np.diag([1.0, 1.0, -1.0]))
    loads = np.column_stack([slip + PAIR_FORCES, 0.0 * slip, closing + pressed])
    softness = 1.0 / np.array(PAIR_STIFFNESS)
    history = jb.solve_contact(
        body, friction=FRICTION, bolts=[0.0, 1.0], softness=softness, path=np.tile(loads, (2, 1))
    )
    return np.asarray(history.friction_force[-32:, 0, 0])


def beam(kind: str, what: str) -> tuple[Callable[[], Floats], Callable[[], Floats]]:
    """One, and the recorded ratio of ours to theirs, at the amplitudes that were not fitted."""

    def ratio() -> Floats:
        return np.array(recorded("backbones")[kind][f"{what}_over_theirs"])

    return lambda: np.ones_like(ratio()), ratio


def backbone(kind: str, what: str, bound: float, explained: str = "") -> Case:
    """Case of one computed curve of the bolted beam."""
    surface = {"flat": "flat", "meso": "measured, wavy"}[kind]
    return Case(
        f"beam of tmdsimpy, {kind}, {what}",
        "other program",
        EPMC,
        f"{what} over theirs at every other of the amplitudes, over three decades",
        f"first mode of the Brake-Reuss beam, {surface} interface of rough contact; one mode with "
        "an Iwan element",
        *beam(kind, what),
        bound,
        explained=explained,
        fitted="the other half of the amplitudes, frequency and damping together",
        held_out=0.5,
    )


CASES = (
    Case(
        "contact patch test of FrontISTR",
        "other program",
        FRONTISTR,
        "force over weight at which a block slides up a slope of .1, mu = .3",
        "equilibrium of the block; our friction force of gross slip, driven by displacement",
        [0.412168, 0.412371],  # FrontISTR, closed form
        lambda: [patch_test()] * 2,
        0.002,
    ),
    Case(
        "shift of a sphere by CONTACT",
        "other program",
        CONTACT,
        "tangential shift at .875 of gross slip",
        "half-spaces, G = 200 MPa, nu = .42; their grid of elements, our closed form",
        8.155e-3,
        sphere,
        0.005,
    ),
    *(
        Case(
            f"cylinder of {name}",
            "other program",
            LEVEL_SET,
            "shear over the coefficient of friction and the largest pressure of Hertz, at four "
            "places, at half of gross slip and back at no force; largest pressure likewise",
            f"{what}, 18 elements over the contact; our half-planes of equal material on 161 nodes",
            theirs,
            sheared,
            bound,
            each=False,
            explained="their elements are wide at the ends of the zones of slip",
        )
        for name, what, theirs, bound in (
            ("Abaqus", "contact by penalty", ABAQUS, 0.04),
            ("LevelSetWear", "immersed contact, dual mortars", IMMERSED, 0.03),
        )
    ),
    Case(
        "four-parameter Iwan of tmdsimpy",
        "other program",
        TMDSIMPY,
        "energy of a cycle, and largest force, five amplitudes from micro-slip to gross slip",
        "F_S = 1 kN, K_T = 2 kN/mm, chi = -.5, beta = .3; their sliders, our closed form",
        [
            0.0025617594539495553,
            0.03992707991827644,
            0.22585498419751968,
            0.6223789142194102,
            4.759013301897151,
            167.9865552786903,
            433.6461874382949,
            729.4775909195557,
            935.593769244408,
            1000.0015036544809,
        ],
        iwan,
        0.001,
    ),
    Case(
        "one pair of tmdsimpy's elastic dry friction",
        "other program",
        ELASTIC_DRY,
        "tangential force over a cycle in which the pair slips, lifts and touches again",
        "softness 1/4 and 1/5, mu = .3, one direction of slip; our forces from the loads that "
        "move the pair along the same path",
        PAIR_FORCES,
        pair,
        1e-10,
        each=False,
    ),
    backbone("flat", "frequency", 0.005),
    backbone("flat", "damping", 0.25, "theirs grows faster than any law of sliders with chi <= 0"),
    backbone("meso", "frequency", 0.01),
    backbone(
        "meso",
        "damping",
        0.75,
        "patches of a wavy interface let go one by one; damping grows nearly with the square of "
        "the amplitude, and no law of sliders with chi <= 0 does",
    ),
    Case(
        "slider under vibration of pyHarm",
        "other program",
        PYHARM,
        "amplitude of a unit mass on a spring and a slider, five frequencies under each of two "
        "forces, .1 in micro-slip and .4 in gross slip",
        "k = 1, c = .02, slider of stiffness .6 that slips at .3; theirs harmonic balance of all "
        "harmonics, ours of the odd ones",
        [
            0.25600326375521393,
            0.35912894046648886,
            0.6175197345101072,
            0.6320241215043271,
            0.5741713438898914,
            0.5070428746903374,
            1.8993348119523423,
            3.0128509951024336,
            2.100762467339873,
            0.9420196654482207,
        ],
        oscillator,
        0.001,
    ),
    Case(
        "Bouc-Wen of OpenSees",
        "other program",
        OPENSEES,
        "force at the turns of nested reversals, straight and bent unloading",
        "n = 2, a tenth of the stiffness remains; their steps, our exact path",
        [
            1.2969753958166144,
            -1.211008236611767,
            1.2357220506443574,
            -1.3218661804219585,
            1.3262080651866832,
            1.2969753958166144,
            -1.2155470994975608,
            1.2463481915429575,
            -1.3236920843161306,
            1.3271607780458827,
        ],
        bouc_wen,
        0.001,
    ),
)

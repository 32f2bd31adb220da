"""Scenes of all kinds, for verification/gradients.py; values are as `strip.changed` reads them."""

from typing import Any

Values = dict[str, Any]

FEW = {"model.nodes": 17, "load.steps_per_half_cycle": 4, "load.cycles": 1}
STEPS = FEW | {"by": "steps", "model.kinematics": "linear", "contact.normal": "held"}
EXACT = STEPS | {"model.kinematics": "exact"}
LINE = FEW | {"model.section": "squeeze", "model.kinematics": "linear"}
LIFT = {"contact.normal": "rigid"}
SMOOTH = {"contact.smoothing": 8.0}
SOFT = {"contact.stick_stiffness": 100.0}
TABLE_OF_STEPS = {
    "contact.pressure": [[0.0, 0.0], [0.3, 0.0], [0.3, 12.0], [1.3, 8.0], [1.3, 0.0], [2.0, 0.0]],
    "load.amplitude": 0.3,
}
BOTH_FACES = {
    "contact.pressure": [[0.0, 8.0], [1.0, 12.0], [2.0, 9.0]],
    "contact.bottom_pressure": [[0.0, 1.0], [1.2, 3.0], [2.0, 1.5]],
}
LAYERS = {
    "strip.layers": [[0.05, 2e5, 0.2], [0.1, 1e5, 0.35], [0.0752, 3e5, 0.25]],
}
DISPLACED = {"load.control": "displacement", "load.amplitude": 1.5e-5}
DOUBLE = {
    "member.support": "rolling",
    "strip.far_end": "free",
    "member.height_ratio": 0.09,
    "member.axial_stiffness": 3e4,
    "member.poisson_ratio": 0.25,
}
SINGLE = DOUBLE | {
    "member.support": "clamped",
    "member.loaded_end": "level",
    "strip.overhang": 0.5,
    "member.overhang": 0.4,
}
BOLTS = {"contact.bolts": [[0.5, 5.0, 0.4], [1.4, 6.0, 0.5]], "load.amplitude": 0.3}
SETTINGS: dict[str, Values] = {
    "contact line, squeeze": LINE,
    "contact line, shell": FEW | {"model.section": "shell", "model.kinematics": "linear"},
    "contact line, soft sliders": LINE | SOFT,
    "contact line, displacement": LINE | DISPLACED,
    "contact line, steps of pressure": FEW | TABLE_OF_STEPS,
    "contact line, both faces": FEW | BOTH_FACES | SOFT,
    "contact line, layers": FEW | LAYERS | SOFT,
    "plane": FEW | {"model.section": "plane"},
    "plane, traction": FEW | {"model.section": "plane", "load.entry": "traction"},
    "plane, face": FEW | {"model.section": "plane", "load.entry": "face"},
    "plane, guided": FEW | {"model.section": "plane", "load.entry": "guided"},
    "plane, overhang": FEW | {"model.section": "plane", "strip.overhang": 0.3},
    "bar": FEW | {"model.section": "bar"},
    "load steps, sharp": STEPS,
    "load steps, smooth": STEPS | SMOOTH,
    "load steps, shell": STEPS | {"model.section": "shell"},
    "exact sharp": EXACT,
    "exact smooth that lifts": EXACT | SMOOTH | LIFT,
    "exact sharp that lifts": EXACT | LIFT,
    "lift, steps of pressure": STEPS | LIFT | TABLE_OF_STEPS,
    "lift, both faces, curved": EXACT | LIFT | BOTH_FACES | {"strip.curvature": 1e-4},
    "exact, layers": EXACT | LAYERS,
    "load steps, displacement": STEPS | DISPLACED,
    "exact, arc length": EXACT | DISPLACED | {"load.control": "arc-length"},
    "collocation": EXACT | {"model.grid": "collocation"},
    "assumed squeeze": EXACT | LIFT | {"model.section": "assumed"},
    "printed constants": STEPS | {"model.constants": "printed"},
    "compliant base": EXACT | {"contact.normal": "compliant"},
    "pinned": FEW | SOFT | {"strip.far_end": "pinned"},
    "plane stress, free": STEPS | {"strip.far_end": "free", "strip.plane": "stress"},
    "double shear": FEW | DOUBLE,
    "single lap with bolts": FEW
    | SINGLE
    | BOLTS
    | {
        "member.bearing_stiffness": 2.0,
        "member.clearance": 2e-6,
        "member.bolt_stiffness": 1.0,
        "load.arm": 0.05,
    },
    "lap with a gap, moment": FEW
    | SINGLE
    | {
        "contact.bottom_pressure": 10.0,
        "member.gap": [[0.0, 0.0], [0.9, 2e-6], [2.0, 0.0]],
        "load.kind": "moment",
        "load.amplitude": 0.3,
    },
    "plane lap": FEW | DOUBLE | {"model.section": "plane"},
}
# Distances for numbers that are zero, or small beside what they are added to.
SIZES = {
    "strip.curvature": 1e-4,
    "contact.bottom_pressure": 1.0,
    "member.gap": 1e-6,
}

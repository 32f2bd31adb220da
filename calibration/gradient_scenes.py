"""Scenes of all kinds, for calibration/gradients.py."""

from typing import Any

Values = dict[str, Any]

FEW = {"model.nodes": 17, "load.steps_per_half_cycle": 4, "load.cycles": 1}
STEPWISE = FEW | {"model.solution": "stepwise", "model.kinematics": "linear"}
EXACT = STEPWISE | {"model.kinematics": "exact"}
LIFT = {"model.section": "squeeze"}
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
    "strip.loaded_end": "level",
    "strip.overhang": 0.5,
    "member.overhang": 0.4,
}
BOLTS = {"contact.bolts": [[0.5, 5.0, 0.4], [1.4, 6.0, 0.5]], "load.amplitude": 0.3}
SETTINGS: dict[str, Values] = {
    "condensed squeeze": FEW,
    "condensed shell": FEW | {"model.section": "shell", "model.kinematics": "linear"},
    "condensed p2": FEW | {"model.section": "p2", "model.kinematics": "linear"},
    "condensed, soft sliders": FEW | SOFT,
    "condensed, displacement": FEW | DISPLACED,
    "condensed, steps of pressure": FEW | TABLE_OF_STEPS,
    "condensed, both faces": FEW | BOTH_FACES | SOFT,
    "condensed, layers": FEW | LAYERS | SOFT,
    "plane": FEW | {"model.section": "plane"},
    "plane, traction": FEW | {"model.section": "plane", "load.entry": "traction"},
    "plane, face": FEW | {"model.section": "plane", "load.entry": "face"},
    "plane, guided": FEW | {"model.section": "plane", "load.entry": "guided"},
    "plane, overhang": FEW | {"model.section": "plane", "strip.overhang": 0.3},
    "bar": FEW | {"model.section": "bar"},
    "stepwise sharp": STEPWISE,
    "stepwise smooth": STEPWISE | SMOOTH,
    "stepwise shell": STEPWISE | {"model.section": "shell"},
    "exact sharp": EXACT,
    "exact smooth that lifts": EXACT | SMOOTH | LIFT,
    "exact sharp that lifts": EXACT | LIFT,
    "lift, steps of pressure": STEPWISE | LIFT | TABLE_OF_STEPS,
    "lift, both faces, curved": EXACT | LIFT | BOTH_FACES | {"strip.curvature": 1e-4},
    "exact, layers": EXACT | LAYERS,
    "stepwise, displacement": STEPWISE | DISPLACED,
    "exact, arc length": EXACT | DISPLACED | {"load.control": "arc-length"},
    "stepwise p2": STEPWISE | {"model.section": "p2", "load.entry": "guided"},
    "stepwise p3, exact": EXACT | {"model.section": "p3", "load.entry": "face"},
    "collocation": EXACT | {"model.grid": "collocation"},
    "assumed squeeze": EXACT | LIFT | {"model.section": "assumed"},
    "printed constants": STEPWISE | {"model.constants": "printed"},
    "compliant base": EXACT | LIFT | {"contact.normal": "compliant"},
    "pinned": FEW | SOFT | {"strip.far_end": "pinned"},
    "plane stress, free": STEPWISE | {"strip.far_end": "free", "strip.plane": "stress"},
    "double shear": FEW | DOUBLE,
    "single lap with bolts": FEW
    | SINGLE
    | BOLTS
    | {
        "contact.bearing_stiffness": 2.0,
        "contact.clearance": 2e-6,
        "contact.bolt_stiffness": 1.0,
        "load.arm": 0.05,
    },
    "lap with a gap, moment": FEW
    | SINGLE
    | {
        "contact.bottom_pressure": 10.0,
        "contact.gap": [[0.0, 0.0], [0.9, 2e-6], [2.0, 0.0]],
        "load.kind": "moment",
        "load.amplitude": 0.3,
    },
    "plane lap": FEW | DOUBLE | {"model.section": "plane"},
}
# Distances for numbers that are zero, or small beside what they are added to.
SIZES = {
    "strip.curvature": 1e-4,
    "contact.bottom_pressure": 1.0,
    "contact.gap": 1e-6,
}

"""A sweep of few lanes and load steps, whose one program the tests of this folder share."""

import numpy as np
from toy import STRIP

TINY = {
    "model.nodes": 9,
    "model.kinematics": "linear",
    "load.steps_per_half_cycle": 2,
    "load.cycles": 1,
}
SCENE = STRIP.replace(TINY)
FIGURES = ("dissipation", "dissipation_ratio", "secant_stiffness", "reaction_max")
MANY = {  # twelve blocks
    "load.amplitude": np.linspace(0.2, 1.9, 12),
    "strip.height_ratio": np.geomspace(0.05, 0.4, 8),
}


def same(one, other):
    """To the last bit."""
    assert one.equals(other)

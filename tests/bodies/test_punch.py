"""Rounded punch on a face beside the closed form, see `calibration.finite_elements.punch`."""

import numpy as np
import pytest

from calibration.finite_elements.punch import (
    FORCE,
    FRICTION,
    HALF_WIDTH,
    WIDTH,
    bodies,
    loop,
    loss,
)


@pytest.mark.slow
def test_a_rounded_punch_is_that_of_cattaneo_and_mindlin():
    made = bodies(12)
    # At .3 of gross slip one element slips, at .6 two and at .9 four.
    for part, within in ((0.3, 0.07), (0.6, 0.02), (0.9, 0.02)):
        force = part * FRICTION * FORCE
        history = loop(made, force)
        peak = np.max(history.reaction[0])
        assert peak == pytest.approx(2.0 * FORCE / (np.pi * HALF_WIDTH), rel=0.005)
        off = abs(float(history.dissipation) / (WIDTH * loss(force)) - 1.0)
        assert off < within
        assert 0.9 * off < history.dissipation_error < 0.5  # told a twentieth too small at .3

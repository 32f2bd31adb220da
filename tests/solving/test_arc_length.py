"""Arc-length control: past gross slip and back, on the path of the other controls."""

import numpy as np
import pytest
from toy import STRIP

import jbeamshell as jb

SMALL = {"model.nodes": 21, "load.steps_per_half_cycle": 8, "load.cycles": 1}
FREE = {"strip.far_end": "free", "load.control": "arc-length", "load.amplitude": 3e-4}


def scene(values):
    return STRIP.replace(SMALL | values)


@pytest.mark.slow
@pytest.mark.doubtful("measured along the load steps")
def test_it_goes_over_gross_slip_as_the_displacement_does():
    history = jb.solve(scene(FREE))
    force, displacement = map(np.asarray, (history.force, history.displacement))
    assert displacement.max() > 1.5e-4
    np.testing.assert_allclose(force.max(), 2.0, rtol=1e-9)  # mu F_N L
    np.testing.assert_allclose(force.min(), -2.0, rtol=1e-9)
    assert abs(float(history.closure)) < 1e-9
    held = scene(FREE | {"load.control": "displacement"})
    again = jb.solve(held, displacement[1:], throw=False)
    np.testing.assert_allclose(again.force, force, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(again.slip_work, history.slip_work, rtol=1e-6, atol=1e-12)


def test_steps_are_as_long_as_asked():
    history = jb.solve(scene(FREE), 3e-5 * np.arange(1, 21))
    u, f = np.asarray(history.displacement), np.asarray(history.force) * 2.0 / 3.4e4
    gone = np.hypot(np.diff(u), np.diff(f))
    assert np.all(gone >= 3e-5 * (1.0 - 1e-9))  # the plane stands off the arc where the path bends
    np.testing.assert_allclose(gone[-1], 3e-5, rtol=1e-6)  # and is met where it is straight


@pytest.mark.slow
@pytest.mark.doubtful("measured along the load steps")
def test_below_gross_slip_it_is_the_path_of_the_force():
    values = {"load.control": "arc-length", "load.amplitude": 8e-5, "model.kinematics": "linear"}
    history = jb.solve(scene(values))
    pulled = jb.solve(
        scene({"model.kinematics": "linear"}), np.asarray(history.force)[1:], throw=False
    )
    np.testing.assert_allclose(pulled.displacement, history.displacement, rtol=1e-7, atol=1e-13)

"""Arc-length control: past gross slip and back, on the path of the other controls."""

import numpy as np
import pytest
from scenes import STEPPED

import jbeamshell as jb

ALONG = {"load.control": "arc-length", "load.amplitude": 3e-4}
FREE = {"strip.far_end": "free"}


def test_steps_are_as_long_as_asked_also_beyond_gross_slip():
    bar = STEPPED.replace(ALONG | FREE | {"model.section": "bar"})  # compiles soonest
    history = jb.solve(bar, 3e-5 * np.arange(1, 21), throw=False)
    u, f = np.asarray(history.displacement), np.asarray(history.force) * 2.0 / 3.4e4
    gone = np.hypot(np.diff(u), np.diff(f))
    assert np.all(gone >= 3e-5 * (1.0 - 1e-9))  # the plane stands off the arc where the path bends
    np.testing.assert_allclose(gone[-1], 3e-5, rtol=1e-6)  # and is met where it is straight
    np.testing.assert_allclose(history.force[-1], 2.0, rtol=1e-9)  # mu F_N L


@pytest.mark.slow
@pytest.mark.doubtful("measured along the load steps")
def test_it_goes_over_gross_slip_as_the_displacement_does():
    history = jb.solve(STEPPED.replace(ALONG | FREE | {"model.kinematics": "exact"}))
    force, displacement = map(np.asarray, (history.force, history.displacement))
    assert displacement.max() > 1.5e-4
    np.testing.assert_allclose(force.max(), 2.0, rtol=1e-9)
    np.testing.assert_allclose(force.min(), -2.0, rtol=1e-9)
    assert abs(float(history.closure)) < 1e-9
    held = history.scene.replace({"load.control": "displacement", "load.amplitude": 1.5e-4})
    again = jb.solve(held, displacement[1:], throw=False)
    np.testing.assert_allclose(again.force, force, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(again.slip_work, history.slip_work, rtol=1e-6, atol=1e-12)


@pytest.mark.slow
@pytest.mark.doubtful("measured along the load steps")
def test_below_gross_slip_it_is_the_path_of_the_force():
    history = jb.solve(STEPPED.replace(ALONG | {"load.amplitude": 8e-5}))
    pulled = jb.solve(STEPPED, np.asarray(history.force)[1:], throw=False)
    np.testing.assert_allclose(pulled.displacement, history.displacement, rtol=1e-7, atol=1e-13)

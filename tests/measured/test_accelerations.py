"""Accelerations give the displacement of a vibration, without its zero."""

import numpy as np
import pytest

from jbeamshell.common.errors import InputError
from jbeamshell.measured.accelerations import displacement_of
from jbeamshell.measured.loop_files import read_loops
from jbeamshell.measured.steady import steady_loops
from tests import rig

TIME = 1e-3 * np.arange(2000)
RATE = 2.0 * np.pi * 12.5  # 25 periods of 80 points


def motion(order=3):
    """Displacement [m] of two harmonics, and its acceleration."""
    parts = [(2e-4, RATE, 0.0), (2e-5, order * RATE, 0.7)]
    u = sum(size * np.sin(w * TIME + lag) for size, w, lag in parts)
    return u, sum(-size * w**2 * np.sin(w * TIME + lag) for size, w, lag in parts)


@pytest.mark.parametrize("order", [2, 3])
def test_a_vibration_is_found_from_its_acceleration(order):
    u, acceleration = motion(order)
    biased = acceleration + 0.3 + 0.5 * TIME  # a sensor that drifts
    found, known = displacement_of(biased, TIME, "rig")
    np.testing.assert_allclose(found[known], u[known], atol=0.005 * np.ptp(u))
    assert 160 <= known.start <= 162
    assert known.stop == u.size - known.start


def test_a_file_of_accelerations_gives_the_loop(tmp_path):
    u, acceleration = motion()
    force = 40.0 * rig.iwan(u / np.max(u))
    rows = np.column_stack([TIME, force, acceleration / 9.80665])
    path = tmp_path / "rig.csv"
    head = "Zeit [s];Kraft [N];Beschleunigung [g]"
    np.savetxt(path, rows, delimiter=";", header=head, comments="", encoding="utf-8")
    (recording,) = read_loops(path)
    assert recording.units == {"force": "N", "displacement": "m", "time": "s"}
    assert "integrated twice" in recording.notes[-1]
    cut = (u.size - recording.force.size) // 2
    np.testing.assert_allclose(recording.displacement, u[cut:-cut], atol=0.01 * np.ptp(u))
    (loop,) = steady_loops(recording, "displacement")
    whole = recording.but(displacement=u[cut:-cut])
    assert loop.work == pytest.approx(steady_loops(whole, "displacement")[0].work, rel=0.05)


@pytest.mark.parametrize(
    ("time", "points", "told"),
    [
        (None, 2000, "cannot be integrated to a displacement: give the displacement itself"),
        (TIME**2, 2000, "uneven steps"),
        (TIME[:400], 400, "holds about 5 periods: record 8 or more"),
    ],
)
def test_accelerations_that_cannot_be_integrated_are_refused(time, points, told):
    with pytest.raises(InputError, match=told):
        displacement_of(motion()[1][:points], time, "rig")

"""Four parameters through curves."""

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.laws import Iwan4, iwan4_through

FORCE = 2.0 * np.array([0.1, 0.2, 0.4, 0.6, 0.8, 0.95])


def test_planted_parameters_come_back():
    law = Iwan4(slip_force=2.0, stiffness=70.0, chi=-0.35, beta=0.6)
    u = np.asarray(law.displacement(FORCE))
    found = iwan4_through(2.0, 80.0, FORCE, u, np.asarray(law.dissipation(u)))
    numbers = [float(found.get(f"iwan4.{name}")) for name in ("stiffness", "chi", "beta")]
    assert numbers == pytest.approx([70.0, -0.35, 0.6], rel=1e-4)


@pytest.mark.parametrize(
    ("slip", "stiffest", "u", "complaint"),
    [
        (1.0, 80.0, FORCE / 50.0, "forces below the slip force"),
        (2.0, 80.0, -FORCE, "positive numbers"),
        (2.0, 80.0, FORCE[:3], "positive numbers"),
        (2.0, 40.0, FORCE / 50.0, "stiffest = 40.0: must be a number, 50 or more"),
    ],
)
def test_curves_that_are_none_are_refused(slip, stiffest, u, complaint):
    curves = [FORCE, u, FORCE] if u.size == FORCE.size else [FORCE[:3], u, [1.0, 0.0, 1.0]]
    with pytest.raises(jb.InputError, match=complaint):
        iwan4_through(slip, stiffest, *curves)

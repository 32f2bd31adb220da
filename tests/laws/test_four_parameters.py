"""Four parameters through curves, and of a strip by short formulas."""

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.laws import Iwan4, iwan4_of_strip, iwan4_through

FORCE = 2.0 * np.array([0.1, 0.2, 0.4, 0.6, 0.8, 0.95])
MIDDLE = [[0.5, 0.0], [0.5, 20.0], [1.5, 20.0], [1.5, 0.0]]
TAPERED = [[0.0, 1.0], [1.0, 19.0], [2.0, 1.0]]


def bolted(**values):
    return jb.Scene().replace({"contact.pressure": MIDDLE} | values)


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


def test_a_bolt_gives_published_sizes_of_chi_and_beta():
    law = iwan4_of_strip(bolted())
    assert float(law.slip_force) == pytest.approx(2.0)
    assert float(law.stiffness) == pytest.approx(3.4e4 / (0.5 + 1.19 * 0.1126))
    assert float(law.chi) == pytest.approx(-0.31, abs=0.01)
    assert float(law.beta) == pytest.approx(0.52, abs=0.01)


def test_the_formula_knows_no_units():
    """Lengths in millimetres, forces in kilonewtons: energies follow."""
    own = iwan4_of_strip(bolted())
    rows = [[1e3 * x, 1e-6 * p] for x, p in MIDDLE]
    values = {"strip.length": 2e3, "strip.axial_stiffness": 34.0, "contact.pressure": rows}
    other = iwan4_of_strip(jb.Scene().replace(values | {"load.amplitude": 1e-3}))
    u = 2e-5
    energy = float(other.dissipation(1e3 * u))
    assert energy == pytest.approx(float(own.dissipation(u)), rel=1e-9)


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"contact.pressure": 10.0}, "has no formula: take the middle half or a taper"),
        ({"contact.pressure": TAPERED, "strip.height_ratio": 0.3}, r"must be 0.01 to 0.2"),
        ({"strip.height_ratio": 0.005}, r"strip.height_ratio = .*must be 0.01 to 0.4"),
        ({"contact.friction": 0.5}, r"contact.friction = 0.5: must be at most 0.3"),
        (
            {"member.support": "rolling", "strip.far_end": "free"},
            "give a homogeneous strip on a rigid base",
        ),
    ],
)
def test_scenes_without_a_formula_are_refused(values, complaint):
    with pytest.raises(jb.InputError, match=complaint):
        iwan4_of_strip(bolted(**values))

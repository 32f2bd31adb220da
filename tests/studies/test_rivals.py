"""The rivals of the benchmarks are worth comparing with: they are right, at what they can do."""

from pathlib import Path

import numpy as np
import pytest
from toy import STRIP

import jbeamshell as jb
from verification.benchmarks.rivals import STIFFNESS, cubic_law, iwan
from verification.benchmarks.rivals import condensed_elements as elements
from verification.benchmarks.rivals import patterns_numpy as patterns

DATA = Path(__file__).parents[2] / "calibration" / "data"
ETA, A = 0.1126, 0.7855
pytestmark = pytest.mark.slow


def dissipation_of(eta, amplitude):
    """By fine finite elements."""
    rows = np.loadtxt(DATA / "energy.csv", delimiter=",", skiprows=1)
    return rows[(rows[:, 0] == eta) & (rows[:, 1] == amplitude), 2].item()


# --- finite elements, condensed -----------------------------------------------------------------


@pytest.mark.parametrize(("eta", "amplitude"), [(0.0511, 0.3247), (ETA, A), (0.2358, 1.6)])
def test_condensed_elements_meet_the_fine_ones(eta, amplitude):
    answer = elements.cycle(elements.Strip(eta), amplitude, 4)
    assert answer["unsettled"] == 0
    assert answer["dissipation"] == pytest.approx(dissipation_of(eta, amplitude), rel=0.01)


def test_condensed_elements_converge():
    sizes = ((20, 2), (40, 4), (80, 8))
    found = [elements.cycle(elements.Strip(ETA, *s), A, 2)["dissipation"] for s in sizes]
    errors = np.abs(np.array(found) / dissipation_of(ETA, A) - 1.0)
    assert np.all(errors[:-1] > 2.0 * errors[1:])


# --- the beamshell in NumPy ---------------------------------------------------------------------


SMALL = {
    "contact.normal": "held",
    "load.steps_per_half_cycle": 8,
    "model.kinematics": "linear",
    "model.nodes": 41,
}


@pytest.mark.parametrize(("eta", "amplitude"), [(0.0511, 0.3247), (ETA, A), (0.4, 1.6)])
@pytest.mark.doubtful("in the corner", "few nodes", "the section squeeze")
def test_patterns_answer_as_jbeamshell_does(eta, amplitude):
    scene = STRIP.replace(SMALL | {"strip.height_ratio": eta, "load.amplitude": amplitude})
    answer = patterns.cycle(patterns.Strip(eta), amplitude, 8, cycles=2)
    assert answer["unsettled"] == 0
    assert answer["dissipation"] == pytest.approx(float(jb.solve(scene).dissipation), rel=1e-9)


# --- Iwan's network -----------------------------------------------------------------------------


def bar(points):
    """Its backbone, of which Masing's rule is exact."""
    force = np.linspace(0.0, 1.0, points + 1)
    return iwan.network(0.5 * force**2 / STIFFNESS, force)


def test_the_network_dissipates_by_masings_rule_to_second_order():
    found = [iwan.cycle(bar(points), 1.0, 8)["dissipation"] for points in (20, 40, 80)]
    errors = np.array(found) / cubic_law(1.0) - 1.0
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 2.0, atol=0.05)


def test_the_network_of_the_mean_backbone_meets_finite_elements():
    rows = np.genfromtxt(DATA / "backbones.csv", delimiter=",", skip_header=1, dtype=None)
    pull, push = (
        np.array([[r["f2"], r["f3"]] for r in rows if r["f0"] == ETA and r["f1"] == way]).T
        for way in ("pull", "push")
    )
    mean = 0.5 * (pull[1] + np.interp(pull[0], -push[0], -push[1]))
    found = iwan.cycle(iwan.network(mean, pull[0]), A, 8)["dissipation"]
    assert found == pytest.approx(dissipation_of(ETA, A), rel=0.01)

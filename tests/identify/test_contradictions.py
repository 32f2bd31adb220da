"""Measurements that contradict each other are named; a wrong model or noise is no contradiction."""

import numpy as np
import pytest
from identify.test_law_fits import PLANTED, loops

from jbeamshell import identify, laws
from jbeamshell.identify.doubts import contradiction

ROWS = [slice(0, 60), slice(60, 120), slice(120, 180)]


def at_minimum(truths, random, noise=0.02, wrong=0.0):
    """Residual and Jacobian of a linear model at the minimum of three measurements together."""
    x = np.linspace(0.0, 1.0, 60)
    jacobian = np.tile(np.stack([np.ones(60), x], axis=1), (3, 1))
    data = np.concatenate([truth + x + wrong * np.sin(9.0 * x) for truth in truths])
    data = data + noise * random.standard_normal(data.size)
    best = np.linalg.lstsq(jacobian, data, rcond=None)[0]
    return jacobian @ best - data, jacobian


def test_the_measurements_that_part_are_found():
    residual, jacobian = at_minimum((1.0, 1.5, 1.1), np.random.default_rng(0))
    axis, low, high, least, most = contradiction(residual, jacobian, ROWS)
    assert (axis, low, high) == (0, 0, 1)
    assert least == pytest.approx(-0.2, abs=0.03)
    assert most == pytest.approx(0.3, abs=0.03)


@pytest.mark.parametrize("wrong", [0.0, 0.3])
def test_noise_and_a_wrong_model_are_no_contradiction(wrong):
    random = np.random.default_rng(1)
    for _ in range(50):
        residual, jacobian = at_minimum((1.0, 1.0, 1.0), random, wrong=wrong)
        assert contradiction(residual, jacobian, ROWS) is None
    assert contradiction(residual[:60], jacobian[:60], ROWS[:1]) is None


@pytest.mark.slow
def test_a_fit_names_loops_that_contradict_each_other_and_values_at_bounds():
    random = np.random.default_rng(0)
    one = loops(laws.Jenkins(1.0, 100.0), random, sizes=(0.03,))
    other = loops(laws.Jenkins(1.1, 100.0), random, sizes=(0.029,))
    said = " ".join(identify.fit(one + other, "jenkins", starts=1).doubts)
    assert "contradict each other: alone, U = 0.03 about 1 and U = 0.029 about 1.1" in said
    alike = loops(laws.Jenkins(1.0, 100.0), random, sizes=(0.029,))
    assert identify.fit(one + alike, "jenkins", starts=1).doubts == []
    wrong = loops(PLANTED["bouc-wen"], random, sizes=(0.012, 0.03))
    assert "contradict" not in " ".join(identify.fit(wrong, "jenkins", starts=1).doubts)
    bounded = [identify.Parameter("jenkins.slip_force", low=1.5, start=2.0), "jenkins.stiffness"]
    fit = identify.fit(one, "jenkins", free=bounded, starts=1, throw=False)
    assert "ends at its bound 1.5" in " ".join(fit.doubts)
    assert np.isnan(fit.errors["jenkins.slip_force"])

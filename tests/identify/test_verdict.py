"""A model that misses energy or stiffness does not describe the data, whatever its misfit."""

import numpy as np
import pytest
from identify.test_law_fits import NOISE, PLANTED, loops

from jbeamshell import identify
from jbeamshell.measured.curves import DissipationCurve, StiffnessCurve


def test_a_law_without_loss_does_not_describe_loops():
    pair = loops(PLANTED["iwan4"], np.random.default_rng(0), sizes=(0.006, 0.012))
    fit = identify.fit(pair, "jenkins", starts=1, throw=False)
    assert fit.misfit < 0.05
    assert not fit.describes
    assert "its energy per cycle is" in fit.doubts[0]


@pytest.mark.parametrize("noise", [NOISE, 0.03])
def test_noise_alone_is_no_fault_of_energy_or_stiffness(noise):
    """Loops that are narrow, so that noise moves their energy much."""
    random = np.random.default_rng(7)
    for _ in range(4):
        data = [
            loop.but(force=loop.force + noise * np.ptp(loop.force) * random.normal(size=65))
            for loop in loops(PLANTED["iwan4"], sizes=(0.003, 0.012))
        ]
        fit = identify.fit(data, "iwan4", starts=1, throw=False)
        assert fit.describes, fit.doubts


def test_a_stretch_of_a_curve_that_is_missed_is_not_described():
    """Energies that wave by 40 % about the law's, and white scatter of 15 %, which is none."""
    law, size = PLANTED["mindlin"], np.geomspace(0.002, 0.012, 16)
    stiffness = StiffnessCurve(size, np.asarray(law.secant_stiffness(size)))
    lost, random = np.asarray(law.dissipation(size)), np.random.default_rng(3)

    def fitted(factor):
        curves = [DissipationCurve(size, factor * lost), stiffness]
        model = identify.Specimen("mindlin", curves, set={"load.control": "displacement"})
        return identify.fit(model, starts=1)

    missed = fitted(np.exp(0.4 * np.sin(np.linspace(0.0, 9.0, 16))))
    assert missed.misfit < 0.3
    assert not missed.describes
    assert "its dissipation at the amplitude" in missed.doubts[0]
    for _ in range(4):
        scattered = fitted(np.exp(0.15 * random.normal(size=16)))
        assert scattered.describes, scattered.doubts


@pytest.mark.slow
def test_the_right_law_of_four_is_chosen():
    names, right = ("iwan4", "bouc-wen", "jenkins", "sliders4"), 0
    for seed in range(20):
        planted = names[seed % 4]
        data = loops(PLANTED[planted], np.random.default_rng(seed))
        chosen = identify.compare(data, names).chosen
        right += chosen is not None and chosen.name == planted
    assert right >= 19

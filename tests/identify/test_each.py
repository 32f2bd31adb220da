"""Many fits, each on its own: planted values, the defaults of a fit, bad input."""

import numpy as np
import pytest
from identify.test_law_fits import loops

import jbeamshell as jb
from jbeamshell import identify, laws
from jbeamshell.identify.each import Fits
from jbeamshell.measured.curves import DissipationCurve

SLIP = "jenkins.slip_force"
PLANTED = [0.8, 1.0, 1.3]


def data():
    """A loop of each planted slip force."""
    return [loops(laws.Jenkins(slip, 100.0), sizes=(0.03,))[0] for slip in PLANTED]


def test_planted_values_come_back_one_by_one_with_the_defaults_of_a_fit():
    """Starts, iterations and doubts of a law, which is only named."""
    seen = []
    fits = identify.fit_each(data(), "jenkins", progress=lambda *now: seen.append(now))
    assert fits.converged.all()
    assert seen == [(1, 3), (2, 3), (3, 3)]
    np.testing.assert_allclose(fits.values[SLIP], PLANTED, rtol=1e-3)
    for place, loop in enumerate(data()):
        alone = jb.fit(loop, "jenkins")
        assert {key: values[place] for key, values in fits.values.items()} == alone.values
        assert {key: errors[place] for key, errors in fits.errors.items()} == alone.errors
        assert fits.doubts[place] == alone.doubts
    assert "3 fits, 3 converged" in str(fits)


def test_bad_input_names_the_fit():
    with pytest.raises(jb.InputError, match="data"):
        identify.fit_each([], "jenkins")
    size = np.array([0.5, 1.5])
    curves = [DissipationCurve(factor * size, size**3) for factor in (1.0, 3.0)]
    with pytest.raises(jb.InputError, match=r"fit 2 of 2: .*gross slip"):
        identify.fit_each(curves, laws.Mindlin(2.0, 50.0), ["mindlin.stiffness"])
    none = Fits({SLIP: np.ones(2)}, {SLIP: np.ones(2)}, np.ones(2), np.zeros(2, bool))
    with pytest.raises(jb.InputError, match="start closer"):
        none.intervals()
    assert str(none) == "2 fits, 0 converged"

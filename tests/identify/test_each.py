"""Many fits, each on its own: planted values, the defaults of a fit, bad input."""

import numpy as np
import pytest
from identify.test_law_fits import loops as law_loops

import jbeamshell as jb
from jbeamshell import identify, laws
from jbeamshell.identify.each import Fits
from jbeamshell.measured.loops import make_loop

MU, ETA = "contact.friction", "strip.height_ratio"
START = jb.Scene().replace({"load.entry": "traction", "model.nodes": 33, "model.section": "plane"})
PLANTED = {MU: [0.08, 0.1, 0.14], ETA: [0.2, 0.25, 0.3]}
POINTS = 32


def loop_of(mu, eta):
    """Loop of a strip."""
    history = jb.solve(START.replace({MU: mu, ETA: eta, "load.amplitude": 10.0 * mu}), throw=False)
    return make_loop(*map(np.asarray, history.loop))


def test_planted_values_come_back_one_by_one():
    loops = [loop_of(mu, eta) for mu, eta in zip(*PLANTED.values(), strict=True)]
    seen = []
    fits = identify.fit_each(
        loops,
        START.replace({MU: 0.12, ETA: 0.22}),
        [MU, ETA],
        points=POINTS,
        progress=lambda *now: seen.append(now),
    )
    assert fits.converged.all()
    assert seen == [(1, 3), (2, 3), (3, 3)]
    for key, planted in PLANTED.items():
        np.testing.assert_allclose(fits.values[key], planted, rtol=2e-4)
    alone = identify.fit(loops[1], START.replace({MU: 0.12, ETA: 0.22}), [MU, ETA], points=POINTS)
    assert fits.values[MU][1] == pytest.approx(alone.values[MU], rel=1e-9)
    assert fits.errors[MU][1] == pytest.approx(alone.errors[MU], rel=1e-6)
    assert "3 fits, 3 converged" in str(fits)


def test_each_fit_has_the_defaults_of_a_fit():
    """Starts, iterations and doubts of a law, which is only named."""
    data = [law_loops(laws.Jenkins(slip, 100.0), sizes=(0.03,))[0] for slip in (1.0, 1.3)]
    fits = identify.fit_each(data, "jenkins")
    for place, loop in enumerate(data):
        alone = jb.fit(loop, "jenkins")
        assert {key: values[place] for key, values in fits.values.items()} == alone.values
        assert fits.doubts[place] == alone.doubts


def test_bad_input_names_the_fit():
    loop = loop_of(0.1, 0.25)
    with pytest.raises(jb.InputError, match="data"):
        identify.fit_each([], START, [MU])
    beyond = make_loop(*(3.0 * np.asarray(column) for column in (loop.force, loop.displacement)))
    with pytest.raises(jb.InputError, match=r"fit 2 of 2: .*gross slip"):
        identify.fit_each([loop, beyond], START, [MU], points=POINTS)
    none = Fits({MU: np.ones(2)}, {MU: np.ones(2)}, np.ones(2), np.zeros(2, bool))
    with pytest.raises(jb.InputError, match="start closer"):
        none.intervals()
    assert str(none) == "2 fits, 0 converged"

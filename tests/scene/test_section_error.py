"""Error of a section, which a run tells from its own slip length, beside plane elasticity."""

import numpy as np
import pytest
from scenes import FEW, PLANE, SQUEEZE

import jbeamshell as jb
from jbeamshell.scene import section_error
from jbeamshell.scene.keys import ENTRIES
from jbeamshell.scene.section_error import in_words


def test_every_kind_has_curves_that_rise_with_less_slip():
    for kind, entries in section_error.curves().items():
        assert set(entries) == set(ENTRIES), kind
        for sections in entries.values():
            for curve in sections.values():
                assert np.all(np.diff(curve["slip_over_H"]) > 0.0)
                for size in ("usual", "largest"):
                    assert np.all(np.diff(curve[size]) <= 0.0)
                assert np.all(np.array(curve["usual"]) <= curve["largest"])
                assert np.all(np.abs(curve["typical"]) <= curve["largest"])


@pytest.mark.parametrize(
    "entry",
    ["member", "guided", *(pytest.param(n, marks=pytest.mark.slow) for n in ("face", "traction"))],
)
def test_a_strip_is_as_far_off_as_its_curve_says(entry):
    """A strip that the study did not draw, from a twentieth to half of gross slip."""
    errors = []
    for amplitude in (0.3, 0.7):
        scene = SQUEEZE.replace({"load.entry": entry, "load.amplitude": amplitude})
        plane = scene.replace({"model.section": "plane"})
        own, exact = (jb.solve(each, throw=False) for each in (scene, plane))
        told = section_error.section_error(scene, float(own.slip_length))
        off = float(own.dissipation / exact.dissipation) - 1.0
        assert abs(off) <= 1.1 * told.largest
        errors.append((off, told.typical))
    off, typical = np.transpose(errors)
    # .02 before the spline: the record of the curves is of nodes that slip one after the other.
    np.testing.assert_allclose(off, typical, rtol=0.6, atol=0.04)


def test_it_is_told_in_words():
    scene = SQUEEZE.replace({"load.amplitude": 0.3})
    text = str(jb.solve(scene, throw=False))
    assert "the force enters a member that goes on beyond the contact" in text
    assert "the section squeeze typically loses" in text
    assert "more than plane elasticity" in text
    assert "load.entry" not in str(jb.solve(PLANE.replace({"load.cycles": 0})))


@pytest.mark.parametrize(
    "section",
    [*(pytest.param(name, marks=pytest.mark.slow) for name in ("bar", "shell")), "squeeze"],
)
def test_a_section_that_the_user_names_is_doubted_where_slip_is_short(section):
    """The doubt says the size and the fix, which leaves none; much slip is never doubted."""
    little, much = (
        jb.Scene().replace({"model.section": section, "load.amplitude": load} | change)
        for load, change in (
            (0.2, {}),
            (1.8, {"strip.height_ratio": 0.03, "model.tolerance": 0.05}),
        )
    )
    with pytest.warns(jb.DoubtfulWarning, match=f"section {section} typically loses .* elasticity"):
        history = jb.solve(little)
    (doubt,) = (doubt for doubt in history.doubts if section in doubt)
    assert "leave model.section open, or take model.section = plane" in doubt
    history = jb.solve(much, throw=False)
    assert history.scene.plan.section == section
    assert not any("typically" in doubt for doubt in history.doubts)
    assert jb.solve(little.replace({"model.section": "auto"})).doubts == ()


def test_a_section_that_is_left_open_is_not_doubted_for_its_section():
    """It climbs by itself; where elasticity cannot stand for it, the tolerance is to itself."""
    own = jb.Scene().replace(FEW | {"strip.kappa_s": 0.5, "load.amplitude": 0.3})
    assert own.plan.section == "squeeze"
    assert not any("typically" in doubt for doubt in jb.solve(own, throw=False).doubts)


@pytest.mark.parametrize(
    "values",
    [
        {"model.section": "plane"},
        {"contact.normal": "compliant"},
        {"contact.smoothing": 16.0},
    ],
)
def test_there_is_none_where_none_was_recorded(values):
    scene = jb.Scene().replace(values)
    assert section_error.section_error(scene, 0.5) is None
    assert in_words(scene, 0.5).endswith("(load.entry = member)")
